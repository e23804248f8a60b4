"""Families of cans, bottles, jars, sprays, cups and bowls. Each function draws one object's convex pieces.

Sizes are drawn in millimetres around those of common household goods.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffhnet.objects.convex import (
    Ring,
    arc_handle,
    circle,
    ellipse,
    extrude_xz,
    hollow_wall,
    rounded_rectangle,
    stack,
)
from ffhnet.objects.packages import Pieces, mm

Section = Callable[[float], np.ndarray]
"""A cross-section of a body that turns from its full size at 1 into its round neck at 0."""


def can(rng: np.random.Generator) -> Pieces:
    """Tin, spice shaker or deodorant: a cylinder, plain, with bevelled ends or with a lid."""
    radius, high = mm(rng, 15, 45), mm(rng, 40, 200)
    high = min(high, 7 * radius)
    inset = mm(rng, 0.5, 4)
    style = rng.choice(["plain", "bevelled", "lid"])
    if style == "plain":
        return stack([(0.0, circle(radius)), (high, circle(radius))])
    if style == "bevelled":
        bevel = mm(rng, 1.5, 6)
        return stack(
            [
                (0.0, circle(radius - inset)),
                (bevel, circle(radius)),
                (high - bevel, circle(radius)),
                (high, circle(radius - inset)),
            ]
        )
    lid = high * rng.uniform(0.7, 0.9)
    return stack(
        [
            (0.0, circle(radius)),
            (lid, circle(radius)),
            (lid, circle(radius - inset)),
            (high, circle(radius - inset)),
        ]
    )


def stick(rng: np.random.Generator) -> Pieces:
    """Thin tall cylinder with a stopper: effervescent tablets, marker pen, candle."""
    radius, high = mm(rng, 12.5, 18), mm(rng, 100, 175)
    cap, stopper = high * rng.uniform(0.82, 0.95), radius * rng.uniform(0.85, 1.12)
    return stack(
        [(0.0, circle(radius)), (cap, circle(radius)), (cap, circle(stopper)), (high, circle(stopper))]
    )


def _shoulder(section: Section, bottom: float, top: float) -> list[Ring]:
    """Dome of rings from the full section just above `bottom` to the neck at `top`."""
    turns = np.linspace(0, np.pi / 2, 4)[1:]
    return [(bottom + (top - bottom) * np.sin(t), section(np.cos(t))) for t in turns]


def _neck_and_cap(rng: np.random.Generator, neck: float, z: float, long: float) -> list[Ring]:
    """Round neck of length `long` from z up, then a screw cap a little wider."""
    cap = neck * rng.uniform(1.05, 1.3)
    top = z + long + mm(rng, 10, 22)
    return [
        (z, circle(neck)),
        (z + long, circle(neck)),
        (z + long, circle(cap)),
        (top, circle(cap * rng.uniform(0.85, 1.0))),
    ]


def bottle(rng: np.random.Generator) -> Pieces:
    """Round bottle: drinks, vinegar, shampoo; some with a waist."""
    radius = mm(rng, 17, 42)
    body = max(mm(rng, 60, 140), 1.6 * radius)
    neck = max(radius * rng.uniform(0.3, 0.55), 0.009)
    shoulder = radius * rng.uniform(0.5, 1.3)
    waist = rng.choice([1.0, rng.uniform(0.78, 0.95)])
    rings: list[Ring] = [(0.0, circle(0.93 * radius)), (0.05 * body, circle(radius))]
    if waist < 1.0:
        rings += [(0.3 * body, circle(radius)), (0.55 * body, circle(waist * radius))]
    rings.append((0.8 * body if waist < 1.0 else body, circle(radius)))
    rings += _shoulder(lambda s: circle(neck + (radius - neck) * s), rings[-1][0], body + shoulder)
    return stack(rings + _neck_and_cap(rng, neck, body + shoulder, mm(rng, 8, 35)))


def detergent(rng: np.random.Generator) -> Pieces:
    """Bottle with an oval or squarish body: washing-up liquid, shampoo, ketchup."""
    half = np.array([mm(rng, 30, 66) / 2, mm(rng, 45, 100) / 2])
    body, shoulder = mm(rng, 70, 150), mm(rng, 12, 40)
    neck = max(half[0] * rng.uniform(0.35, 0.6), 0.009)
    corner = rng.uniform(0.4, 0.9)
    oval = bool(rng.integers(2))
    taper = rng.uniform(0.85, 1.0)

    def section(s: float) -> np.ndarray:
        x, y = neck + (half - neck) * s
        return ellipse(x, y) if oval else rounded_rectangle(x, y, min(x, y) * (1 - s * (1 - corner)))

    rings: list[Ring] = [(0.0, 0.94 * section(1.0)), (0.05 * body, section(1.0))]
    rings.append((body, section(taper)))
    rings += _shoulder(lambda s: section(taper * s), body, body + shoulder)
    return stack(rings + _neck_and_cap(rng, neck, body + shoulder, mm(rng, 4, 16)))


def jar(rng: np.random.Generator) -> Pieces:
    """Wide jar with a lid: jam, cream, spice mill."""
    radius = mm(rng, 20, 44)
    body = max(mm(rng, 35, 120), 0.9 * radius)
    lid = radius * rng.uniform(0.75, 1.0)
    neck = 0.93 * lid
    shoulder, gap, lid_high = mm(rng, 4, 14), mm(rng, 1.5, 4), mm(rng, 10, 28)
    square = bool(rng.integers(2)) and lid < 0.9 * radius

    def section(s: float) -> np.ndarray:
        size = neck + (radius - neck) * s
        return rounded_rectangle(size, size, size * (1 - 0.5 * s)) if square else circle(size)

    rings: list[Ring] = [(0.0, 0.94 * section(1.0)), (0.06 * body, section(1.0)), (body, section(1.0))]
    rings += _shoulder(section, body, body + shoulder)
    lid_bottom = body + shoulder + gap
    rings += [(lid_bottom, circle(neck)), (lid_bottom, circle(lid)), (lid_bottom + lid_high, circle(lid))]
    return stack(rings)


def spray_flask(rng: np.random.Generator) -> Pieces:
    """Trigger spray: an oval flask, a neck with a collar, a head with nozzle and trigger."""
    half = np.array([mm(rng, 52, 88) / 2, mm(rng, 42, 62) / 2])
    body, shoulder = mm(rng, 85, 140), mm(rng, 20, 40)
    neck, collar, reach = mm(rng, 10, 13), mm(rng, 14, 17), mm(rng, 34, 46)
    squeeze = rng.uniform(0.75, 1.0)

    def section(s: float) -> np.ndarray:
        return ellipse(*(neck + (half - neck) * s))

    rings: list[Ring] = [(0.0, 0.95 * section(1.0)), (0.04 * body, section(1.0)), (body, section(squeeze))]
    rings += _shoulder(lambda s: section(squeeze * s), body, body + shoulder)
    base = body + shoulder
    rings += [(base + 0.008, circle(neck)), (base + 0.008, circle(collar)), (base + 0.026, circle(collar))]
    chin = base + 0.026
    brow = chin + mm(rng, 24, 32)
    back, wide = -mm(rng, 20, 26), mm(rng, 9, 13)
    head = extrude_xz([(back, chin), (reach - 0.008, chin), (reach, brow - 0.014), (reach, brow - 0.004),
                       (0.3 * reach, brow), (back, brow - 0.006)], wide)  # fmt: skip
    nozzle = extrude_xz([(reach, brow - 0.014), (reach + 0.01, brow - 0.014),
                         (reach + 0.01, brow - 0.004), (reach, brow - 0.004)], 0.007)  # fmt: skip
    # The trigger hangs under the head in front of the collar and ends above the shoulder.
    hinge, tip = collar + 0.003, chin - mm(rng, 19, 25)
    trigger = extrude_xz([(hinge, chin), (hinge + 0.011, chin), (hinge + 0.019, tip), (hinge + 0.010, tip)],
                         0.006)  # fmt: skip
    return [*stack(rings), head, nozzle, trigger]


def cup(rng: np.random.Generator) -> Pieces:
    """Hollow drinking cup or mug, straight or widening upwards, with a handle in two of three draws."""
    top, high = mm(rng, 28, 45), mm(rng, 60, 130)
    bottom = top * rng.choice([1.0, rng.uniform(0.7, 1.0)])
    wall, base = mm(rng, 5, 8), mm(rng, 5, 9)
    slope = (top - bottom) / high
    foot = bottom + slope * base
    pieces = stack([(0.0, circle(bottom)), (base, circle(foot))])
    pieces += hollow_wall([(base, foot), (high, top)], foot - wall, top - wall)
    if rng.uniform() < 2 / 3:
        thick = mm(rng, 8, 11)
        grip = (mm(rng, 18, 30), high * rng.uniform(0.2, 0.3))
        pieces += arc_handle(0.52 * high, grip, thick, mm(rng, 4.5, 7), (bottom, slope))
    return pieces


def bowl(rng: np.random.Generator) -> Pieces:
    """Small bowl or dessert glass with a bulging wall."""
    top, high = mm(rng, 36, 45), mm(rng, 40, 75)
    bottom, wall, base = top * rng.uniform(0.55, 0.75), mm(rng, 5, 8), mm(rng, 6, 10)
    foot = bottom + 0.15 * (top - bottom)
    bulge = foot + rng.uniform(0.65, 0.85) * (top - foot)
    pieces = stack([(0.0, circle(bottom)), (base, circle(foot))])
    outer = [(base, foot), (base + 0.45 * (high - base), bulge), (high, top)]
    return pieces + hollow_wall(outer, foot - wall, top - wall)


def pot(rng: np.random.Generator) -> Pieces:
    """Closed pot that widens upwards (yoghurt, instant noodles), with a rim; or the same upside down."""
    top, high = mm(rng, 24, 43), mm(rng, 45, 130)
    bottom = top * rng.uniform(0.62, 0.9)
    rim, rim_high = min(top + mm(rng, 1, 4), 0.045), mm(rng, 3, 7)
    if rng.uniform() < 0.25:
        return stack([(0.0, circle(top)), (high, circle(bottom))])
    return stack(
        [(0.0, circle(bottom)), (high, circle(top)), (high, circle(rim)), (high + rim_high, circle(rim))]
    )
