"""Objects drawn at random from all over each split, checked for what data generation takes for granted."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ffhnet.geometry.transforms import apply
from ffhnet.objects.graspability import find_grips, why_not_graspable
from ffhnet.objects.inertia import inertia
from ffhnet.objects.packages import MIN_THICKNESS
from ffhnet.objects.procedural import FIRST_SEED, SPLIT_SIZE, make_object

WALLED = ("cup", "bowl")
"""Families with walls of 5 to 8 mm, which are held over their rim."""

EDGED = ("prism", "pot")
"""Families with acute edges or a narrow rim, which are thin only there."""


@pytest.fixture(scope="module")
def drawn():
    rng = np.random.default_rng(11)
    return {
        split: [make_object(first + int(offset)) for offset in rng.choice(SPLIT_SIZE, 40, replace=False)]
        for split, first in FIRST_SEED.items()
        if split.startswith("procedural")
    }


@pytest.fixture(scope="module")
def every(drawn):
    return [obj for objects in drawn.values() for obj in objects]


def test_pieces_are_closed_and_outward(every):
    for obj in every:
        assert all(piece.is_watertight and piece.volume > 0 for piece in obj.pieces), obj.name


def test_nothing_is_thinner_than_the_simulated_fingers_can_hold(every):
    for obj in every[::2]:
        grips = find_grips(obj.pieces, count=800)
        thin = np.percentile(grips.widths, 25 if obj.family in EDGED else 5)
        assert thin > (0.0045 if obj.family in WALLED else MIN_THICKNESS - 1e-6), obj.name


def test_resting_poses_hold_the_centre_of_mass_over_their_support(every):
    for obj in every:
        _, centre, _ = inertia(obj)
        vertices = np.concatenate([piece.vertices for piece in obj.pieces])
        for name, pose in zip(obj.pose_names, obj.resting_poses, strict=True):
            placed = apply(pose, vertices)
            support = ConvexHull(placed[placed[:, 2] < 1e-5, :2])
            x, y, _ = apply(pose, centre)
            assert (support.equations @ [x, y, 1.0]).max() < -1e-6, f"{obj.name} {name}"


def test_the_hand_can_grasp_every_object(every):
    assert {obj.name: why_not_graspable(obj) for obj in every if why_not_graspable(obj)} == {}


def test_no_object_is_in_two_splits_or_twice_in_one(every):
    assert len({obj.name for obj in every}) == len(every)
    shapes = np.array(
        [[*obj.visual.extents, inertia(obj).centre[2], obj.visual.volume ** (1 / 3)] for obj in every]
    )
    apart = np.abs(shapes[:, None] - shapes).max(axis=2) + np.eye(len(shapes))
    assert apart.min() > 1e-6, "two objects have the same size, centre of mass and volume"
