"""Families of plates, bowls, pans, pitchers, teapots and stemmed glasses: wide, hollow, with handles.

Each function draws one object's convex pieces. Walls are thicker than those of china and steel, because
fingers of a simulated hand are squeezed through plates thinner than `MIN_THICKNESS`.
"""

from __future__ import annotations

import numpy as np

from ffhnet.objects.convex import Ring, arc_handle, bar, circle, hollow_wall, stack
from ffhnet.objects.packages import MIN_THICKNESS, Pieces, mm


def plate(rng: np.random.Generator) -> Pieces:
    """Plate or saucer: a flat disc with a rim that rises outwards."""
    radius, high, thick = mm(rng, 60, 135), mm(rng, 18, 42), mm(rng, 8, 10)
    foot = radius - high * rng.uniform(0.5, 1.6)
    # Measured across the rim, not along the table, this is the thickness of the plate.
    wall = min(thick * np.hypot(high, radius - foot) / high, 0.9 * foot)
    base = stack([(0.0, circle(foot)), (thick, circle(foot))])
    return base + hollow_wall([(0.0, foot), (high, radius)], foot - wall, radius - 0.35 * wall)


def wide_bowl(rng: np.random.Generator) -> Pieces:
    """Cereal, salad or mixing bowl: wider than a hand opens, to be held by its wall."""
    top, high = mm(rng, 45, 90), mm(rng, 35, 85)
    bottom, wall, base = top * rng.uniform(0.4, 0.75), mm(rng, 6, 9), mm(rng, 8, 10)
    foot = bottom + 0.2 * (top - bottom)
    bulge = foot + rng.uniform(0.6, 0.85) * (top - foot)
    outer = [(base, foot), (base + 0.45 * (high - base), bulge), (high, top)]
    return stack([(0.0, circle(bottom)), (base, circle(foot))]) + hollow_wall(outer, foot - wall, top - wall)


def pan(rng: np.random.Generator) -> Pieces:
    """Frying pan or saucepan with one straight handle."""
    bottom, high = mm(rng, 45, 115), mm(rng, 25, 85)
    top, wall, base = bottom * rng.uniform(1.0, 1.25), mm(rng, 7, 9), mm(rng, 8, 10)
    foot = bottom + (top - bottom) * base / high
    pieces = stack([(0.0, circle(bottom)), (base, circle(foot))])
    pieces += hollow_wall([(base, foot), (high, top)], foot - wall, top - wall)
    long, rise = mm(rng, 90, 190), np.radians(rng.uniform(0, 25))
    start = np.array([top - wall / 2, 0.0, high - mm(rng, 8, 14)])
    end = start + long * np.array([np.cos(rise), 0.0, np.sin(rise)])
    return [*pieces, bar(start, end, (mm(rng, 8, 14), mm(rng, 5, 9)))]


def pitcher(rng: np.random.Generator) -> Pieces:
    """Tall jug or large mug with a handle on one side, some with a spout."""
    top, high = mm(rng, 38, 62), mm(rng, 85, 210)
    bottom = top * rng.choice([1.0, rng.uniform(0.75, 1.15)])
    wall, base = mm(rng, 6, 8), mm(rng, 7, 10)
    slope = (top - bottom) / high
    foot = bottom + slope * base
    pieces = stack([(0.0, circle(bottom)), (base, circle(foot))])
    pieces += hollow_wall([(base, foot), (high, top)], foot - wall, top - wall)
    grip = (mm(rng, 22, 40), high * rng.uniform(0.2, 0.34))
    pieces += arc_handle(0.52 * high, grip, mm(rng, 9, 14), mm(rng, 5, 11), (bottom, slope))
    if rng.uniform() < 0.4:
        lip = np.array([-top + wall / 2, 0.0, high - 0.012])
        pieces.append(bar(lip, lip + (-mm(rng, 12, 28), 0.0, 0.008), (mm(rng, 8, 14), 0.005)))
    return pieces


def teapot(rng: np.random.Generator) -> Pieces:
    """Teapot, kettle or watering can: a round body with spout, handle and the knob of a lid."""
    radius, high = mm(rng, 40, 72), mm(rng, 55, 115)
    belly, top = rng.uniform(0.3, 0.6), rng.uniform(0.45, 0.8)
    rings: list[Ring] = [
        (0.0, circle(rng.uniform(0.55, 0.85) * radius)),
        (0.5 * belly * high, circle(0.93 * radius)),
        (belly * high, circle(radius)),
        (0.5 * (1 + belly) * high, circle(0.9 * radius)),
        (high, circle(top * radius)),
    ]
    knob = mm(rng, 6, 13)
    rings += [(high, circle(knob)), (high + mm(rng, 10, 24), circle(knob * rng.uniform(0.9, 1.3)))]
    start = np.array([-0.75 * radius, 0.0, rng.uniform(0.25, 0.55) * high])
    tip = np.array([-radius - mm(rng, 20, 50), 0.0, high * rng.uniform(0.75, 1.1)])
    thick = mm(rng, 8, 15)
    spout = bar(start, tip, (thick, thick), rng.uniform(0.45, 0.9))
    pieces = [*stack(rings), spout]
    if rng.uniform() < 0.75:
        grip = (mm(rng, 25, 42), high * rng.uniform(0.25, 0.36))
        pieces += arc_handle(0.5 * high, grip, mm(rng, 8, 13), mm(rng, 4.5, 9), (0.85 * radius, 0.0))
    return pieces


def stemmed_glass(rng: np.random.Generator) -> Pieces:
    """Wine glass, goblet, egg cup or candlestick: a hollow or solid top on a stem and a foot."""
    foot, stem, thick = mm(rng, 26, 42), mm(rng, 4.5, 9), mm(rng, 8, 10)
    long, bowl = mm(rng, 25, 95), mm(rng, 40, 95)
    widest, top = mm(rng, 24, 45), rng.uniform(0.75, 1.1)
    base = thick + long
    rings: list[Ring] = [(0.0, circle(foot)), (thick, circle(0.9 * foot)), (thick, circle(stem))]
    rings += [(base, circle(stem)), (base + 0.25 * bowl, circle(0.85 * widest))]
    lip = base + bowl
    if rng.uniform() < 0.3:
        return stack([*rings, (base + 0.6 * bowl, circle(widest)), (lip, circle(top * widest))])
    wall = MIN_THICKNESS * rng.uniform(0.6, 0.9)
    outer = [(base + 0.25 * bowl, 0.85 * widest), (lip, max(top, 0.85) * widest)]
    return stack(rings) + hollow_wall(outer, outer[0][1] - wall, outer[1][1] - wall)
