"""Convex pieces of a scanned mesh by CoACD (Wei et al. 2022), kept in a cache on disk."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
import warnings
import zipfile
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import QhullError

from ffhnet.errors import MissingExtraError, ObjectError
from ffhnet.objects.convex import convex_hull

CONVEX_SHARE = 0.97
"""A mesh that fills this share of its hull is taken as convex: what is missing is scan noise."""

DENTED_SHARE, DENT_DEPTH = 0.8, 0.006
"""So is one that fills less where no dent is deeper than this (m): the recessed ends of cans, into which no
finger of 9 mm radius reaches, and for which CoACD takes minutes. The share keeps thin-walled glasses out."""

PARAMETERS = {"threshold": 0.05, "max_convex_hull": 16, "seed": 0}
"""Of CoACD: its own default concavity; up to 16 hulls cost the physics next to nothing."""


def default_cache_dir() -> Path:
    """Folder of the user's cache in which convex pieces are kept."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "ffhnet" / "convex"


def convex_pieces(mesh: trimesh.Trimesh, cache_dir: Path | None = None) -> tuple[trimesh.Trimesh, ...]:
    """Convex pieces whose union is close to a closed mesh: its hull alone where that is enough.

    Args:
        mesh: closed mesh with outward faces, metres.
        cache_dir: where results are kept, `default_cache_dir()` if none. The key is the mesh's content and
            the parameters, so a changed file is never served from an old result.

    Raises:
        MissingExtraError: the mesh is not convex and coacd is not installed.
        ObjectError: CoACD found no pieces.
    """
    hull = convex_hull(np.asarray(mesh.vertices))
    if _nearly_convex(mesh, hull):
        return (hull,)
    path = (cache_dir or default_cache_dir()) / f"{_content_key(mesh)}.npz"
    pieces = _read(path)
    if pieces is None:
        pieces = _decompose(mesh)
        _write(path, pieces)
    return pieces


def _nearly_convex(mesh: trimesh.Trimesh, hull: trimesh.Trimesh) -> bool:
    share = mesh.volume / hull.volume
    if share >= CONVEX_SHARE or share < DENTED_SHARE:
        return bool(share >= CONVEX_SHARE)
    offsets = np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0])
    # A vertex at a time: all distances at once would be too many for a large scan.
    depths = ((offsets - hull.face_normals @ vertex).min() for vertex in np.asarray(mesh.vertices))
    return max(depths) <= DENT_DEPTH


def _content_key(mesh: trimesh.Trimesh) -> str:
    digest = hashlib.sha256(repr(sorted(PARAMETERS.items())).encode())
    digest.update(np.ascontiguousarray(mesh.vertices, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(mesh.faces, dtype="<i8").tobytes())
    return digest.hexdigest()[:32]


def _decompose(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, ...]:
    try:
        import coacd
    except ImportError:
        raise MissingExtraError(
            "wanted coacd to split a mesh that is not convex, but it is not installed: "
            "pip install 'ffhnet[sim]'"
        ) from None
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), **PARAMETERS)
    pieces = []
    for vertices, _ in parts:
        # Now and then a part is flat, which adds nothing to the shape.
        with contextlib.suppress(QhullError):
            pieces.append(convex_hull(np.asarray(vertices, dtype=float)))
    if not pieces:
        raise ObjectError(f"wanted convex pieces of a mesh of {len(mesh.faces)} faces, CoACD found none")
    return tuple(pieces)


def _read(path: Path) -> tuple[trimesh.Trimesh, ...] | None:
    """Pieces from the cache; none where the file is absent or damaged, and is then made again."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            parts = np.split(stored["vertices"], stored["starts"][1:])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return tuple(convex_hull(part) for part in parts)


def _write(path: Path, pieces: tuple[trimesh.Trimesh, ...]) -> None:
    """Write to a temporary file first, so that a reader never meets half a file."""
    counts = [len(piece.vertices) for piece in pieces]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            np.savez(
                file,
                vertices=np.concatenate([piece.vertices for piece in pieces]),
                starts=np.cumsum([0, *counts[:-1]]),
            )
        os.replace(file.name, path)
    except OSError as error:
        warnings.warn(f"convex pieces are not cached: {error}", stacklevel=2)
