"""The table: the plane on which the objects of a scene rest, found by RANSAC."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.errors import SceneError
from ffhnet.geometry.transforms import apply
from ffhnet.perception.view_frame import unit

_HYPOTHESES = 300
_SAMPLE = 3000
_REFINE_SAMPLE = 20000
_PATCH = 0.15
"""m: preferred distance between the three points of a hypothesis. Near points lie on one surface far more
often than points drawn from the whole scene."""

_MIN_SHARE = 0.05
"""Share of the scene's points that a table must have."""

_MAX_TILT_DEGREES = {"guess": 80.0, "hint": 25.0}
"""Largest angle between the table's normal and the guessed or the given up direction."""

_TABLE_ABOVE_FLOOR = 0.3
"""m: a parallel plane so far above another is a table on a floor; boxes on a table are lower."""

_TABLE_TO_FLOOR = 0.25
"""Least share of the floor's score that such a table must have."""

_PARALLEL_DEGREES = 10.0

_CAMERA_UP_GUESS = np.array([0.0, -1.0, -1.0]) / np.sqrt(2)
"""Camera frame: half way between the up of a level camera (-y) and of one that looks straight down (-z)."""


@dataclass(frozen=True)
class Plane:
    """The plane normal · x = offset in the frame of the cloud that it was fitted to.

    Attributes:
        normal: unit normal, pointing up from the table.
        offset: metres.
    """

    normal: Float[np.ndarray, " 3"]
    offset: float

    def height(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        """Metres above the plane (below: negative)."""
        return points @ self.normal - self.offset

    def coordinates(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 2"]:
        """Points projected on the plane, in metres along two axes of it that the normal determines."""
        helper = np.eye(3)[np.argmin(np.abs(self.normal))]
        first = unit(np.cross(self.normal, helper), "plane axis")
        return points @ np.column_stack([first, np.cross(self.normal, first)])

    def to_frame(self, T_new_old: Float[np.ndarray, "4 4"]) -> Plane:
        """The same plane in another frame; `T_new_old` takes old coordinates to new ones."""
        normal = T_new_old[:3, :3] @ self.normal
        return Plane(normal, float(normal @ apply(T_new_old, self.normal * self.offset)))


def fit_table(
    cloud: Float[np.ndarray, "N 3"],
    rng: np.random.Generator,
    up_hint: Float[np.ndarray, " 3"] | None = None,
    threshold: float = 0.008,
) -> Plane:
    """The best supported plane that can be a table (section III: the plane is found by RANSAC).

    Args:
        cloud: the scene (m). Without a hint it must be in the camera frame, camera at the origin.
        rng: source of randomness.
        up_hint: roughly the direction against gravity. Without it a plane counts the more, the nearer
            its normal is to what a camera that looks down at a table would see; walls beside the
            camera are never taken.
        threshold: largest distance (m) of a point that supports a plane.

    Raises:
        SceneError: no plane whose normal can be a table's holds 5 % of the points.
    """
    if len(cloud) < 3:
        raise SceneError(f"a table plane wants at least 3 points, got {len(cloud)}")
    sample = cloud.take(rng.integers(len(cloud), size=_SAMPLE), axis=0)
    normals, offsets = _hypotheses(sample, rng)
    if up_hint is None:
        up, limit = _CAMERA_UP_GUESS, _MAX_TILT_DEGREES["guess"]
        sign = np.where(offsets > 0, -1.0, 1.0)
    else:
        up, limit = unit(up_hint, "up hint"), _MAX_TILT_DEGREES["hint"]
        sign = np.where(normals @ up < 0, -1.0, 1.0)
    normals, offsets = normals * sign[:, None], offsets * sign
    cosine = normals @ up
    allowed = cosine > np.cos(np.radians(limit))
    support = _support(sample, normals, offsets, threshold)
    share = 100 * support[allowed].max(initial=0.0)
    allowed &= support >= _MIN_SHARE
    if not allowed.any():
        raise SceneError(
            "no table in the scene: wanted a plane that faces the camera or up, with "
            f"{100 * _MIN_SHARE:.0f} % of the points, the best holds {share:.1f} %; "
            "for an object already cut out give the up direction"
        )
    score = np.where(allowed, support * cosine, 0.0)
    best = _above_floor(normals, offsets, score)
    plane = Plane(normals[best], float(offsets[best]))
    dense = cloud.take(rng.integers(len(cloud), size=_REFINE_SAMPLE), axis=0)
    # The last round leaves out the lowest centimetre of the objects, which would lift the plane.
    for reach in (threshold, threshold, threshold / 2):
        plane = _refit(dense, plane, reach)
    return plane


def _above_floor(
    normals: Float[np.ndarray, "K 3"], offsets: Float[np.ndarray, " K"], score: Float[np.ndarray, " K"]
) -> int:
    """The plane of the best score, or if that is a floor, the best of the tables that stand on it."""
    best = int(np.argmax(score))
    parallel = normals @ normals[best] > np.cos(np.radians(_PARALLEL_DEGREES))
    higher = offsets - offsets[best] > _TABLE_ABOVE_FLOOR
    tables = np.where(parallel & higher & (score > _TABLE_TO_FLOOR * score[best]), score, 0.0)
    return int(np.argmax(tables)) if tables.any() else best


def _support(
    points: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "K 3"],
    offsets: Float[np.ndarray, " K"],
    threshold: float,
) -> Float[np.ndarray, " K"]:
    """Share of the points within `threshold` (m) of each plane; float32 is exact enough to count."""
    distance = normals.astype(np.float32) @ points.T.astype(np.float32)
    distance -= offsets[:, None].astype(np.float32)
    np.abs(distance, out=distance)
    return np.count_nonzero(distance < threshold, axis=1) / len(points)


def _hypotheses(
    sample: Float[np.ndarray, "N 3"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "K 3"], Float[np.ndarray, " K"]]:
    """Normals and offsets of planes through three points about `_PATCH` apart."""
    anchors = sample[rng.integers(len(sample), size=_HYPOTHESES)]
    others = sample[rng.integers(len(sample), size=(_HYPOTHESES, 32))]
    misfit = np.abs(np.linalg.norm(others - anchors[:, None], axis=2) - _PATCH)
    chosen = np.argpartition(misfit, 2, axis=1)[:, :2]
    first, second = np.moveaxis(
        np.take_along_axis(others, chosen[:, :, None], axis=1) - anchors[:, None], 1, 0
    )
    normals = np.cross(first, second)
    area = np.linalg.norm(normals, axis=1)
    sides = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    wide = area > 0.3 * sides + 1e-12
    normals = normals[wide] / area[wide, None]
    return normals, np.einsum("ij,ij->i", normals, anchors[wide])


def _refit(points: Float[np.ndarray, "N 3"], plane: Plane, reach: float) -> Plane:
    """Least-squares plane of the points within `reach` (m) of a plane, with the normal on the same side."""
    near = points.compress(np.abs(plane.height(points)) < reach, axis=0)
    if len(near) < 10:
        return plane
    middle = np.einsum("ij->j", near) / len(near)  # the mean, several times faster
    centred = near - middle
    _, axes = np.linalg.eigh(centred.T @ centred)
    normal = axes[:, 0] * np.sign(axes[:, 0] @ plane.normal)
    return Plane(normal, float(normal @ middle))
