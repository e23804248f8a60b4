"""Points on a hand's moving links, and all it takes to place them: arrays that can travel with weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.geometry.transforms import invert
from ffhnet.hands.hand import Hand

if TYPE_CHECKING:
    import trimesh

CANDIDATES = 600
"""Points of a link from which the spread ones are picked."""

POINTS_PER_LINK = 4
"""About one per centimetre of a finger."""

DEGREE = 4
"""Highest power in a coupling between joints, as in MuJoCo's `polycoef`."""


@dataclass(frozen=True)
class LinkPoints:
    """L links, parents before children, and K points on them.

    Attributes:
        parent: index of each link's parent; the root is its own.
        fixed: pose of each link in its parent with all joints at zero; the root's is in the palm frame.
        axis: unit axis of each link's hinge, zero without one.
        leader: actuated joint that moves each hinge.
        powers: hinge angle as a polynomial of that joint's, rising powers; zero without a hinge.
        opened: angles of the closing joints of the open hand, rad.
        closes: which joints these are.
        points: points in their links' frames, m.
        link: link of each point.
    """

    parent: Int[np.ndarray, " L"]
    fixed: Float[np.ndarray, "L 4 4"]
    axis: Float[np.ndarray, "L 3"]
    leader: Int[np.ndarray, " L"]
    powers: Float[np.ndarray, "L 5"]
    opened: Float[np.ndarray, " J"]
    closes: Bool[np.ndarray, " J"]
    points: Float[np.ndarray, "K 3"]
    link: Int[np.ndarray, " K"]


def link_points(hand: Hand, per_link: int = POINTS_PER_LINK) -> LinkPoints:
    """Points on the surface of every link that moves, as far from each other as can be.

    Args:
        hand: the hand.
        per_link: number of points on each.
    """
    bodies = hand.tree.bodies
    followed = {c.follower: (c.leader, c.coefficients) for c in hand.tree.couplings}
    leader, powers = np.zeros(len(bodies), dtype=int), np.zeros((len(bodies), DEGREE + 1))
    moves = np.zeros(len(bodies), dtype=bool)
    for i, body in enumerate(bodies):
        moves[i] = body.parent >= 0 and moves[body.parent]
        if body.joint is not None:
            moves[i] = True
            name, coefficients = followed.get(body.joint.name, (body.joint.name, (0.0, 1.0)))
            leader[i] = hand.joint_names.index(name)
            powers[i, : len(coefficients)] = coefficients
    fixed = np.stack([body.T_parent_body for body in bodies])
    fixed[0] = invert(hand.T_root_palm) @ fixed[0]
    links = [i for i, shape in enumerate(hand.body_shapes) if moves[i] and len(shape.vertices)]
    return LinkPoints(
        parent=np.array([max(body.parent, 0) for body in bodies]),
        fixed=fixed,
        axis=np.stack([np.zeros(3) if body.joint is None else body.joint.axis for body in bodies]),
        leader=leader,
        powers=powers,
        opened=np.where(hand.closing.moves > 0, hand.lower, 0.0),
        closes=hand.closing.moves > 0,
        points=np.concatenate([_spread(hand.body_shapes[i], per_link) for i in links]),
        link=np.repeat(links, per_link),
    )


def _spread(shape: trimesh.Trimesh, count: int) -> Float[np.ndarray, "count 3"]:
    """Points of a surface, the first the farthest from the link's joint, each next far from those before."""
    # Here, since every use of networks imports this module, and trimesh takes half a second.
    import trimesh

    points = trimesh.sample.sample_surface(shape, CANDIDATES, seed=1)[0]
    chosen = [int(np.linalg.norm(points, axis=1).argmax())]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < count:
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(nearest.argmax()))
    return points[chosen]
