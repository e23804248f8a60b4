"""Building blocks of procedural objects: closed convex meshes, cross-sections, stacks, hollow walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import ConvexHull

SIDES = 24
"""Corners of a round cross-section: 0.3 mm short of a true circle at a radius of 40 mm. A multiple of 4, so
that flat facets face ±x and ±y, and round objects lie on a facet."""

MERGE_TOLERANCE = 2e-3
"""Slices of a stack become one piece where its hull is larger by at most this fraction: fewer pieces make
cheaper physics, and the object is by definition the union of its pieces."""

Ring = tuple[float, Float[np.ndarray, "n 2"]]
"""A horizontal convex cross-section: its height z and its corners (x, y), in metres."""


def convex_hull(points: Float[np.ndarray, "n 3"]) -> trimesh.Trimesh:
    """Closed convex mesh of points with outward faces; plain qhull, far cheaper than trimesh's own hull."""
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    simplices = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    vertices, faces = np.unique(simplices, return_inverse=True)
    return trimesh.Trimesh(points[vertices], faces.reshape(-1, 3), process=False)


def rounded_rectangle(half_x: float, half_y: float, radius: float) -> Float[np.ndarray, "24 2"]:
    """Rectangle of half sides (half_x, half_y) with round corners; a regular polygon if all are equal."""
    per_corner = SIDES // 4
    half_step = np.pi / SIDES
    angles = np.arange(SIDES) * 2 * half_step + half_step
    corner = np.arange(SIDES) // per_corner
    sign_x = np.array([1, -1, -1, 1])[corner]
    sign_y = np.array([1, 1, -1, -1])[corner]
    # The division puts the flat facets, not the corners, at the stated half sides.
    arc = radius / np.cos(half_step) * np.column_stack([np.cos(angles), np.sin(angles)])
    return arc + np.column_stack([sign_x * (half_x - radius), sign_y * (half_y - radius)])


def ellipse(half_x: float, half_y: float) -> Float[np.ndarray, "24 2"]:
    """Ellipse of half axes (half_x, half_y) as a polygon whose facets touch x = ±half_x and y = ±half_y."""
    return rounded_rectangle(1.0, 1.0, 1.0) * (half_x, half_y)


def circle(radius: float) -> Float[np.ndarray, "24 2"]:
    """Regular polygon around a circle of this radius."""
    return ellipse(radius, radius)


def rectangle(half_x: float, half_y: float) -> Float[np.ndarray, "4 2"]:
    """Corners of a rectangle."""
    return np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * (half_x, half_y)


def ring_points(rings: Sequence[Ring]) -> Float[np.ndarray, "n 3"]:
    """All corners of some rings as points in space."""
    return np.vstack([np.column_stack([section, np.full(len(section), z)]) for z, section in rings])


def stack(rings: Sequence[Ring]) -> list[trimesh.Trimesh]:
    """Solid through horizontal rings of rising z: convex pieces that meet in planes z = const.

    Between two rings lies their convex hull; slices that are convex together become one piece. Two
    successive rings at one height make a step.
    """
    pieces: list[trimesh.Trimesh] = []
    start = 0
    volume = 0.0
    for k in range(1, len(rings)):
        if rings[k][0] == rings[k - 1][0]:
            start, volume = k, 0.0
            continue
        piece = convex_hull(ring_points(rings[k - 1 : k + 1]))
        volume += piece.volume
        if k - start > 1:
            merged = convex_hull(ring_points(rings[start : k + 1]))
            if merged.volume <= volume * (1 + MERGE_TOLERANCE):
                pieces[-1] = merged
                continue
            start, volume = k - 1, piece.volume
        pieces.append(piece)
    return pieces


def extrude_xz(outline: Sequence[tuple[float, float]], half_width: float) -> trimesh.Trimesh:
    """Convex outline (x, z) in metres made solid from y = -half_width to +half_width."""
    flat = np.asarray(outline, dtype=float)
    return convex_hull(np.vstack([np.insert(flat, 1, side, axis=1) for side in (-half_width, half_width)]))


def bar(
    start: Float[np.ndarray, 3],
    end: Float[np.ndarray, 3],
    half: tuple[float, float],
    taper: float = 1.0,
) -> trimesh.Trimesh:
    """Straight bar of oval section between two points.

    Args:
        start: metres.
        end: metres.
        half: half axes of the section at the start, metres: the horizontal one, and the other.
        taper: size of the section at the end against that at the start.
    """
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross((0.0, 0.0, 1.0), along)
    # An upright bar has no horizontal side of its own.
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else np.array([0.0, 1.0, 0.0])
    section = circle(1.0)[::2] * half @ np.stack([across, np.cross(along, across)])
    return convex_hull(np.vstack([start + section, end + taper * section]))


def ellipsoid(centre: Float[np.ndarray, 3], half: Float[np.ndarray, 3]) -> trimesh.Trimesh:
    """Ellipsoid of half axes (x, y, z), metres, with flat patches of about a tenth of its size."""
    return convex_hull(centre + half * trimesh.creation.icosphere(subdivisions=2).vertices)


def block(centre: Float[np.ndarray, 3], half: Float[np.ndarray, 3]) -> trimesh.Trimesh:
    """Box of half sides (x, y, z), metres."""
    corners = np.stack(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0]), axis=-1).reshape(-1, 3)
    return convex_hull(centre + half * corners)


def hollow_wall(
    outer: Sequence[tuple[float, float]], inner_bottom: float, inner_top: float
) -> list[trimesh.Trimesh]:
    """Round wall of wedges around the z axis, open above and below.

    Each wedge has two facets outside and one inside, which keeps it convex with half as many pieces.

    Args:
        outer: (z, radius) of rising z, a convex profile, metres.
        inner_bottom: radius of the hollow's corners at the lowest z.
        inner_top: the same at the highest z.
    """
    z_bottom, z_top = outer[0][0], outer[-1][0]
    corners = circle(1.0)
    directions = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    wedges = []
    for first in range(0, SIDES, 2):
        across = np.arange(first, first + 3) % SIDES
        edges = directions[across[[0, 2]]]
        rings = [(z, corners[across] * radius) for z, radius in outer]
        rings += [(z_bottom, edges * inner_bottom), (z_top, edges * inner_top)]
        wedges.append(convex_hull(ring_points(rings)))
    return wedges


def arc_handle(
    z_centre: float,
    opening: tuple[float, float],
    thickness: float,
    half_width: float,
    attach: tuple[float, float],
    segments: int = 5,
) -> list[trimesh.Trimesh]:
    """Half-elliptic handle in the xz plane that ends on the plane x = attach[0] + attach[1] z.

    Args:
        z_centre: height of the handle's middle, metres.
        opening: half axes (x, z) of the hole, metres.
        thickness: of the bar, metres.
        half_width: of the bar along y, metres.
        attach: offset and slope of the wall's facet; the handle is sheared along it, which keeps every
            piece convex.
        segments: number of pieces.
    """
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments + 1)
    ray = np.column_stack([np.cos(angles), np.sin(angles)])
    ray[[0, -1], 0] = 0.0
    curves = np.stack([ray * opening, ray * (np.array(opening) + thickness)], axis=1)
    curves[..., 1] += z_centre
    curves[..., 0] += attach[0] + attach[1] * curves[..., 1]
    return [
        extrude_xz([*map(tuple, curves[k]), *map(tuple, curves[k + 1])], half_width) for k in range(segments)
    ]
