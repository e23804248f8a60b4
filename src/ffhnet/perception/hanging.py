"""Parts of an object that a gap in depth cut off: they hang in the air, on what is beside or beneath them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ffhnet.perception.cloud import search_tree
from ffhnet.perception.table import Plane

_STANDS = 0.012
"""m: a cluster whose lowest points are higher does not reach the table."""

_FOOT_PERCENT = 2.0
"""Percentile of the heights that counts as a cluster's lowest points."""

_OVER = 0.6
"""Share of a cluster's points that lie over another one which carries it."""

_CLEAR = 0.65
"""Share of a cluster's points that have something lower seen beneath them where nothing else can carry it."""

_BENEATH = 0.004
"""m along the table between a point and what is beneath it."""

_BESIDE = 0.05
"""m between a cluster that hangs and the one that it hangs on."""


def join_hanging(
    clusters: list[Int[np.ndarray, " M"]], cloud: Float[np.ndarray, "N 3"], plane: Plane
) -> Int[np.ndarray, " K"]:
    """For each cluster the number of the cluster that it is a part of, its own where it stands by itself.

    Noise and shadows leave gaps at steps of depth, which can cut off a head, a handle or a spout. Such a part
    does not reach the table; it lies over the rest of the object, or the table is seen beneath it. What
    stands behind another object does not seem to reach the table either, but neither is true of it.

    Args:
        clusters: indices of the points of each cluster.
        cloud: the scene (m).
        plane: the table in the same frame.
    """
    part_of = np.arange(len(clusters))
    bottoms = [np.percentile(plane.height(cloud[members]), _FOOT_PERCENT) for members in clusters]
    high = np.flatnonzero(np.array(bottoms) > _STANDS)
    if len(high) == 0 or len(clusters) < 2:
        return part_of
    plan, height = plane.coordinates(cloud), plane.height(cloud)
    for i in high.tolist():
        carrier = _carrier(i, clusters, plan)
        if carrier is None and _clear_beneath(plan[clusters[i]], plan[height < bottoms[i] / 2]):
            carrier = _nearest(i, clusters, cloud)
        if carrier is not None:
            part_of[part_of == part_of[i]] = part_of[carrier]
    return part_of


def _carrier(i: int, clusters: list[Int[np.ndarray, " M"]], plan: Float[np.ndarray, "N 2"]) -> int | None:
    """The cluster that number i lies over, if there is one."""
    shares = [
        0.0 if j == i else _share_over(plan[clusters[i]], plan[other]) for j, other in enumerate(clusters)
    ]
    best = int(np.argmax(shares))
    return best if shares[best] > _OVER else None


def _share_over(points: Float[np.ndarray, "N 2"], other: Float[np.ndarray, "M 2"]) -> float:
    """Share of the points in the convex hull of the others, seen from above."""
    try:
        sides = ConvexHull(other).equations
    except QhullError:
        return 0.0
    return float((sides[:, :2] @ points.T + sides[:, 2:] < 0).all(axis=0).mean())


def _clear_beneath(points: Float[np.ndarray, "N 2"], lower: Float[np.ndarray, "M 2"]) -> bool:
    """Whether lower points are seen beneath most points."""
    near = ((lower > points.min(axis=0) - _BENEATH) & (lower < points.max(axis=0) + _BENEATH)).all(axis=1)
    # The third nearest, because one or two may be stray.
    distance, _ = cKDTree(lower[near]).query(points, k=[3], distance_upper_bound=_BENEATH)
    return bool(np.isfinite(distance).mean() > _CLEAR)


def _nearest(i: int, clusters: list[Int[np.ndarray, " M"]], cloud: Float[np.ndarray, "N 3"]) -> int | None:
    """The cluster nearest to number i, if one is near enough to be in touch with it."""
    tree = search_tree(cloud[clusters[i]])
    gaps = [
        np.inf if j == i else tree.query(cloud[other], distance_upper_bound=_BESIDE)[0].min()
        for j, other in enumerate(clusters)
    ]
    nearest = int(np.argmin(gaps))
    return nearest if np.isfinite(gaps[nearest]) else None
