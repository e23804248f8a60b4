"""`Hand`: everything the other rooms need to know of a hand, from its TOML and MJCF."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.errors import HandError
from ffhnet.geometry.rotations import matrix_from_euler_xyz
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.hands.confinement import check_inside
from ffhnet.hands.kinematics import KinematicTree, read_mjcf
from ffhnet.hands.packaged import PackagedModel

if TYPE_CHECKING:
    import mujoco
    import trimesh

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DEFAULT_HAND = "dlr_hit_ii"


@dataclass(frozen=True)
class ClosingMotion:
    """How the fingers close (section IV-B, "closing primitive").

    Attributes:
        moves: for each joint, 1 if it closes, 0 if it holds the grasp's angle throughout.
        speed: rad/s of the closing joints' targets.
        lead: rad that a target may be ahead of its joint; with the torque limit it decides the squeeze.
        duration: s of closing, from the open hand.
        squeeze: s for which the last targets are kept before the lift.
    """

    moves: Float[np.ndarray, " J"]
    speed: float
    lead: float
    duration: float
    squeeze: float


@dataclass(frozen=True)
class Hand:
    """A hand: kinematics, palm frame, eigengrasps and closing motion.

    Attributes:
        name: the hand's name, as in files and weights.
        mjcf: path of the MuJoCo model.
        converted: the model itself where `mjcf` is a package's and was rewritten (`packaged.py`), else None.
        joint_names: the actuated joints in the order of every joint array.
        T_root_palm: pose of the palm frame in the hand's root frame.
        eigengrasp_origin: joint angles at all weights zero, rad.
        eigengrasps: E directions in joint space, rad (section IV-B.2).
        closing: the closing motion.
    """

    name: str
    mjcf: Path
    joint_names: tuple[str, ...]
    T_root_palm: Float[np.ndarray, "4 4"]
    eigengrasp_origin: Float[np.ndarray, " J"]
    eigengrasps: Float[np.ndarray, "E J"]
    closing: ClosingMotion
    converted: str | None = None

    @cached_property
    def tree(self) -> KinematicTree:
        """Bodies, shapes and fingertips, read from the MJCF."""
        return read_mjcf(self.mjcf, self.converted)

    def spec(self) -> mujoco.MjSpec:
        """The MuJoCo model, to be compiled or attached to others; ValueError where MuJoCo cannot read it."""
        import mujoco

        if self.converted is not None:
            return mujoco.MjSpec.from_string(self.converted)
        return mujoco.MjSpec.from_file(str(self.mjcf))

    @cached_property
    def lower(self) -> Float[np.ndarray, " J"]:
        """Lower joint limits, rad."""
        return np.array([self.tree.joints[name].lower for name in self.joint_names])

    @cached_property
    def upper(self) -> Float[np.ndarray, " J"]:
        """Upper joint limits, rad."""
        return np.array([self.tree.joints[name].upper for name in self.joint_names])

    @cached_property
    def torque_limit(self) -> Float[np.ndarray, " J"]:
        """Largest torque of each joint's actuator, Nm; infinite where the MJCF gives none."""
        return np.array([self.tree.torque_limits.get(name, np.inf) for name in self.joint_names])

    @property
    def num_joints(self) -> int:
        """Number of actuated joints."""
        return len(self.joint_names)

    def body_poses(self, joints: Float[Tensor, "B J"]) -> Float[Tensor, "B L 4 4"]:
        """T_palm_body of every link for batched joint angles (rad)."""
        return self.tree.body_poses(joints, self.joint_names, invert(self.T_root_palm))

    def fingertips(self, joints: Float[Tensor, "B J"]) -> Float[Tensor, "B F 3"]:
        """Positions of the fingertips (the MJCF's sites, in its order) in the palm frame, metres."""
        poses = self.body_poses(joints)
        tips = [
            poses[:, site.body, :3, :3] @ torch.as_tensor(site.position, dtype=joints.dtype)
            + poses[:, site.body, :3, 3]
            for site in self.tree.sites
        ]
        return torch.stack(tips, dim=1)

    def root_pose(
        self, rotation: Float[np.ndarray, "3 3"], position: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, "4 4"]:
        """T_frame_root of the hand whose palm stands at the given pose in some frame."""
        return make_transform(rotation, position) @ invert(self.T_root_palm)

    def open(self, joints: Float[np.ndarray, "*batch J"]) -> Float[np.ndarray, "*batch J"]:
        """The same grasps with the closing joints at their lower limits: the hand as it approaches."""
        return np.where(self.closing.moves > 0, self.lower, joints)

    @cached_property
    def body_shapes(self) -> tuple[trimesh.Trimesh, ...]:
        """The collision shapes of every link in its own frame, one mesh each (empty where it has none)."""
        from ffhnet.hands.shapes import body_meshes  # here, because trimesh takes long to import

        return body_meshes(self.tree)

    def shape(self, joints: Float[np.ndarray, " J"]) -> trimesh.Trimesh:
        """One mesh of the hand's collision shapes in the palm frame, for pictures."""
        from ffhnet.hands.shapes import placed  # likewise

        poses = self.body_poses(torch.as_tensor(joints, dtype=torch.float64)[None])[0]
        return placed(self.body_shapes, poses.numpy())


@lru_cache
def load_hand(name_or_toml: str = DEFAULT_HAND) -> Hand:
    """A built-in hand by name, or any hand by the path of its TOML. Raises HandError."""
    folder = Path(__file__).parent
    path = Path(name_or_toml)
    if path.suffix != ".toml":
        path = folder / name_or_toml / "hand.toml"
        if not path.is_file():
            known = ", ".join(sorted(p.parent.name for p in folder.glob("*/hand.toml")))
            raise HandError(f"unknown hand '{name_or_toml}': wanted one of {known}, or a .toml file")
    try:
        description = tomllib.loads(path.read_text())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise HandError(f"cannot read the hand description {path}: {error}") from error
    try:
        hand = _from_description(description, path.parent)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise HandError(
            f"{path}: a field is missing or malformed ({type(error).__name__}: {error})"
        ) from error
    _check(hand)
    return hand


def _from_description(description: dict[str, Any], folder: Path) -> Hand:
    if "package" in description:
        packaged = PackagedModel.from_description(description["package"])
        joint_names, mjcf, converted = packaged.joint_order, packaged.path, packaged.convert()
    else:
        joint_names, mjcf, converted = tuple(description["joint_order"]), folder / description["model"], None
        check_inside(folder, Path(description["model"]))
    closing = description["closing"]
    closes = {name: {name, name.rpartition("_")[2]} & set(closing["joints"]) for name in joint_names}
    unknown = set(closing["joints"]).difference(*closes.values())
    if unknown:
        raise HandError(f"closing.joints names unknown joints: {', '.join(sorted(unknown))}")
    palm = description["palm"]
    return Hand(
        name=description["name"],
        mjcf=mjcf,
        joint_names=joint_names,
        T_root_palm=make_transform(
            matrix_from_euler_xyz(np.array(palm["rpy"], dtype=float)), np.array(palm["position"], dtype=float)
        ),
        eigengrasp_origin=np.array(description["eigengrasps"]["origin"], dtype=float),
        eigengrasps=np.array(description["eigengrasps"]["directions"], dtype=float),
        closing=ClosingMotion(
            moves=np.array([float(bool(closes[name])) for name in joint_names]),
            speed=float(closing["speed"]),
            lead=float(closing["lead"]),
            duration=float(closing["duration"]),
            squeeze=float(closing["squeeze"]),
        ),
        converted=converted,
    )


def _check(hand: Hand) -> None:
    """Raises HandError where the TOML and the MJCF do not fit each other."""
    joints = hand.tree.joints
    coupled = {coupling.follower for coupling in hand.tree.couplings}
    wanted = set(joints) - coupled
    if set(hand.joint_names) != wanted or len(hand.joint_names) != len(wanted):
        missing, extra = wanted - set(hand.joint_names), set(hand.joint_names) - wanted
        raise HandError(
            f"joint_order of hand '{hand.name}' must name each uncoupled joint of {hand.mjcf.name} once: "
            f"missing {sorted(missing)}, unknown or coupled {sorted(extra)}"
        )
    for name, array in (("origin", hand.eigengrasp_origin), ("directions", hand.eigengrasps)):
        if array.shape[-1] != hand.num_joints:
            raise HandError(f"eigengrasps.{name} must give {hand.num_joints} angles, got {array.shape[-1]}")
