"""Which grasps a Panda reaches in an observed scene, and the joint angles of its way. Needs MuJoCo."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.feasibility.reasons import Reason
from ffhnet.feasibility.scene import ObservedScene
from ffhnet.feasibility.shapes import Shapes
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasp_plan import ArmMotion
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.hands.kinematics import read_mjcf
from ffhnet.perception.observation import Observation
from ffhnet.perception.view_frame import view_frame
from ffhnet.simulation.panda.kinematics import joint_frames
from ffhnet.simulation.panda.reach import PandaReach, Reach
from ffhnet.simulation.panda.scene import MODEL, Mounting
from ffhnet.simulation.physics import Physics

ROBOT = "panda"
JOINT_NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))
"""As the manufacturer's driver names them."""

_MARGIN = 0.02
"""m that the links keep from what was seen: the cells of their grid are that coarse."""

_PITCH, _CELL = 0.04, 0.025
_REACH = 0.095
"""m: of the probes of the links, the cells, and how far a probe looks."""

_RADIUS = 1.0
"""m around the object within which the arm looks for obstacles."""


@dataclass(frozen=True)
class Base:
    """Where the arm's base stands in an observation's level frame (`observed_level_frame`), m and rad."""

    x: float
    y: float
    z: float
    yaw: float

    @classmethod
    def of(cls, T_level_base: Float[np.ndarray, "4 4"]) -> Base:
        """From a pose whose z axis points up."""
        x, y, z = T_level_base[:3, 3]
        return cls(float(x), float(y), float(z), float(np.arctan2(T_level_base[1, 0], T_level_base[0, 0])))

    @property
    def T_level_base(self) -> Float[np.ndarray, "4 4"]:
        """Its pose."""
        turn = matrix_from_rotation_vector(np.array([0.0, 0.0, self.yaw]))
        return make_transform(turn, np.array([self.x, self.y, self.z]))


def level_frame(
    up: Float[np.ndarray, " 3"], table: float, ahead: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """T_input_level: the frame in which a robot's base is given; its origin is on the table, z points up.

    Args:
        up: direction against gravity in the input frame.
        table: m along it from the input frame's origin to the table.
        ahead: a direction in the input frame, whose projection on the table is x.
    """
    level = view_frame(np.zeros((1, 3)), up, ahead)
    level[:3, 3] = table * level[:3, 2]
    return level


def observed_level_frame(observation: Observation) -> Float[np.ndarray, "4 4"]:
    """The level frame of an observation.

    Of a capture in the camera's frame, the origin is below the camera, and x is the optical axis seen from
    above. Of a cloud in a frame of its own it is that frame, moved up or down to the table.
    """
    ahead = np.eye(3)[2 if observation.frame == "camera" else 0]
    table = observation.up @ observation.T_input_view[:3, 3] + observation.table_height
    return level_frame(observation.up, float(table), ahead)


class ArmCheck:
    """Plans the Panda's ways to grasps, up, and past what was seen."""

    def __init__(self, hand: Hand, base: Base, physics: Physics | None = None) -> None:
        self._mounting = Mounting(T_world_base=base.T_level_base)
        self._reach = PandaReach.for_object(hand, physics=physics, mounting=self._mounting)
        arm = read_mjcf(MODEL)
        # The base stands where it stands.
        moving = tuple(geom for geom in arm.geoms if arm.bodies[geom.body].parent >= 0)
        self._links = Shapes.of(dataclasses.replace(arm, geoms=moving), _PITCH)

    def look(self, observation: Observation) -> ObservedScene:
        """The scene of an observation, wide enough for an arm."""
        return ObservedScene.of(observation, _RADIUS, _REACH, _CELL)

    def plan(
        self, grasps: Grasps, observation: Observation, scene: ObservedScene
    ) -> tuple[Int[np.ndarray, " N"], ArmMotion]:
        """The `Reason` of each grasp (in the observation's input frame), and the arm's ways (NaN without)."""
        T_input_level = observed_level_frame(observation)
        T_view_base = invert(observation.T_input_view) @ T_input_level @ self._mounting.T_world_base

        def blocked(q: Float[np.ndarray, "K 7"]) -> Bool[np.ndarray, " K"]:
            return self._hits(T_view_base, q, scene)

        paths = self._reach.plan(grasps.to_frame(invert(T_input_level), "level"), blocked=blocked)
        too_far = (paths.reason == Reach.NO_POSTURE) | (paths.reason == Reach.NO_PATH)
        reason = np.select(
            [paths.reachable, too_far], [Reason.FEASIBLE, Reason.UNREACHABLE], Reason.ARM_COLLISION
        )
        T_input_base = T_input_level @ self._mounting.T_world_base
        return reason, ArmMotion(ROBOT, JOINT_NAMES, T_input_base, paths.approach, paths.lift)

    def _hits(
        self, T_view_base: Float[np.ndarray, "4 4"], q: Float[np.ndarray, "K 7"], scene: ObservedScene
    ) -> Bool[np.ndarray, " K"]:
        """Whether a moving link is too near to something that was seen, at each of the joint angles."""
        still = np.broadcast_to(np.eye(4), (len(q), 1, 4, 4))
        links = self._links.place(T_view_base @ np.concatenate([still, joint_frames(q)], axis=1))
        near = links.near(scene.grid, np.arange(len(q)), np.zeros((len(q), 3)))
        hit = np.zeros(len(q), dtype=bool)
        hit[near.row[near.distance < _MARGIN]] = True
        return hit
