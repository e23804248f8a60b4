"""Which objects a five-finger hand can grasp at all, judged from their shape and mass.

The paper filters the objects of KIT and BigBIRD "for their graspability and object type" (section IV-A) and
does not say how; this is our rule. It looks for places where thumb and fingers can close around the object:
enough surface whose other side is no further away than the hand opens, sideways enough that fingers come to
both sides while the object lies on a table, and high enough above the table for a finger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.objects.grasp_object import GraspObject

POINTS = 1500
"""Surface points that are looked at: 2 cm² each on a large cereal box."""

MERGE_GAP = 5e-4
"""m: convex pieces of a scan leave gaps up to this between them that are not gaps of the object."""


@dataclass(frozen=True)
class HandLimits:
    """What a hand can hold; the values are those of the DLR-HIT Hand II.

    Attributes:
        opening: m between thumb and fingers when open.
        finger_radius: m; a grip is at least so far above the table, and no object lower than a finger is
            thick can be gripped from its sides.
        max_slope: sine of the angle to the horizontal at which thumb and fingers still oppose each other.
        min_area: m² of surface, both sides of the grip together: the pads of two fingers and the thumb.
        max_mass: kg that fingertip forces of 10 N hold by friction, with a reserve for the lift.
    """

    opening: float = 0.095
    finger_radius: float = 0.009
    max_slope: float = 0.7
    min_area: float = 5e-4
    max_mass: float = 1.0


DLR_HIT_II = HandLimits()


@dataclass(frozen=True)
class Grips:
    """Places of an object's surface, spread evenly over its area.

    Attributes:
        points: metres, in the object's frame.
        normals: outward units.
        widths: m of the object inward along the normal.
        area: m² that each point stands for.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    widths: Float[np.ndarray, " n"]
    area: float


def why_not_graspable(obj: GraspObject, limits: HandLimits = DLR_HIT_II) -> str | None:
    """The reason why the hand can grasp an object in none of its resting poses, or none if it can."""
    if obj.mass > limits.max_mass:
        return f"too heavy: {1000 * obj.mass:.0f} g, the hand holds {1000 * limits.max_mass:.0f} g"
    vertices = np.concatenate([piece.vertices for piece in obj.pieces])
    heights = [float(np.ptp(vertices @ pose[2, :3])) for pose in obj.resting_poses]
    if max(heights) < 2 * limits.finger_radius:
        return f"too flat: at most {1000 * max(heights):.0f} mm above the table"
    grips = find_grips(obj.pieces)
    widths = [_narrowest(grips, pose, limits) for pose in obj.resting_poses]
    if np.isinf(min(widths)):
        return "no sides that thumb and fingers could oppose"
    if min(widths) > limits.opening:
        opening = f"{1000 * limits.opening:.0f} mm"
        return f"too big: {1000 * min(widths):.0f} mm at its narrowest, the hand opens {opening}"
    return None


def _narrowest(grips: Grips, T_world_object: Float[np.ndarray, "4 4"], limits: HandLimits) -> float:
    """Width of the hand's opening (m) that makes `min_area` of the surface graspable in a pose."""
    heights = grips.points @ T_world_object[2, :3] + T_world_object[2, 3]
    slopes = np.abs(grips.normals @ T_world_object[2, :3])
    widths = np.sort(grips.widths[(heights > limits.finger_radius) & (slopes < limits.max_slope)])
    needed = max(int(np.ceil(limits.min_area / grips.area)), 1)
    return float(widths[needed - 1]) if needed <= len(widths) else np.inf


def find_grips(pieces: Sequence[trimesh.Trimesh], count: int = POINTS) -> Grips:
    """Surface points of a union of convex pieces, with the object's width behind each.

    Args:
        pieces: closed convex meshes with outward faces, metres; they may touch or overlap.
        count: of points on all pieces, less those that lie inside others; the same ones each time.
    """
    corners = np.concatenate([piece.triangles for piece in pieces])
    points, normals, area = _spread(corners, count)
    enters, leaves = _crossings(pieces, points, -normals)
    # Walk from piece to piece, in both directions, as long as the next one begins where the last one ended.
    depth = np.zeros(len(points))
    outward = np.zeros(len(points))
    for _ in pieces:
        deeper = np.where(enters <= depth[:, None] + MERGE_GAP, leaves, 0.0).max(axis=1)
        further = np.where(leaves >= -outward[:, None] - MERGE_GAP, -enters, 0.0).max(axis=1)
        if (deeper <= depth).all() and (further <= outward).all():
            break
        depth, outward = np.maximum(depth, deeper), np.maximum(outward, further)
    outside = outward <= 2 * MERGE_GAP
    return Grips(points[outside], normals[outside], depth[outside], area)


def _spread(
    corners: Float[np.ndarray, "f 3 3"], count: int
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], float]:
    """Points spread evenly over triangles, their normals, and the area of each."""
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(crosses, axis=1)
    ends = np.cumsum(doubled) / 2
    # The golden ratio's multiples fill each triangle evenly however few points it gets.
    k = np.arange(count) + 0.5
    face = np.minimum(np.searchsorted(ends, k / count * ends[-1]), len(ends) - 1)
    u, v = np.sqrt(k * 0.7548776662 % 1), k * 0.5698402910 % 1
    weights = np.column_stack([1 - u, u * (1 - v), u * v])
    return (
        np.einsum("nk,nkx->nx", weights, corners[face]),
        crosses[face] / doubled[face, None],
        ends[-1] / count,
    )


def _crossings(
    pieces: Sequence[trimesh.Trimesh], points: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n p"], Float[np.ndarray, "n p"]]:
    """Distances (m) at which each line enters and leaves each convex piece; (inf, -inf) where it misses."""
    enters, leaves = [], []
    for piece in pieces:
        normals, offsets = (
            piece.face_normals,
            np.einsum("fx,fx->f", piece.face_normals, piece.triangles[:, 0]),
        )
        along, room = directions @ normals.T, offsets - points @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = room / along
        enter = np.where(along < -1e-9, at, -np.inf).max(axis=1)
        leave = np.where(along > 1e-9, at, np.inf).min(axis=1)
        missed = (enter > leave) | ((np.abs(along) <= 1e-9) & (room < -1e-9)).any(axis=1)
        enters.append(np.where(missed, np.inf, enter))
        leaves.append(np.where(missed, -np.inf, leave))
    return np.stack(enters, axis=1), np.stack(leaves, axis=1)
