"""Distances from the basis points to a cloud, compiled by numba (the extra `fast`).

The basis never changes, so it is cut into boxes once. In a box with middle m and sides s, a point p of the
cloud is nearest to none of the basis points b where another point q is nearer to all of them. As
|b - p|² - |b - q|² is linear in b, it is least in a corner of the box, which makes the test

    |p - m|² - |q - m|² > s · |p - q|    (absolute values by coordinate).

With q nearest to m it leaves a fifth of a cloud, or less, to be compared with every point of the box.
"""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np
from jaxtyping import Float, Int

from ffhnet.geometry.basis import basis_points

BOX = 64
"""Basis points in a box: more mean fewer tests but more comparisons."""

_ROUNDING = 1e-6
"""m by which boxes are larger than their points, against rounding in the test."""

_LARGEST = np.int32(np.iinfo(np.int32).max)


def nearest_distances(cloud_in_frame: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " n"]:
    """Distance (m, float32) from each of `basis_points()` to the cloud, computed in float32."""
    order, basis, middle, side = _boxes()
    points = np.ascontiguousarray(cloud_in_frame.T, dtype=np.float32)
    distances = np.empty(len(order), dtype=np.float32)
    distances[order] = np.sqrt(_nearest(basis, middle, side, points)).ravel()
    return distances


@lru_cache(maxsize=1)
def _boxes() -> tuple[
    Int[np.ndarray, " n"],
    Float[np.ndarray, "B 3 k"],
    Float[np.ndarray, "B 3"],
    Float[np.ndarray, "B 3"],
]:
    """The basis in B boxes of k: indices of the points, the points, and the boxes' middles and sides."""
    everywhere = basis_points()
    boxes = [np.arange(len(everywhere))]
    while len(boxes[0]) > BOX:
        boxes = [half for box in boxes for half in _halves(box, everywhere)]
    basis = everywhere[np.array(boxes)].transpose(0, 2, 1)
    low, high = basis.min(axis=2), basis.max(axis=2)
    parts = basis, (low + high) / 2, high - low + _ROUNDING
    basis, middle, side = (np.ascontiguousarray(part, dtype=np.float32) for part in parts)
    return np.concatenate(boxes), basis, middle, side


def _halves(box: Int[np.ndarray, " k"], points: Float[np.ndarray, "n 3"]) -> list[Int[np.ndarray, " k/2"]]:
    axis = np.ptp(points[box], axis=0).argmax()
    return np.split(box[np.argsort(points[box, axis])], 2)


# Minima are taken of the bits as integers, which for numbers from 0 up have the same order: LLVM makes
# vector instructions of that, but not of minima of floats, whose NaN it would have to heed.
@numba.njit(fastmath={"nsz", "contract", "reassoc"}, cache=True)
def _nearest(basis, middle, side, points):  # type: ignore[no-untyped-def]
    """Squared distance from each basis point of each box to the nearest of the points (3×M)."""
    boxes, _, size = basis.shape
    x, y, z = points[0], points[1], points[2]
    excess = np.empty(len(x), np.float32)
    near = np.empty_like(points)
    near_x, near_y, near_z = near[0], near[1], near[2]
    squared = np.empty((boxes, size), np.float32)
    for box in range(boxes):
        lowest = _LARGEST
        for i in range(len(x)):
            dx, dy, dz = x[i] - middle[box, 0], y[i] - middle[box, 1], z[i] - middle[box, 2]
            excess[i] = dx * dx + dy * dy + dz * dz
            lowest = min(lowest, np.float32(excess[i]).view(np.int32))
        limit = np.int32(lowest).view(np.float32)
        q = 0
        while excess[q] != limit:
            q += 1
        qx, qy, qz = x[q], y[q], z[q]
        sx, sy, sz = side[box, 0], side[box, 1], side[box, 2]
        for i in range(len(x)):
            excess[i] -= sx * abs(x[i] - qx) + sy * abs(y[i] - qy) + sz * abs(z[i] - qz)
        count = 0
        for i in range(len(x)):
            near_x[count], near_y[count], near_z[count] = x[i], y[i], z[i]
            count += excess[i] <= limit
        for k in range(size):
            bx, by, bz = basis[box, 0, k], basis[box, 1, k], basis[box, 2, k]
            lowest = _LARGEST
            for i in range(count):
                dx, dy, dz = bx - near_x[i], by - near_y[i], bz - near_z[i]
                lowest = min(lowest, np.float32(dx * dx + dy * dy + dz * dz).view(np.int32))
            squared[box, k] = np.int32(lowest).view(np.float32)
    return squared
