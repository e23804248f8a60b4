"""Where the mesh of each object lies in a folder, in the layouts of well-known data sets and without one."""

from __future__ import annotations

import fnmatch
import re
from dataclasses import dataclass
from pathlib import Path

from ffhnet.errors import InputFileError, ObjectError
from ffhnet.objects.mesh_files import MESH_SUFFIXES, is_mesh_file


@dataclass(frozen=True)
class Layout:
    """How a data set files its objects: in one sub-folder each.

    Attributes:
        title: of the data set.
        patterns: of an object's mesh below its sub-folder, the preferred one first; without regard to case.
    """

    title: str
    patterns: tuple[str, ...]


LAYOUTS: dict[str, Layout] = {
    "ycb": Layout(
        "YCB",
        tuple(
            f"{scan}/{file}"
            for scan in ("google_16k", "poisson", "tsdf")
            for file in ("nontextured.ply", "nontextured.stl", "textured.obj")
        ),
    ),
    "gso": Layout("Google Scanned Objects", ("meshes/model.obj",)),
    # The Poisson surface is closed; the one of the distance field has holes.
    "bigbird": Layout(
        "BigBIRD",
        tuple(
            f"{folder}{file}"
            for file in (
                "optimized_poisson_texture_mapped_mesh.obj",
                "optimized_tsdf_texture_mapped_mesh.obj",
            )
            for folder in ("textured_meshes/", "")
        ),
    ),
    # 5000 faces show every dent that a hand can feel, and split into convex pieces in seconds.
    "kit": Layout(
        "KIT",
        tuple(
            f"{folder}*_{faces}{texture}.obj"
            for faces in ("5k", "25k", "800", "orig")
            for texture in ("_tex", "")
            for folder in ("", "meshes/")
        ),
    ),
    "hope": Layout("HOPE", ("google_16k/textured.obj", "textured.obj")),
}
"""Data sets with one sub-folder per object; KIT and HOPE also come as flat folders. Where an object fits more
than one, the first here counts."""

BARE = "bare"
"""Any other folder: each mesh file, and each sub-folder with meshes, is an object."""

_KIT_FILE = re.compile(r"(?P<name>.+)_(?P<faces>5k|25k|800|orig)(_tex)?", re.IGNORECASE)
_KIT_ORDER = ("5k", "25k", "800", "orig")


@dataclass(frozen=True)
class FoundMesh:
    """The mesh of one object.

    Attributes:
        name: of the object.
        path: of its mesh file.
        layout: a key of `LAYOUTS`, or `BARE`.
    """

    name: str
    path: Path
    layout: str


def find_meshes(folder: str | Path, layout: str | None = None) -> list[FoundMesh]:
    """Mesh file of each object in a folder, sorted by name; each name once.

    A sub-folder with meshes is one object, whose file the layout tells; in a bare folder it is the smallest.
    A mesh file directly in the folder is an object too. Files of one name are one object in several formats,
    of which the first of `MESH_SUFFIXES` counts; the resolutions of a KIT object (NAME_5k_tex.obj,
    NAME_25k_tex.obj, ...) are also one object.

    Args:
        folder: of objects.
        layout: a key of `LAYOUTS` or `BARE`, to take only what fits it; by default found for each object.

    Raises:
        InputFileError: no such folder, or no mesh in it that fits.
        ObjectError: unknown layout.
    """
    folder = Path(folder)
    if layout is not None and layout not in (*LAYOUTS, BARE):
        raise ObjectError(f"wanted a layout out of {', '.join((*LAYOUTS, BARE))}, got {layout!r}")
    if not folder.is_dir():
        raise InputFileError(f"wanted a folder of meshes, there is none at {folder}")
    entries = sorted(folder.iterdir())
    found = _in_files([entry for entry in entries if is_mesh_file(entry)], layout)
    for entry in entries:
        mesh = _in_folder(entry, layout) if entry.is_dir() else None
        if mesh is not None:
            found.setdefault(mesh.name, mesh)
    if not found:
        wanted = f"meshes ({', '.join(MESH_SUFFIXES)})"
        if layout in LAYOUTS:
            wanted = f"meshes as in {LAYOUTS[layout].title}, NAME/{LAYOUTS[layout].patterns[0]},"
        raise InputFileError(f"wanted {wanted} in {folder}, found none")
    return [found[name] for name in sorted(found)]


def _in_files(files: list[Path], layout: str | None) -> dict[str, FoundMesh]:
    """Objects that are single files; KIT and HOPE are the data sets that come so."""
    ranked: list[tuple[int, str, FoundMesh]] = []
    for file in files:
        kit = _KIT_FILE.fullmatch(file.stem) if layout != BARE else None
        if kit and layout in (None, "kit"):
            rank = _KIT_ORDER.index(kit["faces"].lower())
            ranked.append((rank, file.name, FoundMesh(kit["name"], file, "kit")))
        elif layout in (None, BARE, "kit", "hope"):
            rank = MESH_SUFFIXES.index(file.suffix.lower())
            ranked.append((rank, file.name, FoundMesh(file.stem, file, layout or BARE)))
    found: dict[str, FoundMesh] = {}
    for _, _, mesh in sorted(ranked, key=lambda entry: entry[:2]):
        found.setdefault(mesh.name, mesh)
    return found


def _in_folder(folder: Path, layout: str | None) -> FoundMesh | None:
    """The object in a sub-folder; none where it holds no mesh or does not fit the layout that was named."""
    files = {
        file.relative_to(folder).as_posix(): file for file in sorted(folder.rglob("*")) if is_mesh_file(file)
    }
    keys = [layout] if layout in LAYOUTS else [] if layout == BARE else list(LAYOUTS)
    for key in keys:
        for pattern in LAYOUTS[key].patterns:
            fitting = [name for name in files if fnmatch.fnmatchcase(name.lower(), pattern)]
            if fitting:
                return FoundMesh(folder.name, files[fitting[0]], key)
    if layout in LAYOUTS or not files:
        return None
    return FoundMesh(folder.name, min(files.values(), key=lambda file: file.stat().st_size), BARE)
