"""Importing a folder of scanned meshes: every one checked, broken ones reported, usable ones written down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ffhnet.errors import FFHNetError, ObjectError
from ffhnet.files import write_atomically
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.graspability import why_not_graspable
from ffhnet.objects.layouts import FoundMesh
from ffhnet.objects.scans import read_in_metres, scan_in_metres
from ffhnet.objects.units import UNITS, Scale, WrongUnitError


@dataclass(frozen=True)
class UsableMesh:
    """A mesh that became an object.

    Attributes:
        found: its name and file.
        obj: the object, in metres.
        scale: metres per unit of the file.
        not_graspable: why the hand cannot grasp it, or none if it can.
    """

    found: FoundMesh
    obj: GraspObject
    scale: float
    not_graspable: str | None


@dataclass(frozen=True)
class BrokenMesh:
    """A mesh that cannot be used.

    Attributes:
        found: its name and file.
        error: says why.
    """

    found: FoundMesh
    error: FFHNetError

    @property
    def reason(self) -> str:
        """The error in one line."""
        return " ".join(str(self.error).split())


def import_mesh(
    found: FoundMesh, scale: Scale = 1.0, cache_dir: str | Path | None = None
) -> UsableMesh | BrokenMesh:
    """Object of one mesh, with its convex pieces in the cache, or what is wrong with it; does not raise.

    Args:
        found: the mesh.
        scale: metres per unit of the file, or "auto".
        cache_dir: where convex pieces are kept, the user's cache folder if none.
    """
    try:
        mesh, used_scale = read_in_metres(found.path, scale)
        obj = scan_in_metres(mesh, found.name, cache_dir)
    except FFHNetError as error:
        return BrokenMesh(found, error)
    return UsableMesh(found, obj, used_scale, why_not_graspable(obj))


def check_any_usable(imports: Sequence[UsableMesh | BrokenMesh]) -> None:
    """Make sure that there is something to work with.

    Raises:
        ObjectError: every mesh is broken; the message says so where all seem to be in one other unit.
    """
    broken = [result for result in imports if isinstance(result, BrokenMesh)]
    if len(broken) < len(imports):
        return
    scales = {result.error.scale if isinstance(result.error, WrongUnitError) else None for result in broken}
    (scale, *others) = scales
    if scale is not None and not others:
        raise ObjectError(
            f"wanted meshes in metres, all {len(broken)} seem to be in {UNITS[scale]}: give --scale {scale:g}"
        )
    raise ObjectError(f"wanted at least one usable mesh, all {len(broken)} are broken")


def write_object(obj: GraspObject, folder: Path) -> Path:
    """Write the surface of an object as FOLDER/NAME.obj: metres, closed, z up, lowest point at z = 0.

    Every digit is kept, so that a mesh that is read again finds its convex pieces in the cache.

    Raises:
        OptionError: the file cannot be written.
    """
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(obj.visual.vertices).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(obj.visual.faces) + 1).tolist()]
    path = folder / f"{obj.name}.obj"
    write_atomically(path, ("\n".join(lines) + "\n").encode())
    return path
