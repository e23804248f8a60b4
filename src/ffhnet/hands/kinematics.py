"""Forward kinematics and shapes of a hand, read from its MJCF without MuJoCo.

Reads the subset of MJCF that a hand needs: nested bodies with `pos` and `quat`, at most one hinge joint
through each body's origin, box, capsule, cylinder and sphere geoms, sites, and joint equalities.
Anything else that would move a body is refused rather than ignored.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.errors import HandError
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.geometry.transforms import make_transform
from ffhnet.hands.confinement import check_confined


@dataclass(frozen=True)
class Geom:
    """A primitive collision shape: MuJoCo's type and half sizes, its pose in its body's frame (metres)."""

    name: str
    body: int
    type: str
    size: tuple[float, ...]
    T_body_geom: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class Joint:
    """A hinge: its unit axis in the body's frame and its limits in radians."""

    name: str
    axis: Float[np.ndarray, " 3"]
    lower: float
    upper: float


@dataclass(frozen=True)
class Body:
    """A link: its parent's index (-1 for the root) and its pose in the parent when the joint is at zero."""

    name: str
    parent: int
    T_parent_body: Float[np.ndarray, "4 4"]
    joint: Joint | None


@dataclass(frozen=True)
class Site:
    """A named point in a body's frame (metres)."""

    name: str
    body: int
    position: Float[np.ndarray, " 3"]


@dataclass(frozen=True)
class Coupling:
    """The joint `follower` = polynomial of the joint `leader`, coefficients in rising powers."""

    follower: str
    leader: str
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class KinematicTree:
    """Bodies in an order where parents come first, with shapes, sites, couplings and torque limits (Nm)."""

    bodies: tuple[Body, ...]
    geoms: tuple[Geom, ...]
    sites: tuple[Site, ...]
    couplings: tuple[Coupling, ...]
    torque_limits: dict[str, float]

    @property
    def joints(self) -> dict[str, Joint]:
        """Every hinge by name, coupled ones too."""
        return {body.joint.name: body.joint for body in self.bodies if body.joint is not None}

    def body_poses(
        self,
        joints: Float[Tensor, "B J"],
        joint_names: tuple[str, ...],
        T_frame_root: Float[np.ndarray, "4 4"] | None = None,
    ) -> Float[Tensor, "B L 4 4"]:
        """Poses of all L bodies for joint angles (rad) of the uncoupled joints `joint_names`.

        In the frame in which `T_frame_root` is the root's pose, or if none in that of the root.
        """
        angle = {name: joints[:, i] for i, name in enumerate(joint_names)}
        for coupling in self.couplings:
            leader = angle[coupling.leader]
            angle[coupling.follower] = sum(
                (c * leader**power for power, c in enumerate(coupling.coefficients) if c != 0),
                start=torch.zeros_like(leader),
            )
        still = torch.zeros_like(joints[:, 0])
        angles = [still if body.joint is None else angle[body.joint.name] for body in self.bodies]
        fixed, axes = (
            torch.as_tensor(part, dtype=joints.dtype, device=joints.device) for part in self._constants
        )
        if T_frame_root is not None:
            root = torch.as_tensor(T_frame_root, dtype=joints.dtype, device=joints.device) @ fixed[:1]
            fixed = torch.cat([root, fixed[1:]])
        return link_poses(fixed, axes, [body.parent for body in self.bodies], torch.stack(angles, dim=1))

    @cached_property
    def _constants(self) -> tuple[Float[np.ndarray, "L 4 4"], Float[np.ndarray, "L 3"]]:
        """T_parent_body, and the axis of each body's joint; zero without a joint."""
        axes = [np.zeros(3) if body.joint is None else body.joint.axis for body in self.bodies]
        return np.stack([body.T_parent_body for body in self.bodies]), np.stack(axes)


def link_poses(
    fixed: Float[Tensor, "L 4 4"],
    axis: Float[Tensor, "L 3"],
    parent: Sequence[int],
    angle: Float[Tensor, "B L"],
) -> Float[Tensor, "B L 4 4"]:
    """Poses of links that turn by some angles (rad), in the frame of the first one's fixed pose.

    Args:
        fixed: pose of each link in its parent at angle zero.
        axis: unit axis about which it turns, zero where it does not.
        parent: of each link, one before it; not read for the first, which has none.
        angle: of each link.
    """
    cross = nn.functional.pad(_cross_products(axis), (0, 1, 0, 1))
    once, twice = fixed @ cross, fixed @ cross @ cross
    # Rodrigues' formula, with the batch last: so it is a few products of long rows, and not many of small
    # matrices, which take ten times as long.
    angle = angle.T[:, None, None]
    sine, versine = torch.sin(angle), 1 - torch.cos(angle)
    local = (fixed[..., None] + sine * once[..., None] + versine * twice[..., None]).unbind()
    poses = [local[0]]
    for number, link in zip(parent[1:], local[1:], strict=True):
        poses.append((poses[number][:, :, None] * link).sum(dim=1))
    return torch.stack(poses).permute(3, 0, 1, 2)


def _cross_products(axis: Float[Tensor, "L 3"]) -> Float[Tensor, "L 3 3"]:
    """The matrices of the cross products with some vectors."""
    x, y, z = axis.unbind(dim=-1)
    nothing = torch.zeros_like(x)
    return torch.stack([nothing, -z, y, z, nothing, -x, -y, x, nothing], dim=-1).unflatten(-1, (3, 3))


def read_mjcf(path: Path, text: str | None = None) -> KinematicTree:
    """The kinematic tree of a hand's MJCF; raises HandError where it is not a hand of the subset.

    Args:
        path: the file.
        text: what to read instead of its content.
    """
    try:
        root = ET.parse(path).getroot() if text is None else ET.fromstring(text)
    except (OSError, ET.ParseError) as error:
        raise HandError(f"cannot read the hand model {path.name}: {error}") from error
    check_confined(root, path)
    try:
        return _read_tree(root, path)
    except (KeyError, ValueError, IndexError, RecursionError) as error:
        raise HandError(
            f"the hand model {path.name} is malformed ({type(error).__name__}: {error})"
        ) from error


def _read_tree(root: ET.Element, path: Path) -> KinematicTree:
    world = root.find("worldbody")
    tops = [] if world is None else world.findall("body")
    if len(tops) != 1:
        raise HandError(f"{path.name} must hold exactly one root body, got {len(tops)}")
    defaults = _Defaults(root.find("default"))
    reader = _Reader(defaults)
    reader.add_body(tops[0], -1, None)
    couplings = tuple(
        Coupling(e.attrib["joint1"], e.attrib["joint2"], _floats(e.get("polycoef", "0 1 0 0 0")))
        for e in root.iterfind("equality/joint")
    )
    actuators = [(e.get("joint", ""), defaults.attributes(e, None)) for e in root.iterfind("actuator/*")]
    torque_limits = {
        joint: min(abs(force) for force in _floats(attributes["forcerange"]))
        for joint, attributes in actuators
        if "forcerange" in attributes
    }
    return KinematicTree(
        tuple(reader.bodies), tuple(reader.geoms), tuple(reader.sites), couplings, torque_limits
    )


class _Defaults:
    """Attributes by default class and element, with inheritance."""

    def __init__(self, top: ET.Element | None) -> None:
        self._classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        if top is not None:
            self._add(top, {})

    def _add(self, element: ET.Element, inherited: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(attributes) for tag, attributes in inherited.items()}
        for child in element:
            if child.tag != "default":
                own.setdefault(child.tag, {}).update(child.attrib)
        self._classes[element.get("class", "main")] = own
        for child in element.findall("default"):
            self._add(child, own)

    def attributes(self, element: ET.Element, childclass: str | None) -> dict[str, str]:
        name = element.get("class", childclass or "main")
        if name not in self._classes:
            raise HandError(f"the hand model uses an unknown default class '{name}'")
        return {**self._classes[name].get(element.tag, {}), **element.attrib}


class _Reader:
    def __init__(self, defaults: _Defaults) -> None:
        self._defaults = defaults
        self.bodies: list[Body] = []
        self.geoms: list[Geom] = []
        self.sites: list[Site] = []

    def add_body(self, element: ET.Element, parent: int, childclass: str | None) -> None:
        childclass = element.get("childclass", childclass)
        index = len(self.bodies)
        name = element.get("name", f"body_{index}")
        joints = element.findall("joint")
        if len(joints) > 1 or element.find("freejoint") is not None:
            raise HandError(f"body '{name}' of the hand model must have at most one hinge joint")
        joint = self._joint(joints[0], childclass) if joints else None
        self.bodies.append(Body(name, parent, _pose(element.attrib, name), joint))
        for geom in element.findall("geom"):
            self._geom(geom, index, childclass)
        for site in element.findall("site"):
            position = np.array(_floats(site.get("pos", "0 0 0")))
            self.sites.append(Site(site.get("name", ""), index, position))
        for child in element.findall("body"):
            self.add_body(child, index, childclass)

    def _joint(self, element: ET.Element, childclass: str | None) -> Joint:
        attributes = self._defaults.attributes(element, childclass)
        name = attributes.get("name", "")
        if attributes.get("type", "hinge") != "hinge" or "pos" in attributes or "range" not in attributes:
            raise HandError(
                f"joint '{name}' of the hand model must be a hinge at its body's origin with a range"
            )
        axis = np.array(_floats(attributes.get("axis", "0 0 1")))
        lower, upper = _floats(attributes["range"])
        return Joint(name, axis / np.linalg.norm(axis), lower, upper)

    def _geom(self, element: ET.Element, body: int, childclass: str | None) -> None:
        attributes = self._defaults.attributes(element, childclass)
        name, kind = attributes.get("name", ""), attributes.get("type", "sphere")
        if kind not in ("box", "capsule", "cylinder", "sphere"):
            raise HandError(
                f"geom '{name}' of the hand model must be a box, capsule, cylinder or sphere, got {kind}"
            )
        size = _floats(attributes.get("size", ""))
        if "fromto" in attributes:
            ends = np.array(_floats(attributes["fromto"])).reshape(2, 3)
            size = (size[0], float(np.linalg.norm(ends[1] - ends[0]) / 2))
            pose = make_transform(_rotation_z_to(ends[1] - ends[0]), ends.mean(axis=0))
        else:
            pose = _pose(attributes, name)
        self.geoms.append(Geom(name, body, kind, size, pose))


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(value) for value in text.split())


def _pose(attributes: dict[str, str], name: str) -> Float[np.ndarray, "4 4"]:
    for other in ("euler", "axisangle", "xyaxes", "zaxis"):
        if other in attributes:
            raise HandError(f"'{name}' of the hand model must give its orientation as quat, got {other}")
    position = np.array(_floats(attributes.get("pos", "0 0 0")))
    quaternion = np.array(_floats(attributes.get("quat", "1 0 0 0")))
    return make_transform(matrix_from_quaternion(quaternion), position)


def _rotation_z_to(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation that takes z to the given direction."""
    z = direction / np.linalg.norm(direction)
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
