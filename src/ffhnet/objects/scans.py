"""A scanned mesh as an object: read, brought to metres, closed, split into convex pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import QhullError

from ffhnet.errors import ObjectError
from ffhnet.objects.convex import convex_hull
from ffhnet.objects.decompose import convex_pieces
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.inertia import default_mass, piece_properties
from ffhnet.objects.mesh_files import read_mesh
from ffhnet.objects.resting import resting_poses
from ffhnet.objects.units import Scale, metres_per_unit

MIN_FILLING = 1e-3
"""Share of its hull that a solid fills at least; sheets that are closed by a back side fill less."""


def load_scan(
    path: str | Path, cache_dir: str | Path | None = None, *, scale: Scale = 1.0, name: str | None = None
) -> GraspObject:
    """Object from a mesh file, z up; moved along z so that its lowest point is z = 0.

    Args:
        path: OBJ, PLY, STL or GLB file.
        cache_dir: where convex pieces are kept, the user's cache folder if none.
        scale: metres per unit of the file, 0.001 for millimetres, or "auto".
        name: of the object, the file's stem if none.

    Raises:
        InputFileError: no such file, an unknown type, or the file cannot be read.
        ObjectError: the mesh has no or too many faces, vertices that are not finite, an unlikely size, no
            volume, holes that cannot be closed, or no stable pose.
        MissingExtraError: the mesh is not convex and coacd is not installed.
    """
    path = Path(path)
    return scan_in_metres(read_in_metres(path, scale)[0], name or path.stem, cache_dir)


def read_in_metres(path: Path, scale: Scale) -> tuple[trimesh.Trimesh, float]:
    """Closed mesh with outward faces in metres, lowest point at z = 0, and the metres per unit of its file.

    Raises:
        InputFileError, ObjectError: as `load_scan`.
    """
    mesh = read_mesh(path)
    used = mesh.vertices[np.unique(mesh.faces)]
    factor = metres_per_unit(np.ptp(used, axis=0), scale, path)
    mesh = _closed(trimesh.Trimesh(mesh.vertices * factor, mesh.faces, process=False), path)
    mesh.vertices[:, 2] -= mesh.vertices[:, 2].min()
    return mesh, factor


def scan_in_metres(mesh: trimesh.Trimesh, name: str, cache_dir: str | Path | None = None) -> GraspObject:
    """Object of a closed mesh in metres.

    Raises:
        ObjectError: no convex pieces or no stable pose are found.
        MissingExtraError: the mesh is not convex and coacd is not installed.
    """
    pieces = convex_pieces(mesh, Path(cache_dir) if cache_dir is not None else None)
    poses = resting_poses(pieces)
    return GraspObject(
        name=name,
        family="scan",
        visual=mesh,
        pieces=pieces,
        mass=default_mass(piece_properties(pieces).mass),
        resting_poses=np.stack([pose.T_world_object for pose in poses]),
        pose_names=tuple(pose.name for pose in poses),
    )


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
    try:
        hull_volume = convex_hull(np.asarray(mesh.vertices)).volume
    except QhullError:
        raise ObjectError(f"wanted a solid, {path} is flat") from None
    if mesh.volume < MIN_FILLING * hull_volume:
        raise ObjectError(f"wanted a solid, {path} encloses a volume of {mesh.volume:.3g} m³")
    return mesh
