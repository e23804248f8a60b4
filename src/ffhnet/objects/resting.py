"""Resting poses of an object on a table, from its convex hull and its centre of mass.

An object set down with some direction below settles on a facet of its hull: while the centre of mass is not
above that facet, it topples over the edge that is passed furthest (quasi-static, no bouncing or rolling on).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ffhnet.errors import ObjectError
from ffhnet.geometry.transforms import make_transform
from ffhnet.objects.inertia import MassProperties, piece_properties

TILT_MARGIN = np.radians(5.0)
"""A pose that a tilt by this much turns into another one is too shaky to be met on a table."""

ROLL_TILT = np.radians(10.0)
"""A pose rolls where a tilt by this much ends in a like pose on another facet: more than half a side of
our 24-sided round objects."""

MIN_PROBABILITY = 0.03
"""Share of all directions, drawn evenly, that must settle in a pose for it to count."""

LIKENESS = 0.002
"""m: poses are one where the heights and radii of gyration that describe them differ by less than this."""

UPRIGHT = np.radians(3.0)
"""An uneven base of a scanned object may lean it by this much and it still stands."""


@dataclass(frozen=True)
class RestingPose:
    """One way in which an object rests on the table z = 0.

    Attributes:
        name: "standing" (as modelled) or "lying_K", most probable first.
        T_world_object: with the lowest point at z = 0 and the centre of mass above the world origin.
        probability: share of evenly drawn directions that settle in this pose or one like it.
        rolls: whether a small push makes it roll on to a like pose (a can on its side, a ball).
    """

    name: str
    T_world_object: Float[np.ndarray, "4 4"]
    probability: float
    rolls: bool


class _Hull:
    """Hull of an object about its centre of mass, with the facet on which each facet's fall ends."""

    def __init__(self, points: Float[np.ndarray, "n 3"], mass: MassProperties) -> None:
        self.centre = mass.centre
        self.points = points - mass.centre
        self.gyration = mass.inertia / mass.mass
        hull = ConvexHull(self.points)
        self.normals = hull.equations[:, :3]
        self.heights = -hull.equations[:, 3]
        self.final = _ends_of_falls(self.points[hull.simplices], self.normals, self.heights, hull.neighbors)
        self._signatures: dict[int, np.ndarray] = {}

    def settle(self, down: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Facet on which the object rests after being let go with these directions (units) below."""
        along = down @ self.normals.T
        distance = np.divide(self.heights, along, out=np.full_like(along, np.inf), where=along > 1e-9)
        return self.final[distance.argmin(axis=1)]

    def alike(self, facet: int, other: int) -> bool:
        """Whether two poses differ by no more than a turn about z or the facet of a round side."""
        return bool(np.abs(self._signature(facet) - self._signature(other)).max() < LIKENESS)

    def _signature(self, facet: int) -> Float[np.ndarray, " 5"]:
        """Lengths (m) that describe a pose: height of the centre, full height, radii of gyration."""
        if facet in self._signatures:
            return self._signatures[facet]
        down = self.normals[facet]
        across = np.linalg.svd(down[None])[2][1:]
        widths = np.linalg.eigvalsh(across @ self.gyration @ across.T)
        upright = down @ self.gyration @ down
        height = self.heights[facet]
        top = height - (self.points @ down).min()
        self._signatures[facet] = np.array([height, top, *np.sqrt([*widths, upright])])
        return self._signatures[facet]


def _ends_of_falls(
    corners: Float[np.ndarray, "f 3 3"],
    normals: Float[np.ndarray, "f 3"],
    heights: Float[np.ndarray, " f"],
    neighbours: Int[np.ndarray, "f 3"],
) -> Int[np.ndarray, " f"]:
    """Facet on which an object that starts on each facet comes to rest."""
    foot = normals * heights[:, None]
    # Edge k lies opposite corner k, as qhull numbers the neighbours.
    start, end = corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]
    outward = np.cross(end - start, normals[:, None])
    outward /= np.maximum(np.linalg.norm(outward, axis=2, keepdims=True), 1e-15)
    outward *= np.sign(np.einsum("fki,fki->fk", outward, start - corners))[..., None]
    passed = np.einsum("fki,fki->fk", outward, foot[:, None] - start)
    worst = passed.argmax(axis=1)
    facets = np.arange(len(normals))
    after = np.where(passed.max(axis=1) > 1e-9, neighbours[facets, worst], facets)
    # Falls only lead downwards; doubling the path reaches the end of the longest one.
    for _ in range(int(np.ceil(np.log2(len(facets)))) + 1):
        after = after[after]
    return after


def resting_poses(pieces: Sequence[trimesh.Trimesh], max_lying: int = 4) -> tuple[RestingPose, ...]:
    """Stable poses of an object made of convex pieces of one density.

    Args:
        pieces: closed meshes in the object's frame, metres.
        max_lying: number of poses kept next to the standing one.

    Returns:
        "standing" first, if the object stands as modelled, then lying poses by falling probability. Poses
        that look alike (facets of a round side, opposite sides of a box) are given once.

    Raises:
        ObjectError: no pose is stable.
    """
    hull = _Hull(np.concatenate([piece.vertices for piece in pieces]), piece_properties(pieces))
    modelled = int(hull.settle(np.array([[0.0, 0.0, -1.0]]))[0])
    stands = hull.normals[modelled, 2] < -np.cos(UPRIGHT) and _steady(hull, modelled)
    groups = _groups(hull, first=modelled if stands else None)
    lying = [
        facet
        for facet, share in groups.items()
        if share >= MIN_PROBABILITY and _steady(hull, facet) and not (stands and facet == modelled)
    ]
    lying = sorted(lying, key=lambda facet: -groups[facet])[:max_lying]
    named = [("standing", modelled)] if stands else []
    named += [(f"lying_{k}", facet) for k, facet in enumerate(lying)]
    if not named:
        raise ObjectError(f"wanted an object that rests stably, but all {len(groups)} poses tip over")
    return tuple(
        RestingPose(name, _pose(hull, facet), groups[facet], _rolls(hull, facet)) for name, facet in named
    )


def _groups(hull: _Hull, first: int | None) -> dict[int, float]:
    """Probability of each group of like poses, under its leading facet: `first`, or else the likeliest."""
    facets, counts = np.unique(hull.settle(_sphere(1500)), return_counts=True)
    shares = dict(zip(facets.tolist(), (counts / counts.sum()).tolist(), strict=True))
    order = sorted(shares, key=lambda facet: (facet != first, -shares[facet]))
    groups: dict[int, float] = {} if first is None else {first: 0.0}
    for facet in order:
        lead = next((lead for lead in groups if hull.alike(lead, facet)), facet)
        groups[lead] = groups.get(lead, 0.0) + shares[facet]
    return groups


def _steady(hull: _Hull, facet: int) -> bool:
    """Whether the pose, tilted by `TILT_MARGIN` to any side, comes back to itself or to one like it."""
    ends = np.unique(hull.settle(_cone(hull.normals[facet], TILT_MARGIN)))
    return all(hull.alike(facet, int(end)) for end in ends)


def _rolls(hull: _Hull, facet: int) -> bool:
    """Whether a tilt by `ROLL_TILT` ends in a like pose on a facet of another direction."""
    ends = np.unique(hull.settle(_cone(hull.normals[facet], ROLL_TILT)))
    turned = hull.normals[ends] @ hull.normals[facet] < np.cos(np.radians(1.0))
    return any(hull.alike(facet, int(end)) for end in ends[turned])


def _pose(hull: _Hull, facet: int) -> Float[np.ndarray, "4 4"]:
    """T_world_object with the facet on the table, reached by the smallest rotation."""
    down = hull.normals[facet]
    axis = np.cross(down, [0.0, 0.0, -1.0])
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, -down[2])
    axis = axis / sine if sine > 1e-9 else np.array([1.0, 0.0, 0.0])
    rotation = np.eye(3) if angle < 1e-7 else Rotation.from_rotvec(axis * angle).as_matrix()
    lowest = (hull.points @ rotation[2]).min()
    return make_transform(rotation, np.array([0.0, 0.0, -lowest]) - rotation @ hull.centre)


def _sphere(count: int) -> Float[np.ndarray, "n 3"]:
    """Directions spread evenly over the sphere (Fibonacci lattice), the same ones each time."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, k * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - z**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def _cone(axis: Float[np.ndarray, " 3"], half_angle: float, count: int = 24) -> Float[np.ndarray, "n 3"]:
    """Directions at one angle to an axis."""
    across = np.linalg.svd(axis[None])[2][1:]
    turn = np.arange(count) * 2 * np.pi / count
    circle = np.column_stack([np.cos(turn), np.sin(turn)]) @ across
    return np.cos(half_angle) * axis + np.sin(half_angle) * circle
