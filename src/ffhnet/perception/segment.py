"""Objects on a table: what stands out of the plane, taken apart into clusters."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from ffhnet.errors import SceneError
from ffhnet.perception.cells import Cells
from ffhnet.perception.cloud import MIN_POINTS, bounding_box, search_tree
from ffhnet.perception.hanging import join_hanging
from ffhnet.perception.table import Plane

MIN_HEIGHT = 0.005
"""m above the table: lower points are taken for table, being within the noise of real cameras."""

_SEED_SD = 3.0
_MAX_SEED_HEIGHT = 0.01
"""Clusters are made of points so many standard deviations of the table's noise above `MIN_HEIGHT`, at most
so many metres above the table, so that its bumps do not bridge objects; their lower points come after."""

_LOW_REACH = 0.01
"""m from a cluster within which lower points belong to it."""

_MAX_SIZE = 0.6
"""m: nothing higher or wider is an object for a hand; walls and arms are."""

_VOXEL = 0.005
_LINK = 0.015
"""m: voxels nearer than this belong to one object. Wider than the gaps that noise and grazing views leave."""

_CELL = 0.02
"""m: cells of the map of the table."""

_MAP_SIZE = 3.0
"""m: side of that map, around the middle of the table's points."""

_TABLE_SAMPLE = 20000
"""Points of the table that are enough for its map."""

_MIN_DENSITY = 0.1
"""Share of a cluster's median point density below which points are stray (flying pixels)."""

_CENTRE_WIDTH = 0.4
"""rad off the optical axis at which an object counts e times less than in the middle."""

_BORDER = 0.005
"""In focal lengths: an object so near to the edge of the view is cut off by it."""


def segment_objects(
    cloud: Float[np.ndarray, "N 3"], plane: Plane, min_height: float = MIN_HEIGHT
) -> list[Int[np.ndarray, " M"]]:
    """Indices of the points of each object that stands on the table, the main object first.

    Main is what has many points and is near the optical axis; what the edge of the view cuts off (often
    the robot itself) comes last. Things beside the table (walls, furniture) and things larger than 0.6 m
    are left out.

    Args:
        cloud: the scene (m) in the camera frame.
        plane: the table in the same frame.
        min_height: metres above the table at which an object begins.

    Raises:
        SceneError: nothing stands on the table.
    """
    height = plane.height(cloud)
    on_plane = np.flatnonzero(np.abs(height) < min_height)
    on_plane = on_plane[:: 1 + len(on_plane) // _TABLE_SAMPLE]
    standing = np.flatnonzero((height > min_height) & (height < _MAX_SIZE))
    places, table = (plane.coordinates(cloud.take(part, axis=0)) for part in (standing, on_plane))
    over_table = _inside(places, table)
    standing = standing[over_table]
    noise = 1.48 * float(np.median(np.abs(height[on_plane]))) if len(on_plane) else 0.0
    seed_height = max(min_height, min(min_height + _SEED_SD * noise, _MAX_SEED_HEIGHT))
    seeds = standing[height[standing] > seed_height]
    if len(seeds) < MIN_POINTS:
        raise SceneError(
            f"no object on the table: wanted {MIN_POINTS} points above {1000 * seed_height:.0f} mm, "
            f"got {len(seeds)}"
        )
    labels = _clusters(cloud.take(seeds, axis=0))
    low = standing[height[standing] <= seed_height]
    parts = [
        np.concatenate([members, foot])
        for members, foot in _with_low_points(cloud, seeds, labels, low)
        if len(members) >= MIN_POINTS
    ]
    part_of = join_hanging(parts, cloud, plane)
    found = []
    for owner in np.unique(part_of):
        members = np.sort(np.concatenate([parts[i] for i in np.flatnonzero(part_of == owner)]))
        low_corner, high_corner = bounding_box(cloud.take(members, axis=0))
        if (high_corner - low_corner).max() < _MAX_SIZE:
            found.append(members)
    if not found:
        raise SceneError(f"no object on the table: no cluster of {MIN_POINTS} points below {_MAX_SIZE} m")
    return sorted(found, key=lambda members: (_is_cut_off(members, cloud), -_prominence(cloud[members])))


def _is_cut_off(members: Int[np.ndarray, " M"], cloud: Float[np.ndarray, "N 3"]) -> bool:
    """Whether an object ends where the rest of the scene ends; beyond that it is seen against nothing."""
    rest = np.ones(len(cloud), dtype=bool)
    rest[members] = False
    some = slice(None, None, 1 + len(cloud) // _TABLE_SAMPLE)
    view = _bearings(cloud[some]).compress(rest[some], axis=1)
    bearings = _bearings(cloud.take(members, axis=0))
    low = np.abs(bearings.min(axis=1) - view.min(axis=1)) < _BORDER
    high = np.abs(bearings.max(axis=1) - view.max(axis=1)) < _BORDER
    return bool((low | high).any())


def _bearings(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "2 N"]:
    """Where points appear in an image of focal length 1, right of and below the optical axis."""
    x, y, z = points.T
    return np.stack([x, y]) / np.maximum(z, 1e-6)


def _prominence(points: Float[np.ndarray, "N 3"]) -> float:
    """Number of points, less for objects off the optical axis."""
    middle = points.mean(axis=0)
    off_axis = np.arctan2(np.linalg.norm(middle[:2]), middle[2])
    return len(points) * float(np.exp(-((off_axis / _CENTRE_WIDTH) ** 2)))


def _inside(points: Float[np.ndarray, "N 2"], table: Float[np.ndarray, "M 2"]) -> Bool[np.ndarray, " N"]:
    """Which points lie over the largest connected piece of table, holes and notches filled up."""
    if len(table) == 0:
        return np.zeros(len(points), dtype=bool)
    middle = np.median(table, axis=0)
    half = int(_MAP_SIZE / 2 / _CELL)
    x, y = np.floor((table - middle).T / _CELL).astype(int) + half
    on_map = (np.minimum(x, y) >= 0) & (np.maximum(x, y) < 2 * half)
    seen = np.zeros((2 * half, 2 * half), dtype=bool)
    seen[x[on_map], y[on_map]] = True
    # One cell of closing joins table parts that a thin shadow separates.
    pieces, _ = ndimage.label(ndimage.binary_dilation(seen), structure=np.ones((3, 3)))
    largest = 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    corners = (np.argwhere(seen & (pieces == largest)) + 0.5 - half) * _CELL + middle
    try:
        sides = ConvexHull(corners).equations
    except QhullError:
        return np.zeros(len(points), dtype=bool)
    return (sides[:, :2] @ points.T + sides[:, 2:] < _CELL / 2).all(axis=0)


def _clusters(points: Float[np.ndarray, "N 3"]) -> Int[np.ndarray, " N"]:
    """Label of each point's Euclidean cluster, -1 for stray points."""
    reach = _LINK / _VOXEL
    cells = Cells.of(points, _VOXEL, border=int(np.ceil(reach)))
    counts = np.bincount(cells.member)
    steps = cells.steps(reach)
    # Each pair of neighbours once.
    near = cells.number[cells.occupied[:, None] + steps[steps > 0]]
    linked = near > 0
    ends = np.append(0, np.cumsum(np.count_nonzero(linked, axis=1)))
    links = sparse.csr_matrix((np.ones(ends[-1]), near[linked] - 1, ends), shape=(len(counts), len(counts)))
    _, component = connected_components(links, directed=False)
    density = counts + links @ counts + links.T @ counts
    usual = ndimage.median(density, component, np.arange(component.max() + 1))
    component[density < _MIN_DENSITY * usual[component]] = -1
    return component[cells.member]


def _with_low_points(
    cloud: Float[np.ndarray, "N 3"],
    seeds: Int[np.ndarray, " S"],
    labels: Int[np.ndarray, " S"],
    low: Int[np.ndarray, " L"],
) -> list[tuple[Int[np.ndarray, " M"], Int[np.ndarray, " F"]]]:
    """Each cluster's points, and the points below the seed height next to it."""
    kept = labels >= 0
    seeds, labels = seeds[kept], labels[kept]
    owner = np.full(len(low), -1)
    if len(low) and len(seeds):
        distance, nearest = search_tree(cloud[seeds]).query(cloud[low], distance_upper_bound=_LOW_REACH)
        near = np.isfinite(distance)
        owner[near] = labels[nearest[near]]
    return [(seeds[labels == label], low[owner == label]) for label in np.unique(labels)]
