"""Blind controls: what they see, where the hand comes to stand, and that they hold easy objects."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffhnet.geometry.rotations import about_z, geodesic_angle
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.sampling.blind import BLIND, blind_random_yaw, blind_short_side, footprint
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial


@pytest.fixture(scope="module")
def hand():
    return load_hand()


def block(sides=(0.04, 0.10), height=0.12, seed=0):
    """Points of a block on the table, in the world frame."""
    rng = np.random.default_rng(seed)
    x, y = sides
    return rng.uniform([-x / 2, -y / 2, 0], [x / 2, y / 2, height], (4000, 3))


@given(st.floats(-np.pi, np.pi), st.floats(-0.3, 0.3), st.floats(0.02, 0.08), st.floats(1.3, 3))
@settings(max_examples=30, deadline=None)
def test_footprint_of_a_turned_block(yaw, shift, short, ratio):
    cloud = block((short, ratio * short)) @ about_z(yaw).T + [shift, -shift, 0]
    seen = footprint(cloud)
    np.testing.assert_allclose(seen.centre, [shift, -shift], atol=0.003)
    np.testing.assert_allclose(seen.sides, [short, ratio * short], rtol=0.08)
    off = (seen.short_yaw - yaw + np.pi / 2) % np.pi - np.pi / 2
    assert abs(off) < np.radians(3)


def test_short_side_is_grasped_across_and_the_palm_turns_with_the_cloud(hand):
    grasps = blind_short_side(block(), hand, 40, np.random.default_rng(0))
    across = grasps.rotation[:, :2, 2] / np.linalg.norm(grasps.rotation[:, :2, 2], axis=1)[:, None]
    assert (np.abs(across[:, 0]) > 0.99).all()
    assert 5 < (across[:, 0] > 0).sum() < 35
    yaw = about_z(0.6)
    turned = blind_short_side(block() @ yaw.T, hand, 40, np.random.default_rng(0))
    assert geodesic_angle(turned.rotation, yaw @ grasps.rotation).max() < np.radians(4)


def test_random_yaw_goes_all_ways(hand):
    grasps = blind_random_yaw(block(), hand, 200, np.random.default_rng(0))
    yaw = np.arctan2(grasps.rotation[:, 1, 2], grasps.rotation[:, 0, 2])
    assert np.histogram(yaw, 4, (-np.pi, np.pi))[0].min() > 30


@pytest.mark.parametrize("height", [0.03, 0.08, 0.2])
def test_open_hand_is_clear_of_cloud_and_table(hand, height):
    """Measured on the hand's mesh, which the sampler only sees as cells."""
    cloud = block(height=height)
    for grasps in (
        blind_short_side(cloud, hand, 2, np.random.default_rng(1)),
        blind_random_yaw(cloud, hand, 4, np.random.default_rng(1)),
    ):
        for i in range(len(grasps)):
            T_world_palm = make_transform(grasps.rotation[i], grasps.position[i])
            shape = hand.shape(hand.open(grasps.joints[i]))
            assert apply(T_world_palm, shape.vertices)[:, 2].min() > BLIND.clearance - 1e-6
            parts = shape.split(only_watertight=False)
            near = apply(invert(T_world_palm), cloud)
            assert not any(part.convex_hull.contains(near).any() for part in parts)


def test_the_hand_comes_as_low_over_tall_objects(hand):
    low, high = (
        blind_short_side(block(height=h), hand, 1, np.random.default_rng(1)).position[0, 2]
        for h in (0.15, 0.20)
    )
    assert high - low == pytest.approx(0.05, abs=0.002)


def test_a_blind_grasp_lifts_an_easy_object(hand):
    obj = resolve_objects("thin_box_2000008")[0].load()
    T = obj.resting_poses[0]
    points, _ = obj.visual.sample(4000, return_index=True, seed=0)
    grasps = blind_short_side(apply(T, points), hand, 3, np.random.default_rng(0))
    assert GraspTrial(build_scene(hand, obj)).run(grasps, T).success.any()
