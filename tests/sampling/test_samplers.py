"""Joints from eigengrasps, and neighbours of grasps."""

import numpy as np
import pytest

from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.sampling.heuristic import sample_heuristic, sample_joints
from ffhnet.sampling.perturb import PerturbConfig, perturb


@pytest.fixture(scope="module")
def hand():
    return load_hand()


def plate(rng, count=400):
    points = rng.uniform([-0.06, -0.02, 0.1], [0.06, 0.02, 0.1], size=(count, 3))
    return points, np.tile([0.0, 0.0, 1.0], (count, 1))


def test_joints_span_the_eigengrasps(hand):
    joints = sample_joints(hand, 4000, np.random.default_rng(0))
    assert (joints >= hand.lower).all()
    assert (joints <= hand.upper).all()
    directions = np.linalg.lstsq(hand.eigengrasps.T, (joints - hand.eigengrasp_origin).T, rcond=None)
    weights = directions[0]
    assert weights.min() > -1e-3
    assert weights.max() < 1 + 1e-3
    np.testing.assert_allclose(weights.mean(axis=1), 0.5, atol=0.02)


def test_palm_y_follows_the_longer_side(hand):
    rng = np.random.default_rng(1)
    grasps = sample_heuristic(*plate(rng), hand, 500, rng)
    # Roll noise is ±0.7 rad: palm y stays within about 45 degrees of the plate's long axis.
    assert (np.abs(grasps.rotation[:, 0, 1]) > 0.6).all()
    assert (grasps.rotation[:, 2, 0] < -0.6).all()


def test_same_seed_same_grasps(hand):
    cloud = plate(np.random.default_rng(1))
    first = sample_heuristic(*cloud, hand, 50, np.random.default_rng(5))
    again = sample_heuristic(*cloud, hand, 50, np.random.default_rng(5))
    other = sample_heuristic(*cloud, hand, 50, np.random.default_rng(6))
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_array_equal(first.joints, again.joints)
    assert not np.array_equal(first.position, other.position)


def test_perturbed_grasps_are_neighbours(hand):
    rng = np.random.default_rng(2)
    parents = sample_heuristic(*plate(rng), hand, 600, rng)
    closed = np.clip(parents.joints + 0.3, hand.lower, hand.upper)
    config = PerturbConfig(position=0.01, rotation=0.1, joints=0.05)
    children: Grasps = perturb(parents, closed, hand, rng, config)
    shift = np.linalg.norm(children.position - parents.position, axis=1)
    angle = geodesic_angle(children.rotation, parents.rotation)
    assert 0.003 < np.median(shift) < 0.02
    assert 0.03 < np.median(angle) < 0.2
    assert np.abs(children.joints - closed).mean() < 0.05
    assert (children.joints <= hand.upper).all()
    assert (children.joints >= hand.lower).all()
