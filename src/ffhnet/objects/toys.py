"""Families of toys and figures: bodies with limbs, wings and wheels, rings, and lumps of any parts.

Each function draws one object's convex pieces, sizes in millimetres.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ffhnet.objects.convex import (
    arc_handle,
    bar,
    block,
    circle,
    convex_hull,
    ellipsoid,
    extrude_xz,
    stack,
)
from ffhnet.objects.packages import MIN_THICKNESS, Pieces, mm


def quadruped(rng: np.random.Generator) -> Pieces:
    """Toy animal on four legs, from pig to giraffe."""
    half = np.array([mm(rng, 28, 65), mm(rng, 16, 34), mm(rng, 18, 36)])
    leg, thick = mm(rng, 8, 50), mm(rng, 6, 12)
    body = np.array([0.0, 0.0, leg + half[2]])
    pieces = [ellipsoid(body, half)]
    for x in (-0.62, 0.62):
        for y in (-0.55, 0.55):
            hip = body + half * (x, y, -0.3)
            pieces.append(bar(np.array([hip[0], hip[1], 0.0]), hip, (thick, thick)))
    size = half[1] * rng.uniform(0.6, 1.1)
    head = body + half * (1.0, 0.0, 0.3) + (mm(rng, 0, 30), 0.0, mm(rng, 0, 60))
    pieces.append(bar(body + half * (0.6, 0.0, 0.2), head, (thick, thick)))
    pieces.append(ellipsoid(head, size * np.array([rng.uniform(1.0, 1.6), 0.9, 1.0])))
    if rng.uniform() < 0.5:
        end = body - half * (1.0, 0.0, 0.0) + (-mm(rng, 15, 45), 0.0, mm(rng, -10, 40))
        pieces.append(bar(body - half * (0.7, 0.0, 0.0), end, (0.006, 0.006)))
    return pieces


def bird(rng: np.random.Generator) -> Pieces:
    """Rubber duck, penguin, snowman, doll: a body with a head on it, perhaps a beak or arms."""
    half = np.array([mm(rng, 24, 52), mm(rng, 20, 44), mm(rng, 18, 50)])
    size = min(half) * rng.uniform(0.55, 1.0)
    body = np.array([0.0, 0.0, 0.8 * half[2]])
    head = body + (half[0] * rng.uniform(0.0, 0.7), 0.0, 0.85 * half[2] + 0.6 * size)
    base = stack([(0.0, circle(0.6 * half[1])), (0.4 * half[2], circle(0.75 * half[1]))])
    pieces = [*base, ellipsoid(body, half), ellipsoid(head, np.full(3, size))]
    if rng.uniform() < 0.6:
        pieces.append(bar(head, head + (size + mm(rng, 8, 22), 0.0, 0.0), (0.5 * size, 0.006), 0.7))
    if rng.uniform() < 0.4:
        reach = half[1] + mm(rng, 10, 35)
        up = np.array([0.0, 0.0, rng.uniform(-0.2, 0.7) * half[2]])
        pieces.append(bar(body + up - (0.0, reach, 0.0), body + up + (0.0, reach, 0.0), (0.008, 0.008)))
    return pieces


def aircraft(rng: np.random.Generator) -> Pieces:
    """Toy aeroplane, rocket or dragonfly: a fuselage with wings and a tail."""
    long, radius = mm(rng, 55, 125), mm(rng, 11, 27)
    fuselage = ellipsoid(np.zeros(3), np.array([long, radius, radius * rng.uniform(0.9, 1.3)]))
    thin = MIN_THICKNESS * rng.uniform(0.5, 0.75)

    def wing(x: float, z: float, span: float, chord: float, sweep: float) -> Pieces:
        halves = []
        for side in (-1.0, 1.0):
            tip = np.array([x - sweep, side * span, z])
            halves.append(bar(np.array([x, 0.0, z]), tip, (chord, thin), rng.uniform(0.5, 1.0)))
        return halves

    pieces = [
        fuselage,
        *wing(mm(rng, -15, 25), mm(rng, -8, 8), mm(rng, 55, 125), mm(rng, 12, 26), mm(rng, 0, 40)),
    ]
    tail = -0.85 * long
    pieces += wing(tail, 0.0, mm(rng, 22, 50), mm(rng, 8, 14), mm(rng, 0, 12))
    high = radius + mm(rng, 12, 38)
    pieces.append(
        extrude_xz([(tail - 0.012, 0.0), (tail + 0.03, 0.0), (tail, high), (tail - 0.016, high)], thin)
    )
    return pieces


def vehicle(rng: np.random.Generator) -> Pieces:
    """Toy car, lorry, locomotive: a chassis on wheels, with a cabin, a boiler or a load."""
    half = np.array([mm(rng, 35, 95), mm(rng, 17, 38), mm(rng, 8, 18)])
    wheel, wide = mm(rng, 9, 22), mm(rng, 4, 8)
    body = np.array([0.0, 0.0, wheel + half[2]])
    pieces = [block(body, half)]
    for x in (-0.65, 0.65):
        for side in (-1.0, 1.0):
            hub = np.array([x * half[0], side * half[1], wheel])
            pieces.append(bar(hub, hub + (0.0, side * 2 * wide, 0.0), (wheel, wheel)))
    cabin = half * (rng.uniform(0.25, 0.6), rng.uniform(0.7, 1.0), rng.uniform(0.8, 2.2))
    pieces.append(block(body + (rng.uniform(-0.4, 0.4) * half[0], 0.0, half[2] + cabin[2]), cabin))
    if rng.uniform() < 0.4:
        radius = half[1] * rng.uniform(0.4, 0.8)
        high = body + (0.0, 0.0, half[2] + 0.8 * radius)
        pieces.append(
            bar(high - (0.9 * half[0], 0.0, 0.0), high + (0.9 * half[0], 0.0, 0.0), (radius, radius))
        )
    return pieces


def ring(rng: np.random.Generator) -> Pieces:
    """Ring, bracelet, roll of tape, wheel; or a part of it: a banana, a horseshoe, a handle."""
    radius, thick = mm(rng, 22, 62), (mm(rng, 7, 18), mm(rng, 6, 22))
    whole = rng.uniform() < 0.6
    arc = 2 * np.pi if whole else rng.uniform(1.2, 4.5)
    count = max(int(np.ceil(arc / 0.55)), 3)
    angles = np.linspace(0, arc, count + 1)
    taper = 1.0 if whole else rng.uniform(0.4, 1.0)
    size = taper + (1 - taper) * np.sin(np.pi * angles / arc)
    corners = []
    for angle, scale in zip(angles, size, strict=True):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        section = circle(1.0)[::2] * thick * scale
        corners.append(section[:, :1] * out + (radius + thick[0]) * out + section[:, 1:] * (0.0, 0.0, 1.0))
    return [convex_hull(np.vstack(corners[k : k + 2])) for k in range(count)]


def basket(rng: np.random.Generator) -> Pieces:
    """Iron, basket, handbag, padlock: a body with a handle over its top."""
    half = np.array([mm(rng, 30, 70), mm(rng, 16, 42), mm(rng, 18, 50)])
    body = block(np.zeros(3), half) if rng.uniform() < 0.5 else ellipsoid(np.zeros(3), half)
    opening = (0.75 * half[2] + mm(rng, 18, 40), half[0] * rng.uniform(0.35, 0.6))
    handle = arc_handle(0.0, opening, mm(rng, 8, 14), mm(rng, 5, 12), (0.25 * half[2], 0.0))
    for piece in handle:
        # From beside the body to above it.
        piece.vertices = piece.vertices[:, [2, 1, 0]] * (-1.0, 1.0, 1.0)
    return [body, *handle]


def composite(rng: np.random.Generator) -> Pieces:
    """Lump of two to five blocks, rods, ellipsoids and cones, each stuck into those before it."""
    pieces: Pieces = []
    for _ in range(int(rng.integers(2, 6))):
        half = np.array([mm(rng, 9, 48), mm(rng, 9, 36), mm(rng, 9, 26)])
        kind = rng.choice(["block", "rod", "ellipsoid"])
        if kind == "block":
            piece = block(np.zeros(3), half)
        elif kind == "rod":
            end = np.array([half[0], 0.0, 0.0])
            piece = bar(-1.4 * end, 1.4 * end, (half[1], half[1]), rng.uniform(0.3, 1.0))
        else:
            piece = ellipsoid(np.zeros(3), half)
        turn = Rotation.random(random_state=rng) if pieces else Rotation.identity()
        piece.vertices = turn.apply(piece.vertices)
        if pieces:
            host = pieces[int(rng.integers(len(pieces)))]
            where = host.vertices[int(rng.integers(len(host.vertices)))]
            # Not at the outermost point, so that the two are one body.
            piece.apply_translation(0.8 * where + 0.2 * host.vertices.mean(axis=0))
        pieces.append(piece)
    return pieces
