"""Hands whose model comes with another Python package: its MJCF, rewritten into the subset.

A section `[package]` of the hand's TOML says where the model is, which body of it is the hand, what the
joints are called, which of them are coupled and how they are driven. MuJoCo compiles the model, so that all
that MJCF allows is understood; what comes out is plain: bodies, hinges, primitive shapes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffhnet.errors import HandError
from ffhnet.hands.package_files import mesh_path, package_folder, read_self_contained

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Joint:
    """One joint of the hand.

    Attributes:
        theirs: its name in the package's model.
        sign: -1 where it turns the other way there.
        limits: rad in our sign, or None for those of the model.
        leader: the joint that it is coupled to, or None.
        factor: its angle per angle of that one.
    """

    theirs: str
    sign: float
    limits: tuple[float, float] | None
    leader: str | None
    factor: float


@dataclass(frozen=True)
class Drive:
    """The position controller of every joint: Nm/rad, Nms/rad, kgm², Nm."""

    stiffness: float
    damping: float
    armature: float
    torque: float


@dataclass(frozen=True)
class PackagedModel:
    """What the section `[package]` says.

    Attributes:
        package: name that the package is imported by.
        install: how to get it, for people.
        model: path of the MJCF in the package.
        root: the body that is the hand's root, with all that hangs on it.
        joints: by our names FINGER_KIND; those that are not named stay at zero.
        drive: of the joints that are not coupled.
        shapes: the primitive ("box", "capsule" …) that stands for a mesh, by body; "default" for all others.
    """

    package: str
    install: str
    model: str
    root: str
    joints: dict[str, Joint]
    drive: Drive
    shapes: dict[str, str]

    @classmethod
    def from_description(cls, description: dict[str, Any]) -> PackagedModel:
        """From the TOML's section; raises KeyError, TypeError or ValueError where it is malformed."""
        joints = {}
        limits, coupled = description.get("limits", {}), description.get("coupled", {})
        for finger, kinds in description["joints"].items():
            for kind, theirs in kinds.items():
                name = f"{finger}_{kind}"
                lower_upper = limits.get(name, limits.get(kind))
                leader, factor = coupled.get(name, coupled.get(kind, (None, 1.0)))
                joints[name] = Joint(
                    theirs=theirs.removeprefix("-"),
                    sign=-1.0 if theirs.startswith("-") else 1.0,
                    limits=None if lower_upper is None else (float(lower_upper[0]), float(lower_upper[1])),
                    leader=leader if leader is None or leader in joints else f"{finger}_{leader}",
                    factor=float(factor),
                )
        return cls(
            package=description["name"],
            install=description.get("install", f"pip install {description['name']}"),
            model=description["model"],
            root=description["root"],
            joints=joints,
            drive=Drive(**{key: float(value) for key, value in description["drive"].items()}),
            shapes={"default": "capsule", **description.get("shapes", {})},
        )

    @property
    def joint_order(self) -> tuple[str, ...]:
        """The joints that are not coupled, in the order of the TOML."""
        return tuple(name for name, joint in self.joints.items() if joint.leader is None)

    @property
    def path(self) -> Path:
        """The MJCF on this machine; raises HandError where the package is not installed."""
        return package_folder(self.package, self.install) / self.model

    def convert(self) -> str:
        """The hand as an MJCF of the subset; raises HandError where package or MuJoCo are missing or fail."""
        folder = package_folder(self.package, self.install)
        try:
            from ffhnet.hands.package_writer import write_subset
        except ImportError:
            raise HandError(f"hands of other packages are read by MuJoCo: {self.install}") from None
        try:
            return write_subset(self, self._compile(folder))
        except (ValueError, KeyError, AttributeError, OSError) as error:
            raise HandError(f"cannot use {self.model} of {self.package} as a hand: {error}") from error

    def _compile(self, folder: Path) -> mujoco.MjModel:
        """The package's model with the shapes that collide, primitives in the place of meshes."""
        import mujoco

        top = read_self_contained(folder, self.model)
        spec = mujoco.MjSpec.from_string(ET.tostring(top, encoding="unicode"))
        for geom in list(spec.geoms):
            if geom.contype == 0 and geom.conaffinity == 0:
                spec.delete(geom)
            elif geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                shape = self.shapes.get(geom.parent.name, self.shapes["default"])
                geom.type = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")
        used = {geom.meshname for geom in spec.geoms}
        assets = {}
        for mesh in list(spec.meshes):
            if mesh.name in used:
                assets[mesh.file] = mesh_path(folder, self.model, top, mesh.file).read_bytes()
            else:
                spec.delete(mesh)
        spec.meshdir, spec.assets = "", assets
        return spec.compile()
