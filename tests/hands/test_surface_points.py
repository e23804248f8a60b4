"""Points on the hand lie on its surface, spread out, the same every time."""

import numpy as np
import trimesh

from ffhnet.hands import load_hand
from ffhnet.hands.surface_points import CLOSURES, surface_points


def test_points_lie_on_the_hand_at_one_of_the_closures():
    hand = load_hand()
    points = surface_points(hand, 60)
    closing = hand.closing.moves > 0
    distances = []
    for closure in CLOSURES:
        joints = np.where(closing, hand.lower + closure * (hand.upper - hand.lower), hand.eigengrasp_origin)
        distances.append(trimesh.proximity.closest_point_naive(hand.shape(joints), points)[1])
    assert np.min(distances, axis=0).max() < 1e-4


def test_points_are_spread_and_more_points_begin_with_the_same_ones():
    hand = load_hand()
    many, few = surface_points(hand, 96), surface_points(hand, 40)
    np.testing.assert_array_equal(many[:40], few)
    gaps = np.linalg.norm(many[:, None] - many[None], axis=-1) + np.eye(96)
    assert gaps.min() > 0.012
    # They reach from the wrist's end of the palm to the fingertips, and to both sides.
    assert (np.ptp(many, axis=0) > 0.1).all()
