"""Scanned meshes as objects: reading, checking and repairing files, and walking data-set folders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from ffhnet.errors import FFHNetError, InputFileError, ObjectError
from ffhnet.objects.convex import convex_hull
from ffhnet.objects.decompose import convex_pieces
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.inertia import default_mass, piece_properties
from ffhnet.objects.resting import resting_poses

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".glb")
"""File types that can be read."""

MAX_FACES = 200_000
"""More faces than this say that the raw scan was given; its simplified version serves as well."""

EXTENT_RANGE = (0.001, 2.0)
"""m: every side of the bounding box of something that a hand can be asked to grasp."""

PREFERRED_FILES = (
    "google_16k/nontextured.ply",  # YCB
    "google_16k/nontextured.stl",
    "meshes/model.obj",  # Google Scanned Objects
    "textured_meshes/optimized_poisson_texture_mapped_mesh.obj",  # BigBIRD
)
"""Which of an object's meshes is taken in the layouts of well-known data sets."""


@dataclass(frozen=True)
class ScanResult:
    """What became of one mesh file: an object or the error that says why not."""

    path: Path
    obj: GraspObject | None
    error: FFHNetError | None


def load_scan(
    path: str | Path, cache_dir: str | Path | None = None, *, scale: float = 1.0, name: str | None = None
) -> GraspObject:
    """Object from a mesh file, z up; moved along z so that its lowest point is z = 0.

    Args:
        path: OBJ, PLY, STL or GLB file.
        cache_dir: where convex pieces are kept, the user's cache folder if none.
        scale: metres per unit of the file, 0.001 for millimetres.
        name: of the object, the file's stem if none.

    Raises:
        InputFileError: no such file, an unknown type, or the file cannot be read.
        ObjectError: the mesh has no or too many faces, vertices that are not finite, an unlikely size, no
            volume, holes that cannot be closed, or no stable pose.
        MissingExtraError: the mesh is not convex and coacd is not installed.
    """
    path = Path(path)
    mesh = _checked(_read_mesh(path), scale, path)
    pieces = convex_pieces(mesh, Path(cache_dir) if cache_dir is not None else None)
    poses = resting_poses(pieces)
    return GraspObject(
        name=name or path.stem,
        family="scan",
        visual=mesh,
        pieces=pieces,
        mass=default_mass(piece_properties(pieces).mass),
        resting_poses=np.stack([pose.T_world_object for pose in poses]),
        pose_names=tuple(pose.name for pose in poses),
    )


def load_folder(folder: str | Path, cache_dir: str | Path | None = None) -> Iterator[ScanResult]:
    """Objects of a folder one by one; a file that cannot be used gives its error instead of raising.

    Raises:
        InputFileError: no such folder, or no mesh in it.
    """
    for name, path in find_meshes(folder):
        try:
            yield ScanResult(path, load_scan(path, cache_dir, name=name), None)
        except FFHNetError as error:
            yield ScanResult(path, None, error)


def find_meshes(folder: str | Path) -> list[tuple[str, Path]]:
    """Name and mesh file of each object in a folder, sorted by name.

    Every mesh file directly in the folder is an object (KIT, or a bare folder). Every sub-folder with meshes
    is one object too (YCB, BigBIRD, Google Scanned Objects): of its files one of `PREFERRED_FILES` is taken,
    else the smallest.

    Raises:
        InputFileError: no such folder, or no mesh in it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputFileError(f"wanted a folder of meshes, there is none at {folder}")
    found: list[tuple[str, Path]] = []
    for entry in sorted(folder.iterdir()):
        if entry.is_dir():
            meshes = sorted(file for file in entry.rglob("*") if _is_mesh(file))
            preferred = [file for suffix in PREFERRED_FILES for file in meshes if file.match(suffix)]
            if meshes:
                best = preferred[0] if preferred else min(meshes, key=lambda file: file.stat().st_size)
                found.append((entry.name, best))
        elif _is_mesh(entry):
            found.append((entry.stem, entry))
    if not found:
        raise InputFileError(f"wanted meshes ({', '.join(MESH_SUFFIXES)}) in {folder}, found none")
    return found


def _is_mesh(path: Path) -> bool:
    return path.suffix.lower() in MESH_SUFFIXES and path.is_file()


def _read_mesh(path: Path) -> trimesh.Trimesh:
    if not path.is_file():
        raise InputFileError(f"wanted a mesh file, there is none at {path}")
    if not _is_mesh(path):
        raise InputFileError(f"wanted a mesh file ({', '.join(MESH_SUFFIXES)}), got {path.name}")
    try:
        return trimesh.load_mesh(path, process=False, skip_materials=True)
    # The readers raise errors of every type on broken files.
    except Exception as error:
        raise InputFileError(f"wanted a readable mesh in {path}, reading failed: {error}") from error


def _checked(mesh: trimesh.Trimesh, scale: float, path: Path) -> trimesh.Trimesh:
    """The bare geometry, closed and with outward faces, in metres, lowest point at z = 0."""
    faces = np.asarray(getattr(mesh, "faces", ()))
    if len(faces) == 0:
        raise ObjectError(f"wanted a mesh with faces, {path} has none")
    if len(faces) > MAX_FACES:
        raise ObjectError(f"wanted at most {MAX_FACES} faces, {path} has {len(faces)}: simplify it first")
    vertices = np.asarray(mesh.vertices, dtype=float) * scale
    if faces.max() >= len(vertices) or faces.min() < 0:
        raise ObjectError(f"wanted faces of {len(vertices)} vertices, {path} names vertex {faces.max()}")
    if not np.isfinite(vertices).all():
        raise ObjectError(f"wanted finite vertices, {path} has NaN or infinite ones")
    _check_size(vertices[np.unique(faces)], path)
    mesh = _closed(trimesh.Trimesh(vertices, faces, process=False), path)
    mesh.vertices[:, 2] -= mesh.vertices[:, 2].min()
    return mesh


def _check_size(vertices: np.ndarray, path: Path) -> None:
    extents = np.ptp(vertices, axis=0)
    size = " x ".join(f"{side:.4g}" for side in extents)
    low, high = EXTENT_RANGE
    if extents.max() > high:
        raise ObjectError(f"wanted an object of at most {high} m, {path} is {size} m: is it in millimetres?")
    if extents.max() < low:
        raise ObjectError(f"wanted an object of at least {low} m, {path} is {size} m: in another unit?")
    if extents.min() < low:
        raise ObjectError(f"wanted a solid of at least {low} m in every direction, {path} is {size} m")


def _closed(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """The mesh with outward faces, repaired only where it needs be: cleaning can open a closed mesh."""
    if not mesh.is_watertight:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if not mesh.is_watertight:
        mesh.update_faces(mesh.unique_faces() & mesh.nondegenerate_faces())
        mesh.remove_unreferenced_vertices()
        trimesh.repair.fill_holes(mesh)
    trimesh.repair.fix_normals(mesh, multibody=True)
    if not mesh.is_watertight:
        raise ObjectError(f"wanted a closed mesh, {path} has holes that could not be filled")
    if mesh.volume < 1e-3 * convex_hull(np.asarray(mesh.vertices)).volume:
        raise ObjectError(f"wanted a solid, {path} encloses a volume of {mesh.volume:.3g} m³")
    return mesh
