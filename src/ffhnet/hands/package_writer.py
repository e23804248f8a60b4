"""A compiled MuJoCo model, written as a hand: root body, hinges, primitive shapes, fingertips, couplings."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
from jaxtyping import Float

from ffhnet.errors import HandError
from ffhnet.hands.packaged import Joint, PackagedModel

_THUMB = "thumb"
"""Name of the finger that may touch the others."""

_WORLD, _FINGER, _OPPOSED, _PALM = 1, 2, 4, 8
"""Bits of who collides with whom, as in the built-in hand's model: neighbouring fingers never do."""

_MEETS_PALM = 2
"""Links at a finger's end that collide with the palm; those before grow out of it."""

_SPECK = 0.003
"""m: shapes within a smaller ball mark a place in somebody's simulation."""

_FOLLOWER = 0.1
"""Share of damping and armature that a coupled joint has: it has no motor."""

_SLACK = 0.01
"""rad by which given limits may leave those of the model, as rounding does."""

_NUMBERS = {"box": 3, "capsule": 2, "cylinder": 2, "sphere": 1}
"""How many half sizes a shape has."""


def write_subset(source: PackagedModel, model: mujoco.MjModel) -> str:
    """The hand's MJCF.

    Args:
        source: which body is the hand, its joints and how they are driven.
        model: the package's model, with primitive shapes only.

    Raises:
        HandError: the model does not have what the description names, or it is not of the subset.
    """
    return ET.tostring(_Writer(source, model).mjcf, encoding="unicode")


class _Writer:
    def __init__(self, source: PackagedModel, model: mujoco.MjModel) -> None:
        self._source, self._model = source, model
        self._names = {joint.theirs: name for name, joint in source.joints.items()}
        self._limits: dict[str, tuple[float, float]] = {}
        self._links: dict[str, list[tuple[ET.Element, list[int]]]] = {}
        self._root = model.body(source.root).id
        self.mjcf = ET.Element("mujoco", model=source.package)
        ET.SubElement(self.mjcf, "compiler", angle="radian", autolimits="true")
        self._body(ET.SubElement(self.mjcf, "worldbody"), self._root, None)
        if missing := [joint.theirs for name, joint in source.joints.items() if name not in self._limits]:
            raise HandError(f"body {source.root} of {source.model} carries no joint {', '.join(missing)}")
        for finger, links in self._links.items():
            for element, _ in links[-_MEETS_PALM:]:
                for geom in element.findall("geom"):
                    geom.set("conaffinity", str(int(geom.get("conaffinity", "0")) | _PALM))
            self._tip(finger, *links[-1])
        self._couplings_and_actuators()

    def _body(self, parent: ET.Element, body: int, finger: str | None) -> None:
        """Writes a body and what hangs on it; `finger` is the one that it belongs to, None for the palm."""
        model = self._model
        element = ET.SubElement(parent, "body", name=model.body(body).name or f"body_{body}")
        if body != self._root:
            element.set("pos", _text(model.body_pos[body]))
            element.set("quat", _text(model.body_quat[body]))
        ET.SubElement(
            element,
            "inertial",
            mass=_text(model.body_mass[body]),
            pos=_text(model.body_ipos[body]),
            quat=_text(model.body_iquat[body]),
            diaginertia=_text(model.body_inertia[body]),
        )
        if body != self._root and (name := self._joint(element, body)) is not None:
            finger = name.partition("_")[0]
        geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_rbound > _SPECK)).tolist()
        for geom in geoms:
            self._geom(element, geom, finger)
        if finger is not None and geoms:
            self._links.setdefault(finger, []).append((element, geoms))
        for child in np.flatnonzero(model.body_parentid == body):
            self._body(element, int(child), finger)

    def _joint(self, element: ET.Element, body: int) -> str | None:
        """Writes the body's joint and returns its name, if it is one that is used."""
        model, source = self._model, self._source
        on_body = np.flatnonzero(model.jnt_bodyid == body)
        used = [j for j in on_body if model.joint(j).name in self._names]
        if not used:
            return None
        name = self._names[model.joint(used[0]).name]
        joint = source.joints[name]
        hinge = model.jnt_type[used[0]] == mujoco.mjtJoint.mjJNT_HINGE
        rest = model.qpos0[model.jnt_qposadr[used[0]]]
        if len(used) > 1 or not hinge or np.abs(model.jnt_pos[used[0]]).max() > 1e-9 or rest != 0:
            raise HandError(f"joint {joint.theirs} must be a body's only hinge, at its origin, zero at rest")
        self._limits[name] = lower, upper = self._range(name, joint, joint.sign * model.jnt_range[used[0]])
        share = 1.0 if joint.leader is None else _FOLLOWER
        ET.SubElement(
            element,
            "joint",
            name=name,
            axis=_text(joint.sign * model.jnt_axis[used[0]]),
            range=_text([lower, upper]),
            damping=_text(share * source.drive.damping),
            armature=_text(share * source.drive.armature),
        )
        return name

    def _range(self, name: str, joint: Joint, own: Float[np.ndarray, " 2"]) -> tuple[float, float]:
        """Limits of a joint (rad): given, or those of its leader, or the model's."""
        lower, upper = joint.limits or (own.min(), own.max())
        if joint.leader is not None:
            if joint.leader not in self._limits:
                raise HandError(f"{name} is coupled to {joint.leader}, which must come before it")
            lower, upper = sorted(joint.factor * limit for limit in self._limits[joint.leader])
        if lower < own.min() - _SLACK or upper > own.max() + _SLACK:
            allowed = f"{own.min():.3f} to {own.max():.3f}"
            raise HandError(f"{name} goes from {lower:.3f} to {upper:.3f} rad, the model allows {allowed}")
        return float(lower), float(upper)

    def _geom(self, element: ET.Element, geom: int, finger: str | None) -> None:
        model = self._model
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        if kind not in _NUMBERS:
            wanted = ", ".join(_NUMBERS)
            raise HandError(f"body {element.get('name')} has a shape of the type {kind}, wanted {wanted}")
        if finger is None:
            own, others = _PALM, _WORLD
        elif finger == _THUMB:
            own, others = _OPPOSED, _WORLD | _FINGER
        else:
            own, others = _FINGER, _WORLD
        ET.SubElement(
            element,
            "geom",
            name=f"{element.get('name')}_{geom}",
            type=kind,
            size=_text(model.geom_size[geom][: _NUMBERS[kind]]),
            pos=_text(model.geom_pos[geom]),
            quat=_text(model.geom_quat[geom]),
            contype=str(own),
            conaffinity=str(others),
        )

    def _tip(self, finger: str, element: ET.Element, geoms: list[int]) -> None:
        """A site where the last link reaches farthest from its joint, in the direction of its middle."""
        middles = self._model.geom_pos[geoms]
        middle = middles.mean(axis=0)
        if np.linalg.norm(middle) < _SPECK:
            raise HandError(f"the last link of the {finger} finger lies around its joint: where is its tip?")
        direction = middle / np.linalg.norm(middle)
        reach = max(middles @ direction + [self._extent(geom, direction) for geom in geoms])
        element.insert(1, ET.Element("site", name=f"{finger}_tip", pos=_text(reach * direction)))

    def _extent(self, geom: int, direction: Float[np.ndarray, " 3"]) -> float:
        """How far (m) a shape reaches from its middle in a direction of its body's frame."""
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self._model.geom_quat[geom])
        along = np.abs(rotation.reshape(3, 3).T @ direction)
        kind, size = self._model.geom_type[geom], self._model.geom_size[geom]
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            return float(along @ size)
        if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            return float(size[1] * along[2] + size[0] * np.hypot(along[0], along[1]))
        return float(size[0] + size[1] * along[2])  # of a sphere size[1] is zero

    def _couplings_and_actuators(self) -> None:
        equality, actuator = ET.SubElement(self.mjcf, "equality"), ET.SubElement(self.mjcf, "actuator")
        drive = self._source.drive
        for name, joint in self._source.joints.items():
            if joint.leader is not None:
                polynomial = _text([0, joint.factor, 0, 0, 0])
                ET.SubElement(equality, "joint", joint1=name, joint2=joint.leader, polycoef=polynomial)
                continue
            ET.SubElement(
                actuator,
                "position",
                name=name,
                joint=name,
                kp=_text(drive.stiffness),
                ctrlrange=_text(self._limits[name]),
                forcerange=_text([-drive.torque, drive.torque]),
            )


def _text(numbers: object) -> str:
    return " ".join(repr(float(number)) for number in np.atleast_1d(np.asarray(numbers, dtype=float)))
