"""Point clouds: from a depth image, their normals, and whether a user's cloud can be used."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from ffhnet.errors import CloudError
from ffhnet.perception.camera import Intrinsics

MIN_POINTS = 50
"""Fewer points do not show a shape."""

MAX_EXTENT = 10.0
"""m: no view of a table is wider, but one in millimetres is."""

MIN_EXTENT = 0.005
"""m: nothing that a hand takes up is narrower in all directions, but an object in kilometres is."""

_STRAY = 4.0
"""Times as far from the middle as nearly all points of an object: no part of it. Among the cut-out objects,
masked and segmented ones of real and simulated cameras the largest ratio was 2.4."""


def depth_to_cloud(
    depth: Float[np.ndarray, "H W"], intrinsics: Intrinsics
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """The points of a depth image in the camera frame (m), row by row.

    Args:
        depth: metres along the optical axis; zero, negative or not finite = no reading.
        intrinsics: the camera, of the image's size.

    Returns:
        The points, and the index of each one's pixel in `depth.ravel()`.

    Raises:
        CloudError: the image is not of the size that the intrinsics belong to.
    """
    wanted = (intrinsics.height, intrinsics.width)
    if np.shape(depth) != wanted:
        raise CloudError(f"the intrinsics want a depth image of {wanted} pixels, got {np.shape(depth)}")
    depth = np.asarray(depth, dtype=float)
    pixels = np.flatnonzero((depth > 0) & (depth < np.inf))
    x, y = intrinsics.rays()
    # The whole image first: rows of it are taken faster than its columns and rays one by one.
    points = np.empty((*wanted, 3))
    with np.errstate(invalid="ignore"):
        np.multiply(depth, x, out=points[..., 0])
        np.multiply(depth, y[:, None], out=points[..., 1])
    points[..., 2] = depth
    return points.reshape(-1, 3).take(pixels, axis=0), pixels


def bounding_box(
    points: Float[np.ndarray, "N 3"],
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """The lowest and the highest corner of the box around points."""
    # Column by column: NumPy reduces rows so short ten times slower.
    columns = [points[:, axis] for axis in range(3)]
    return np.array([column.min() for column in columns]), np.array([column.max() for column in columns])


def search_tree(points: Float[np.ndarray, "N 3"]) -> cKDTree:
    """A k-d tree for points on a surface.

    Sliding-midpoint splits with loose boxes answer queries up to ten times faster than SciPy's default
    here, and build faster; the answers are the same.
    """
    return cKDTree(points, leafsize=48, balanced_tree=False, compact_nodes=False)


def estimate_normals(
    cloud: Float[np.ndarray, "N 3"], viewpoint: Float[np.ndarray, " 3"], k: int = 20
) -> Float[np.ndarray, "N 3"]:
    """Unit normals, each the direction of least spread of the k nearest points, turned to `viewpoint`.

    Raises:
        CloudError: there are fewer than three points.
    """
    cloud = np.asarray(cloud, dtype=float)
    if len(cloud) < 3:
        raise CloudError(f"normals want at least 3 points, got {len(cloud)}")
    _, neighbours = search_tree(cloud).query(cloud, k=min(k, len(cloud)))
    patches = cloud[neighbours]
    patches -= patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.swapaxes(patches, 1, 2) @ patches)
    normals = axes[:, :, 0]
    away = np.einsum("ij,ij->i", normals, np.asarray(viewpoint) - cloud) < 0
    return np.where(away[:, None], -normals, normals)


def finite_rows(points: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
    """Which points have three finite coordinates."""
    # Column by column: NumPy reduces along a short last axis ten times slower.
    return np.isfinite(points[:, 0]) & np.isfinite(points[:, 1]) & np.isfinite(points[:, 2])


def validate_cloud(points: np.ndarray) -> Float[np.ndarray, "N 3"]:
    """The usable points of a user's cloud, as float64 metres.

    Rows that are not finite are dropped: organised clouds mark pixels without a reading so. Columns
    after the third (colour, normals) are ignored, and an H×W×C image of points is flattened.

    Raises:
        CloudError: not numbers, not of shape N×3, empty, too few points left, all points the same, or
            too large or too small for metres.
    """
    points = np.asarray(points)
    if not (np.issubdtype(points.dtype, np.floating) or np.issubdtype(points.dtype, np.integer)):
        raise CloudError(f"a cloud must hold numbers, got {points.dtype}")
    if points.ndim not in (2, 3) or points.shape[-1] < 3:
        raise CloudError(f"a cloud must have shape (N, 3), got {points.shape}")
    points = points.reshape(-1, points.shape[-1])[:, :3].astype(float)
    if len(points) == 0:
        raise CloudError("the cloud is empty: 0 points")
    usable = finite_rows(points)
    finite = points if usable.all() else points[usable]
    if len(finite) == 0:
        raise CloudError(f"the cloud has no finite point: all {len(points)} rows hold NaN or infinity")
    if len(finite) < MIN_POINTS:
        dropped = len(points) - len(finite)
        raise CloudError(
            f"a cloud must have at least {MIN_POINTS} points, got {len(finite)} ({dropped} not finite)"
        )
    some = finite[:: 1 + len(finite) // 2000]
    if np.ptp(some, axis=0).max() < 1e-6:
        raise CloudError(f"all {len(finite)} points of the cloud are the same point")
    # Without the outer 2 %, because cameras put a few readings at their largest number.
    outer = len(some) // 50
    in_order = np.sort(some, axis=0)
    extent = (in_order[-1 - outer] - in_order[outer]).max()
    if extent > MAX_EXTENT:
        raise CloudError(f"the cloud is {extent:.0f} m wide: looks like millimetres, wanted metres")
    if extent < MIN_EXTENT:
        raise CloudError(f"the cloud is {1000 * extent:.2g} mm wide: looks like kilometres, wanted metres")
    return finite


def validate_object(points: np.ndarray) -> Float[np.ndarray, "N 3"]:
    """The usable points of one object that a user cut out of its scene, as float64 metres.

    A few stray readings would move the mean, at which the networks' frame lies. So points that are more
    than four times as far from the median as 98 % of all are dropped; clouds without any stay as they are.

    Raises:
        CloudError: as `validate_cloud` does.
    """
    cloud = validate_cloud(points)
    distance = np.linalg.norm(cloud - np.median(cloud, axis=0), axis=1)
    most = int(0.98 * len(distance))
    near = distance <= _STRAY * np.partition(distance, most)[most]
    return cloud if near.all() else cloud[near]
