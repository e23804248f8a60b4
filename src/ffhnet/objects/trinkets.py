"""Families of small and flat things that lie between the fingers and the table.

Each function draws one object's convex pieces, sizes in millimetres.
"""

from __future__ import annotations

import numpy as np

from ffhnet.objects.convex import bar, block, circle, convex_hull, ellipsoid, stack
from ffhnet.objects.packages import Pieces, mm


def marble(rng: np.random.Generator) -> Pieces:
    """Marble, walnut, egg, table-tennis ball."""
    radius = mm(rng, 13, 26)
    return [ellipsoid(np.zeros(3), radius * np.array([rng.uniform(1.0, 1.4), 1.0, rng.uniform(0.8, 1.0)]))]


def toy_block(rng: np.random.Generator) -> Pieces:
    """Wooden block, die, matchbox: a cuboid or a prism of a few centimetres."""
    half = np.array([mm(rng, 12, 30), mm(rng, 12, 22), mm(rng, 11, 20)])
    if rng.uniform() < 0.7:
        return [block(np.zeros(3), half)]
    return [stack([(0.0, circle(half[1])), (2 * half[2], circle(half[1] * rng.uniform(0.7, 1.0)))])[0]]


def brick(rng: np.random.Generator) -> Pieces:
    """Building brick: a block with studs on top."""
    pitch, high = mm(rng, 14, 18), mm(rng, 18, 26)
    columns, rows = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    half = np.array([columns * pitch, rows * pitch, high]) / 2
    pieces = [block(np.zeros(3), half)]
    for column in range(columns):
        for row in range(rows):
            foot = np.array([(column + 0.5) * pitch - half[0], (row + 0.5) * pitch - half[1], 0.8 * half[2]])
            pieces.append(
                bar(foot, foot + (0.0, 0.0, 0.2 * half[2] + 0.3 * pitch), (0.3 * pitch, 0.3 * pitch))
            )
    return pieces


def pyramid(rng: np.random.Generator) -> Pieces:
    """Pyramid, cone, bell."""
    radius, high = mm(rng, 20, 48), mm(rng, 28, 85)
    foot = circle(radius)
    if rng.uniform() < 0.6:
        foot = radius * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return [*stack([(0.0, foot), (high, foot * rng.uniform(0.05, 0.4))])]


def cutlery(rng: np.random.Generator) -> Pieces:
    """Knife, spoon, spatula, comb: a thin handle that goes over into a flat blade or bowl."""
    grip, blade = mm(rng, 60, 150), mm(rng, 40, 120)
    thick = mm(rng, 5, 9)
    neck = np.array([grip, 0.0, 0.0])
    pieces = [bar(np.zeros(3), neck, (mm(rng, 6, 13), thick), rng.uniform(0.6, 1.0))]
    wide = mm(rng, 10, 36)
    if rng.uniform() < 0.5:
        pieces.append(ellipsoid(neck + (0.8 * blade / 2, 0.0, 0.0), np.array([blade / 2, wide, 1.2 * thick])))
    else:
        corners = np.array([[0.0, 0.3 * wide], [blade, wide], [blade, -wide], [0.0, -0.3 * wide]])
        flat = 0.5 * thick
        top, bottom = (np.column_stack([corners, np.full(4, z)]) + neck for z in (flat, -flat))
        pieces.append(convex_hull(np.vstack([top, bottom])))
    return pieces
