"""Reading mesh files: how many faces a file announces, and its bare geometry."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
import trimesh

from ffhnet.errors import InputFileError, ObjectError

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".glb")
"""File types that can be read."""

MAX_FACES = 200_000
"""More faces than this say that the raw scan was given; its simplified version serves as well."""

_BLOCK = 1 << 22
"""Bytes read at once while lines are counted."""


def is_mesh_file(path: Path) -> bool:
    """Whether there is a file of a type that can be read."""
    return path.suffix.lower() in MESH_SUFFIXES and path.is_file()


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Vertices and triangles of a file, in the file's unit, with nothing merged or repaired.

    A file that announces more than `MAX_FACES` is refused before it is read, which for the raw scans of some
    data sets would take minutes and gigabytes.

    Raises:
        InputFileError: no such file, an unknown type, or the file cannot be read.
        ObjectError: no or too many faces, faces of vertices that are not there, vertices that are not finite.
    """
    if not path.is_file():
        raise InputFileError(f"wanted a mesh file, there is none at {path}")
    if not is_mesh_file(path):
        raise InputFileError(f"wanted a mesh file ({', '.join(MESH_SUFFIXES)}), got {path.name}")
    _check_face_count(announced_faces(path), path)
    try:
        mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
    # The readers raise errors of every type on broken files.
    except Exception as error:
        raise InputFileError(f"wanted a readable mesh in {path}, reading failed: {error}") from error
    faces = np.asarray(getattr(mesh, "faces", ()))
    _check_face_count(len(faces), path)
    vertices = np.asarray(mesh.vertices, dtype=float)
    if faces.shape[1:] != (3,) or vertices.shape[1:] != (3,):
        raise InputFileError(
            f"wanted triangles of points in {path}, got shapes {faces.shape}, {vertices.shape}"
        )
    if faces.max() >= len(vertices) or faces.min() < 0:
        raise ObjectError(f"wanted faces of {len(vertices)} vertices, {path} names vertex {faces.max()}")
    if not np.isfinite(vertices).all():
        raise ObjectError(f"wanted finite vertices, {path} has NaN or infinite ones")
    return trimesh.Trimesh(vertices, faces, process=False)


def _check_face_count(count: int | None, path: Path) -> None:
    if count == 0:
        raise ObjectError(f"wanted a mesh with faces, {path} has none")
    if count is not None and count > MAX_FACES:
        raise ObjectError(f"wanted at most {MAX_FACES} faces, {path} has {count}: simplify it first")


def announced_faces(path: Path) -> int | None:
    """Faces that a mesh file holds, found without reading the mesh; polygons count once.

    Returns:
        The number, or none where the file is damaged or does not say.

    Raises:
        InputFileError: the file cannot be opened.
    """
    try:
        with path.open("rb") as file:
            return _COUNTERS[path.suffix.lower()](file)
    except OSError as error:
        raise InputFileError(f"wanted a readable mesh in {path}, reading failed: {error.strerror}") from error
    except (struct.error, ValueError, KeyError, IndexError, TypeError, AttributeError):
        return None


def _obj_faces(file: BinaryIO) -> int:
    return _line_starts(file, b"f ")


def _ply_faces(file: BinaryIO) -> int | None:
    header = file.read(1 << 16).partition(b"end_header")[0]
    found = re.search(rb"^\s*element\s+face\s+(\d+)", header, re.MULTILINE)
    return int(found[1]) if found else None


def _stl_faces(file: BinaryIO) -> int | None:
    size = file.seek(0, 2)
    file.seek(80)
    (count,) = struct.unpack("<I", file.read(4))
    if size == 84 + 50 * count:
        return count
    file.seek(0)
    # An ASCII file may be indented in any way; a binary one of a wrong length is for the reader to judge.
    return _occurrences(file, b"facet normal") or None


def _glb_faces(file: BinaryIO) -> int:
    size = file.seek(0, 2)
    file.seek(12)
    length, _ = struct.unpack("<II", file.read(8))
    if length > size:
        raise ValueError("a header cannot be longer than its file")
    scene = json.loads(file.read(length))
    counts = [accessor["count"] for accessor in scene["accessors"]]
    primitives = [primitive for mesh in scene["meshes"] for primitive in mesh["primitives"]]
    return sum(counts[p.get("indices", p["attributes"]["POSITION"])] for p in primitives) // 3


def _line_starts(file: BinaryIO, start: bytes) -> int:
    first = int(file.read(len(start)) == start)
    file.seek(0)
    return first + _occurrences(file, b"\n" + start)


def _occurrences(file: BinaryIO, pattern: bytes) -> int:
    """Times that a pattern occurs, read in blocks so that a file of any size takes little memory."""
    count, rest = 0, b""
    while block := file.read(_BLOCK):
        block = rest + block
        count += block.count(pattern)
        rest = block[-(len(pattern) - 1) :]
    return count


_COUNTERS: dict[str, Callable[[BinaryIO], int | None]] = {
    ".obj": _obj_faces,
    ".ply": _ply_faces,
    ".stl": _stl_faces,
    ".glb": _glb_faces,
}
