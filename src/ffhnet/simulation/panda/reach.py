"""Which grasps the Panda reaches: straight approach, grasp and lift on one branch, free of arm collisions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.errors import OptionError
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.panda.kinematics import inverse, least_motion, reaches, refine, within_limits
from ffhnet.simulation.panda.scene import ArmScene, Mounting, Posture, build_arm_scene
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import ARM, HAND, OBJECT, TABLE

POSTURES = 8
"""Solutions of the inverse kinematics that are followed for each grasp."""
LIFT_STEPS = 4
"""Poses checked along the lift, after the grasp itself."""
MAX_STEP = 0.4
"""rad that no joint may exceed between neighbouring poses of the path (at most 5 cm apart)."""


class Reach(IntEnum):
    """Why a grasp is out of the arm's reach; of collisions, that of the last posture tried."""

    REACHABLE = 0
    NO_POSTURE = 1  # no joint angles within limits put the hand at the grasp
    NO_PATH = 2  # approach or lift leave the workspace, or jump to another branch
    HITS_TABLE = 3  # the arm does, not the hand
    HITS_OBJECT = 4
    HITS_ITSELF = 5  # the arm touches another link or the hand
    BLOCKED = 6  # what the caller knows of is in the arm's way


_HIT_BY_OWNER = {
    TABLE: Reach.HITS_TABLE,
    OBJECT: Reach.HITS_OBJECT,
    HAND: Reach.HITS_ITSELF,
    ARM: Reach.HITS_ITSELF,
}


@dataclass(frozen=True)
class ArmPaths:
    """One row per grasp; NaN where it cannot be reached.

    Attributes:
        reason: a `Reach`.
        approach: joint angles from the start of the straight approach to the grasp (last), rad.
        lift: joint angles on the way up, from above the grasp to the top (last), rad.
    """

    reason: Int[np.ndarray, " N"]
    approach: Float[np.ndarray, "N A 7"]
    lift: Float[np.ndarray, "N L 7"]

    @property
    def reachable(self) -> Bool[np.ndarray, " N"]:
        """Whether the whole path can be driven."""
        return self.reason == Reach.REACHABLE


class PandaReach:
    """Plans the arm's way to grasps and up.

    The hand's own contacts with table and object are not its business: `GraspTrial.free` has them.
    """

    def __init__(self, scene: ArmScene) -> None:
        # Its own state, so that planning does not disturb a trial in the same scene.
        self._scene = dataclasses.replace(scene, data=mujoco.MjData(scene.model), posture=Posture())
        self._hand, physics = scene.hand, scene.physics
        backs = np.linspace(-physics.approach_distance, 0, physics.approach_steps)
        self._approach = make_transform(position=backs[:, None] * np.array([1.0, 0, 0]))
        heights = np.linspace(0, physics.lift_height, LIFT_STEPS + 1)[1:]
        self._lift = make_transform(position=heights[:, None] * np.array([0, 0, 1.0]))

    @classmethod
    def for_object(
        cls,
        hand: Hand,
        obj: GraspObject | None = None,
        physics: Physics | None = None,
        mounting: Mounting | None = None,
    ) -> PandaReach:
        """Reach over a table with this object on it, or with none."""
        return cls(build_arm_scene(hand, obj, physics, mounting))

    def reachable(
        self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"] | None = None
    ) -> Bool[np.ndarray, " N"]:
        """Whether the arm reaches each grasp (world frame, table top z = 0)."""
        return self.plan(grasps, T_world_object).reachable

    def plan(
        self,
        grasps: Grasps,
        T_world_object: Float[np.ndarray, "4 4"] | None = None,
        blocked: Callable[[Float[np.ndarray, "K 7"]], Bool[np.ndarray, " K"]] | None = None,
    ) -> ArmPaths:
        """The arm's path for each grasp.

        Args:
            grasps: palm poses in the world frame, table top z = 0.
            T_world_object: pose of the object; needed where the scene has one.
            blocked: says of joint angles whether anything that is not in the scene is in the arm's way.

        Raises:
            OptionError: a pose for no object, or none for one.
        """
        if (T_world_object is None) != (self._scene.object_body < 0):
            raise OptionError("wanted an object's pose exactly where the scene has an object")
        T_world_palm = make_transform(grasps.rotation, grasps.position)[:, None]
        T_palm_root = self._hand.root_pose(np.eye(3), np.zeros(3))
        flange_pose = self._scene.mounting.flange_pose
        approach = flange_pose(T_world_palm @ self._approach @ T_palm_root)
        lift = flange_pose(self._lift @ T_world_palm @ T_palm_root)

        solutions = inverse(approach[:, -1])
        solutions = solutions.reshape(len(grasps), solutions.shape[1] * solutions.shape[2], 7)
        start = self._promising(solutions)
        path = np.concatenate([_walk(start, approach[:, ::-1])[:, :, ::-1], _walk(start, lift)], axis=2)
        jumps = np.abs(np.diff(path, axis=2)).max(axis=(2, 3))
        smooth = jumps <= MAX_STEP

        reason = np.full(len(grasps), Reach.NO_POSTURE, dtype=np.int8)
        reason[~np.isnan(solutions).all(axis=(1, 2))] = Reach.NO_PATH
        chosen = np.full((len(grasps), *path.shape[2:]), np.nan)
        order = np.argsort(np.where(smooth, jumps, np.inf), axis=1, kind="stable")
        for attempt in range(order.shape[1]):
            k = order[:, attempt]
            left = np.flatnonzero((reason != Reach.REACHABLE) & smooth[np.arange(len(k)), k])
            found = path[left, k[left]]
            hits = [
                self._first_hit(q, grasps.joints[i], T_world_object) for i, q in zip(left, found, strict=True)
            ]
            reason[left] = hits
            if blocked is not None:
                in_the_way = blocked(found.reshape(-1, 7)).reshape(found.shape[:2]).any(axis=1)
                reason[left[in_the_way]] = Reach.BLOCKED
            done = reason[left] == Reach.REACHABLE
            chosen[left[done]] = found[done]
        num_approach = len(self._approach)
        return ArmPaths(reason, chosen[:, :num_approach], chosen[:, num_approach:])

    def _promising(self, solutions: Float[np.ndarray, "N K 7"]) -> Float[np.ndarray, "N M 7"]:
        """The solutions whose lift, seen from the grasp, needs least motion and stays within the limits."""
        flat = solutions.reshape(-1, 7)
        exists = ~np.isnan(flat).any(axis=1)
        up = self._scene.physics.lift_height * self._scene.mounting.T_world_base[2, :3]
        motion = least_motion(flat[exists], np.array([*up, 0.0, 0.0, 0.0]))
        effort = np.full(len(flat), np.inf)
        effort[exists] = np.abs(motion).max(axis=1)
        effort[exists] += np.where(within_limits(flat[exists] + motion), 0.0, 100.0)
        best = np.argsort(effort.reshape(solutions.shape[:2]), axis=1, kind="stable")[:, :POSTURES]
        return np.take_along_axis(solutions, best[:, :, None], axis=1)

    def _first_hit(
        self,
        path: Float[np.ndarray, "P 7"],
        joints: Float[np.ndarray, " J"],
        T_world_object: Float[np.ndarray, "4 4"] | None,
    ) -> Reach:
        """What the arm touches on its way, or REACHABLE. On the lift the object comes along."""
        at_grasp, scene = len(self._approach) - 1, self._scene
        mujoco.mj_resetData(scene.model, scene.data)
        if T_world_object is not None:
            scene.place_object(T_world_object)
        # The grasp itself first: it is where most contacts are found.
        for k in np.argsort(np.abs(np.arange(len(path)) - at_grasp), kind="stable"):
            scene.place_arm(path[k], joints if k > at_grasp else self._hand.open(joints))
            if T_world_object is not None:
                lifted = self._lift[k - at_grasp - 1, 2, 3] if k > at_grasp else 0.0
                scene.data.qpos[scene.object_qpos + 2] = T_world_object[2, 3] + lifted
            mujoco.mj_kinematics(scene.model, scene.data)
            mujoco.mj_collision(scene.model, scene.data)
            owners = scene.geom_owner[scene.data.contact.geom]
            hits = owners[(owners == ARM).any(axis=1)]
            if len(hits):
                return _HIT_BY_OWNER[int(hits[0].min())]
        return Reach.REACHABLE


def _walk(
    start: Float[np.ndarray, "N M 7"], T_base_flange: Float[np.ndarray, "N P 4 4"]
) -> Float[np.ndarray, "N M P 7"]:
    """Joint angles along the poses with least motion from the start; NaN from the first one out of reach."""
    q = start.reshape(-1, 7).copy()
    path = np.full((len(q), T_base_flange.shape[1], 7), np.nan)
    going = np.flatnonzero(~np.isnan(q).any(axis=1))
    for p in range(T_base_flange.shape[1]):
        wanted = T_base_flange[going // start.shape[1], p]
        q[going] = refine(q[going], wanted)
        arrived = reaches(q[going], wanted)
        going = going[arrived]
        path[going, p] = q[going]
    return path.reshape(*start.shape[:2], *path.shape[1:])
