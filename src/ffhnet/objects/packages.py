"""Families of boxes, bags, tubes and solid lumps. Each function draws one object's convex pieces (metres).

Sizes are drawn in millimetres around those of common household goods.
"""

from __future__ import annotations

import numpy as np
import trimesh

from ffhnet.objects.convex import (
    Ring,
    circle,
    convex_hull,
    ellipse,
    rectangle,
    ring_points,
    rounded_rectangle,
    stack,
)

Pieces = list[trimesh.Trimesh]

MIN_THICKNESS = 0.008
"""m: fingers of a simulated hand are squeezed through thinner plates."""


def mm(rng: np.random.Generator, low: float, high: float) -> float:
    """A uniformly drawn length, given in millimetres, returned in metres."""
    return rng.uniform(low, high) * 1e-3


def box(rng: np.random.Generator) -> Pieces:
    """Carton of any proportions: baking soda, salt, tea."""
    section = rectangle(mm(rng, 25, 90) / 2, mm(rng, 25, 130) / 2)
    return stack([(0.0, section), (mm(rng, 40, 200), section)])


def thin_box(rng: np.random.Generator) -> Pieces:
    """Tall thin carton: pudding, soup powder, cereals."""
    section = rectangle(mm(rng, 25, 50) / 2, mm(rng, 60, 132) / 2)
    return stack([(0.0, section), (mm(rng, 85, 200), section)])


def milk_carton(rng: np.random.Generator) -> Pieces:
    """Square carton with a gable roof and a ridge."""
    half, roof = mm(rng, 45, 80) / 2, mm(rng, 15, 35)
    body = mm(rng, 70, 160)
    ridge = max(MIN_THICKNESS, 0.12 * half) / 2
    return stack(
        [
            (0.0, rectangle(half, half)),
            (body, rectangle(half, half)),
            (body + roof, rectangle(half, ridge)),
            (body + roof + mm(rng, 8, 18), rectangle(half, ridge)),
        ]
    )


def pouch(rng: np.random.Generator) -> Pieces:
    """Filled bag: round edges, thick below, flat seam above."""
    thick, wide, high = mm(rng, 30, 70) / 2, mm(rng, 60, 125) / 2, mm(rng, 80, 190)
    belly = rng.uniform(0.15, 0.45)
    seam = MIN_THICKNESS / 2

    def section(thickness: float, width: float) -> np.ndarray:
        return rounded_rectangle(thickness, width, 0.7 * min(thickness, width))

    return stack(
        [
            (0.0, section(0.75 * thick, 0.9 * wide)),
            (0.08 * high, section(0.92 * thick, wide)),
            (belly * high, section(thick, wide)),
            (0.65 * high, section(0.72 * thick, wide)),
            (0.9 * high, section(seam, wide)),
            (high, section(seam, wide)),
        ]
    )


def tube(rng: np.random.Generator) -> Pieces:
    """Toothpaste or cream tube standing on its cap: round at the shoulder, flat at the seam."""
    radius, long = mm(rng, 13, 25), mm(rng, 75, 150)
    cap = radius * rng.uniform(0.6, 1.0)
    cap_high, shoulder = mm(rng, 14, 28), mm(rng, 3, 8)
    seam, flat = MIN_THICKNESS / 2, radius * np.pi / 2 * 0.95
    seam_high = mm(rng, 5, 10)
    return stack(
        [
            (0.0, circle(cap * rng.uniform(0.88, 1.0))),
            (cap_high, circle(cap)),
            (cap_high, circle(0.75 * cap)),
            (cap_high + shoulder, circle(radius)),
            (cap_high + 0.4 * long, ellipse(0.92 * radius, radius * 1.08)),
            (cap_high + long, rounded_rectangle(seam, flat, seam / 2)),
            (cap_high + long + seam_high, rounded_rectangle(seam, flat, seam / 2)),
        ]
    )


def prism(rng: np.random.Generator) -> Pieces:
    """Upright prism of three, five, six or eight sides: gift boxes, chocolate bars."""
    sides = int(rng.choice([3, 5, 6, 8]))
    angles = np.arange(sides) * 2 * np.pi / sides + np.pi / 2
    radius = mm(rng, 18, 47)
    section = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    taper = rng.choice([1.0, rng.uniform(0.75, 1.0)])
    return stack([(0.0, section), (mm(rng, 40, 180), taper * section)])


def rounded_block(rng: np.random.Generator) -> Pieces:
    """Block with all edges rounded: soap, sponge, computer mouse, charger."""
    half = (mm(rng, 30, 88) / 2, mm(rng, 40, 120) / 2)
    high = mm(rng, 28, 90)
    edge = min(*half, high / 2) * rng.uniform(0.25, 0.8)
    angles = np.radians([-90, -60, -30, 0, 0, 30, 60, 90])
    levels = np.repeat([edge, high - edge], 4) + edge * np.sin(angles)
    insets = edge * (1 - 0.9 * np.cos(angles)) - 0.1 * edge
    corner = edge * 1.05
    rings: list[Ring] = [
        (z, rounded_rectangle(half[0] - inset, half[1] - inset, max(corner - inset, 0.05 * edge)))
        for z, inset in zip(levels, insets, strict=True)
    ]
    return [convex_hull(ring_points(rings))]


def fruit(rng: np.random.Generator) -> Pieces:
    """Egg, lemon, apple, pear: an ellipsoid with flattened poles, sometimes with a narrower top."""
    half_x = mm(rng, 20, 43)
    half_y, half_z = half_x * rng.uniform(0.85, 1.0), half_x * rng.uniform(0.8, 1.4)
    narrowing = rng.choice([0.0, rng.uniform(0.1, 0.45)])
    latitudes = np.radians([-68, -50, -30, -10, 10, 30, 50, 68])
    levels = half_z * (np.sin(latitudes) - np.sin(latitudes[0]))
    scales = np.cos(latitudes) * (1 - narrowing * (1 + np.sin(latitudes)) / 2)
    scales /= scales.max()
    return stack([(z, ellipse(half_x * s, half_y * s)) for z, s in zip(levels, scales, strict=True)])
