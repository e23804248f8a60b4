"""The grasp trial's scene with the hand on a Panda arm: the table stays and the arm lifts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ffhnet.geometry.rotations import quaternion_from_matrix
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.panda.kinematics import forward, refine
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import MOUNT, Scene, add_object, build_scene

MODEL = Path(__file__).with_name("panda.xml")
ARM_PREFIX = "panda/"
"""Before the names of the arm's joints and bodies in a scene."""
NEIGHBOUR = 4
"""Owner of the geoms of other objects, beside `TABLE`, `OBJECT`, `HAND` and `ARM`."""
LIFT_DURATION = 2.0
"""s of the arm's lift. The sinking table of the floating hand lifts without accelerating the object. The arm
does accelerate it, and in half a second by nearly half of gravity, which is another test: `docs/arm.md`."""

_FAR = 8
"""Newton steps that suffice from the grasp to a pose 10 cm or 0.15 rad away."""


@dataclass(frozen=True)
class Mounting:
    """Where the arm stands and how it carries the hand.

    Attributes:
        T_world_base: pose of the arm's base. The table top is z = 0, so that the default arm stands on the
            table, half a metre from an object at the world's origin, and looks at it.
        T_flange_root: pose of the hand's root frame on the flange. The DLR-HIT Hand II of the original
            experiments sits on it without an offset: fingers along the last axis.
    """

    T_world_base: Float[np.ndarray, "4 4"] = field(
        default_factory=lambda: make_transform(position=np.array([-0.5, 0.0, 0.0]))
    )
    T_flange_root: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))

    def flange_pose(self, T_world_root: Float[np.ndarray, "*batch 4 4"]) -> Float[np.ndarray, "*batch 4 4"]:
        """T_base_flange that puts the hand's root at a pose in the world."""
        return invert(self.T_world_base) @ T_world_root @ invert(self.T_flange_root)


@dataclass
class Posture:
    """Joint angles (rad) of the arm.

    Attributes:
        branch: where the arm looks for solutions near by.
        target: what its actuators were last told.
        height: m that the hand was raised.
    """

    branch: Float[np.ndarray, " 7"] = field(default_factory=lambda: np.zeros(7))
    target: Float[np.ndarray, " 7"] = field(default_factory=lambda: np.zeros(7))
    height: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ArmScene(Scene):
    """A scene in which an arm holds the hand with stiff position actuators.

    Attributes:
        mounting: where the arm stands and how it carries the hand.
        arm_qpos: qpos index of the arm's joints.
        arm_actuators: ctrl index of the arm's joints.
        velocity_gain: s; target speed times this is added to the targets, which takes away the lag that the
            actuators' damping would cause.
        posture: scratch space: what the arm is told at the moment.
        neighbour_qpos: qpos index of the free joint of each other object.
    """

    mounting: Mounting
    arm_qpos: Int[np.ndarray, " 7"]
    arm_actuators: Int[np.ndarray, " 7"]
    velocity_gain: Float[np.ndarray, " 7"]
    posture: Posture
    neighbour_qpos: Int[np.ndarray, " K"]

    def place_hand(self, T_world_root: Float[np.ndarray, "4 4"], joints: Float[np.ndarray, " J"]) -> None:
        """Sets the hand's joints, and the arm's so that the hand's root is at the pose, on its branch.

        A pose that the branch does not reach is approximated.
        """
        T_base_flange = self.mounting.flange_pose(T_world_root)
        self.place_arm(refine(self.posture.branch, T_base_flange, _FAR), joints)

    def place_arm(self, q: Float[np.ndarray, " 7"], joints: Float[np.ndarray, " J"]) -> None:
        """Sets the arm's joint angles and the hand's, coupled joints included (rad)."""
        self.data.qpos[self.arm_qpos] = q
        self.place_fingers(joints)
        self.data.ctrl[self.arm_actuators] = q
        self.posture.target, self.posture.height = q, 0.0

    def place_neighbour(self, index: int, T_world_object: Float[np.ndarray, "4 4"]) -> None:
        """Sets the pose of one of the other objects."""
        q = self.neighbour_qpos[index]
        self.data.qpos[q : q + 3] = T_world_object[:3, 3]
        self.data.qpos[q + 3 : q + 7] = quaternion_from_matrix(T_world_object[:3, :3])

    def drive_arm(self, q: Float[np.ndarray, " 7"]) -> None:
        """Sends the arm to joint angles (rad) a control period ahead, and keeps it from lagging."""
        speed = (q - self.posture.target) / self.physics.control_period
        self.data.ctrl[self.arm_actuators] = q + self.velocity_gain * speed
        self.posture.target = q

    def raise_hand(self, height: float) -> None:
        """Sends the arm to the joint angles with which the hand is `height` (m) over where it closed."""
        posture = self.posture
        T_base_flange = forward(posture.target)
        T_base_flange[:3, 3] += (height - posture.height) * self.mounting.T_world_base[2, :3]
        # One step: what it leaves is a thousandth of the way of a control period, and corrected in the next.
        self.drive_arm(refine(posture.target, T_base_flange, steps=1))
        posture.height = height


def build_arm_scene(
    hand: Hand,
    obj: GraspObject | None,
    physics: Physics | None = None,
    mounting: Mounting | None = None,
    neighbours: Sequence[GraspObject] = (),
) -> ArmScene:
    """Compiles the scene of one hand on the arm and one object, or none, and others that stand around.

    Args:
        hand: the hand.
        obj: the object, or None.
        physics: constants; those of the floating hand with a slower lift (`LIFT_DURATION`) if none are given.
        mounting: where the arm stands and how it carries the hand.
        neighbours: other objects, at the world's origin until they are placed.
    """
    physics = physics or Physics(lift_duration=LIFT_DURATION)
    mounting = mounting or Mounting()

    names = [f"neighbour_{i}" for i in range(len(neighbours))]

    def add_mount(spec: mujoco.MjSpec) -> mujoco.MjsBody:
        base = spec.worldbody.add_frame(
            pos=mounting.T_world_base[:3, 3], quat=quaternion_from_matrix(mounting.T_world_base[:3, :3])
        )
        arm = mujoco.MjSpec.from_file(str(MODEL))
        base.attach_body(arm.body("link0"), ARM_PREFIX, "")
        for i, neighbour in enumerate(neighbours):
            add_object(spec, neighbour, names[i])
        return spec.body(f"{ARM_PREFIX}flange").add_body(
            name=MOUNT,
            pos=mounting.T_flange_root[:3, 3],
            quat=quaternion_from_matrix(mounting.T_flange_root[:3, :3]),
        )

    scene = build_scene(hand, obj, physics, add_mount)
    model = scene.model
    # The controller knows the weight of the hand; fingers and object are too light to matter.
    model.body_gravcomp[model.body_parentid == model.body(MOUNT).id] = 1.0
    joints = [f"{ARM_PREFIX}joint{i}" for i in range(1, 8)]
    actuators = np.array([model.actuator(joint).id for joint in joints])
    # In MuJoCo a position actuator's force is kp (target - angle) - kv speed.
    velocity_gain = model.actuator_biasprm[actuators, 2] / model.actuator_biasprm[actuators, 1]
    bodies = [model.body(name) for name in names]
    scene.geom_owner[np.isin(model.geom_bodyid, [body.id for body in bodies])] = NEIGHBOUR
    return ArmScene(
        **{f.name: getattr(scene, f.name) for f in fields(Scene)},
        mounting=mounting,
        arm_qpos=np.array([model.joint(joint).qposadr[0] for joint in joints]),
        arm_actuators=actuators,
        velocity_gain=velocity_gain,
        posture=Posture(),
        neighbour_qpos=np.array([model.jnt_qposadr[body.jntadr[0]] for body in bodies], dtype=int),
    )
