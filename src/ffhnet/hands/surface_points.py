"""Points spread over where a hand is while it closes: where a network looks for the object."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.hands.hand import Hand

CLOSURES = (0.0, 0.45, 0.9)
"""How far the closing joints are between their limits; the others stand at the eigengrasp origin."""

CANDIDATES = 4000
"""Points per closure from which the spread ones are picked."""


def surface_points(hand: Hand, count: int) -> Float[np.ndarray, "count 3"]:
    """Points (m, palm frame) on the hand's surface, open to nearly closed, as far from each other as can be.

    Args:
        hand: the hand.
        count: number of points; fewer are the first ones of more.
    """
    closing = hand.closing.moves > 0
    candidates = []
    for closure in CLOSURES:
        joints = np.where(closing, hand.lower + closure * (hand.upper - hand.lower), hand.eigengrasp_origin)
        candidates.append(trimesh.sample.sample_surface(hand.shape(joints), CANDIDATES, seed=1)[0])
    points = np.concatenate(candidates)
    chosen = np.zeros(count, dtype=int)
    nearest = np.full(len(points), np.inf)
    for i in range(1, count):
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[i - 1]], axis=1))
        chosen[i] = nearest.argmax()
    return points[chosen]
