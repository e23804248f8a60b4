"""Families of tools and appliances: long, flat, lying, with handles and heads.

Each function draws one object's convex pieces, sizes in millimetres around those of common goods.
"""

from __future__ import annotations

import numpy as np

from ffhnet.objects.convex import bar, block, circle, convex_hull, ellipsoid, extrude_xz, stack
from ffhnet.objects.packages import Pieces, mm


def hammer(rng: np.random.Generator) -> Pieces:
    """Hammer, mallet, brush or roller: a handle and a head across its end."""
    long, head = mm(rng, 130, 300), mm(rng, 55, 135)
    grip = (mm(rng, 9, 18), mm(rng, 8, 14))
    thick = mm(rng, 10, 22)
    end = np.array([long, 0.0, 0.0])
    shift = np.array([0.0, head * rng.uniform(0.35, 0.6), 0.0])
    face, peen = end + shift, end + shift - (0.0, head, 0.0)
    return [
        bar(np.zeros(3), end, grip, rng.uniform(0.6, 1.0)),
        bar(face, peen, (thick, thick * rng.uniform(0.7, 1.0)), rng.uniform(0.35, 1.0)),
    ]


def screwdriver(rng: np.random.Generator) -> Pieces:
    """Screwdriver, knife, paintbrush, toothbrush: a grip and a thinner end in one line."""
    grip, blade = mm(rng, 70, 135), mm(rng, 50, 170)
    wide, thick = mm(rng, 9, 19), mm(rng, 7, 17)
    thin = max(0.0045, thick * rng.uniform(0.25, 0.6))
    middle = np.array([grip, 0.0, 0.0])
    return [
        bar(np.zeros(3), middle, (wide, thick), rng.uniform(0.7, 1.0)),
        bar(middle, middle + (blade, 0.0, 0.0), (wide * rng.uniform(0.3, 1.0), thin), rng.uniform(0.5, 1.0)),
    ]


def wrench(rng: np.random.Generator) -> Pieces:
    """Spanner, bottle opener or hand mirror: a flat bar with a wider head at one end or both."""
    long, wide, thick = mm(rng, 100, 230), mm(rng, 7, 14), mm(rng, 5, 10)
    pieces = [bar(np.zeros(3), np.array([long, 0.0, 0.0]), (wide, thick))]
    for end in [0.0, long][: int(rng.integers(1, 3))]:
        radius = wide * rng.uniform(1.3, 3.0)
        head = stack([(-1.1 * thick, circle(radius)), (1.1 * thick, circle(radius))])[0]
        head.apply_translation((end, 0.0, 0.0))
        pieces.append(head)
    return pieces


def pliers(rng: np.random.Generator) -> Pieces:
    """Pliers, scissors or tongs: two bars that cross."""
    handle, jaw = mm(rng, 80, 140), mm(rng, 35, 90)
    spread, thick = mm(rng, 12, 35), mm(rng, 8, 12)
    pieces = [*stack([(-thick, circle(1.6 * thick)), (thick, circle(1.6 * thick))])]
    for side in (-1.0, 1.0):
        end = np.array([-handle, side * spread, 0.0])
        tip = np.array([jaw, -side * spread * rng.uniform(0.1, 0.5), 0.0])
        pieces.append(bar(end, np.zeros(3), (mm(rng, 6, 10), thick)))
        pieces.append(bar(np.zeros(3), tip, (mm(rng, 6, 11), thick), rng.uniform(0.5, 1.0)))
    return pieces


def ladle(rng: np.random.Generator) -> Pieces:
    """Spoon, spatula, ladle, brush or racket: a handle with a broad flat head."""
    long, rise = mm(rng, 90, 200), mm(rng, 0, 40)
    half = np.array([mm(rng, 18, 48), mm(rng, 16, 40), mm(rng, 5, 20)])
    end = np.array([long, 0.0, 0.0])
    pieces = [bar(np.array([0.0, 0.0, rise]), end, (mm(rng, 6, 13), mm(rng, 4.5, 9)))]
    middle = end + (0.8 * half[0], 0.0, 0.0)
    return [*pieces, ellipsoid(middle, half) if rng.uniform() < 0.6 else block(middle, half)]


def power_tool(rng: np.random.Generator) -> Pieces:
    """Cordless drill, hair dryer or glue gun: a barrel on a grip, with a foot in half of the draws."""
    radius, long, grip = mm(rng, 18, 36), mm(rng, 95, 190), mm(rng, 80, 135)
    back = long * rng.uniform(0.2, 0.45)
    top = grip + radius
    barrel = bar(np.array([-back, 0.0, top]), np.array([long - back, 0.0, top]), (radius, radius))
    nose = np.array([long - back, 0.0, top])
    nozzle = bar(
        nose, nose + (mm(rng, 15, 55), 0.0, 0.0), (0.75 * radius, 0.75 * radius), rng.uniform(0.4, 1.0)
    )
    lean = -mm(rng, 0, 30)
    half = (mm(rng, 13, 20), mm(rng, 17, 27))
    handle = bar(np.array([0.0, 0.0, top]), np.array([lean, 0.0, 0.0]), half)
    if rng.uniform() < 0.5:
        return [barrel, nozzle, handle]
    foot = block(np.array([lean, 0.0, 0.0]), np.array([mm(rng, 30, 55), mm(rng, 24, 40), mm(rng, 12, 26)]))
    return [barrel, nozzle, handle, foot]


def torch(rng: np.random.Generator) -> Pieces:
    """Flashlight, light bulb, microphone, dumb-bell: a shaft with a thicker head at one end or both."""
    radius, long = mm(rng, 9, 20), mm(rng, 60, 160)
    head, deep = radius * rng.uniform(1.2, 2.2), mm(rng, 25, 60)
    end = np.array([long, 0.0, 0.0])
    pieces = [bar(np.zeros(3), end, (radius, radius))]
    ball = rng.uniform() < 0.4
    for place, way in [(end, 1.0), (np.zeros(3), -1.0)][: 1 if rng.uniform() < 0.7 else 2]:
        if ball:
            pieces.append(ellipsoid(place + (0.7 * way * head, 0.0, 0.0), np.full(3, head)))
        else:
            pieces.append(bar(place + (deep * way, 0.0, 0.0), place, (head, head), rng.uniform(0.6, 1.0)))
    return pieces


def device(rng: np.random.Generator) -> Pieces:
    """Camera, binoculars, game controller, telephone, socket: a block with one or two round parts on it."""
    half = np.array([mm(rng, 38, 75), mm(rng, 12, 35), mm(rng, 15, 42)])
    pieces = [block(np.zeros(3), half)]
    count = int(rng.integers(1, 3))
    for k in range(count):
        radius = half[2] * rng.uniform(0.5, 1.1)
        at = np.array([(k - (count - 1) / 2) * half[0] * 1.2, 0.0, half[2] * rng.uniform(-0.3, 0.3)])
        reach = at + (0.0, half[1] + mm(rng, 8, 55), 0.0)
        pieces.append(bar(at, reach, (radius, radius), rng.uniform(0.6, 1.2)))
    return pieces


def stapler(rng: np.random.Generator) -> Pieces:
    """Stapler, hole punch, clip: a base and a lever that opens at an angle."""
    long, half_width, base = mm(rng, 90, 180), mm(rng, 12, 26), mm(rng, 10, 18)
    gap, lever = mm(rng, 6, 40), mm(rng, 12, 24)
    heel = long * rng.uniform(0.2, 0.35)
    return [
        extrude_xz([(0.0, 0.0), (long, 0.0), (long, 0.6 * base), (0.0, base)], half_width),
        extrude_xz([(0.0, base), (heel, base), (0.8 * heel, base + 0.7 * lever), (0.0, base + lever)],
                   half_width),
        extrude_xz([(0.1 * heel, base + 0.3 * lever), (long, base + gap), (long, base + gap + 0.7 * lever),
                    (0.0, base + lever)], 0.85 * half_width),
    ]  # fmt: skip


def shoe(rng: np.random.Generator) -> Pieces:
    """Shoe, boot or slipper: a sole, a closed toe, and an open collar behind it."""
    long, wide, sole = mm(rng, 120, 290), mm(rng, 50, 100) / 2, mm(rng, 10, 30)
    toe, collar = mm(rng, 30, 65), mm(rng, 25, 90)
    wall = mm(rng, 8, 12)
    split = long * rng.uniform(0.4, 0.55)
    heel = 0.8 * wide

    def across(x: float, z: float, half: float) -> np.ndarray:
        return np.array([[x, -half, z], [x, half, z]])

    def hull(*edges: np.ndarray) -> Pieces:
        return [convex_hull(np.vstack(edges))]

    low, high = sole, sole + collar
    pieces = hull(
        across(0.0, 0.0, 0.6 * heel), across(0.1 * long, 0.0, heel), across(0.75 * long, 0.0, wide),
        across(long, 0.0, 0.45 * wide), across(0.0, low, 0.6 * heel), across(0.1 * long, low, heel),
        across(0.75 * long, low, wide), across(long, low, 0.45 * wide),
    )  # fmt: skip
    pieces += hull(
        across(split, low, 0.95 * heel), across(0.78 * long, low, wide), across(0.97 * long, low, 0.4 * wide),
        across(split, low + toe, 0.7 * heel), across(0.75 * long, low + 0.65 * toe, 0.75 * wide),
        across(0.9 * long, low + 0.45 * toe, 0.35 * wide),
    )  # fmt: skip
    pieces += hull(across(0.0, low, 0.6 * heel), across(wall, low, heel),
                   across(0.0, high, 0.6 * heel), across(wall, high, 0.85 * heel))  # fmt: skip
    for side in (-1.0, 1.0):
        outer, inner = side * heel, side * (heel - wall)
        pieces += hull(np.array([[x, y, z] for x in (0.5 * wall, split + wall) for y in (outer, inner)
                                 for z in (low, high if x < split else low + 0.9 * toe)]))  # fmt: skip
    return pieces
