"""Stress changes the physics in the way it says, and leaves the nominal world behind."""

import dataclasses

import numpy as np
import pytest

from ffhnet.evaluation.protocol import with_density
from ffhnet.evaluation.stress import STRESSES, Groups, try_stressed
from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.sampling.blind import blind_random_yaw, blind_short_side
from ffhnet.simulation.trial import TrialResults


class Recorder:
    """Stands in for a trial: notes the world and the grasps of every run."""

    def __init__(self, hand):
        self.hand, self.world, self.runs = hand, (1.0, None), []

    def vary(self, mass=1.0, friction=None):
        self.world = (mass, friction)

    def run(self, grasps, T_world_object):
        self.runs.append((self.world, grasps))
        n = len(grasps)
        zeros = np.zeros(n)
        outcome = np.arange(n) % 3  # success, collision, missed, ...
        return TrialResults(outcome, zeros, np.zeros((n, 15)), zeros.astype(int), zeros, zeros, zeros)


@pytest.fixture(scope="module")
def groups():
    hand = load_hand()
    rng = np.random.default_rng(0)
    cloud = rng.uniform([-0.02, -0.04, 0], [0.02, 0.04, 0.1], (500, 3))
    many = blind_random_yaw(cloud, hand, 4, rng)
    return Groups(many, many[:2], many[:1], blind_short_side(cloud, hand, 1, rng))


def test_each_stress_makes_its_world_and_no_other(groups):
    trial = Recorder(load_hand())
    conditions = try_stressed(trial, groups, np.eye(4), np.random.default_rng(1))
    worlds = {name: world for name, (world, _) in zip([s.name for s in STRESSES], trial.runs, strict=True)}
    assert worlds == {"friction": (1.0, 0.5), "mass": (2.0, None), "pose": (1.0, None), "all": (2.0, 0.5)}
    assert trial.world == (1.0, None)
    nominal = groups.together
    for stress, (_, grasps) in zip(STRESSES, trial.runs, strict=True):
        np.testing.assert_allclose(
            np.linalg.norm(grasps.position - nominal.position, axis=1), stress.position, atol=1e-12
        )
        angle = geodesic_angle(nominal.rotation, grasps.rotation)
        np.testing.assert_allclose(angle, stress.rotation, atol=1e-6)
    np.testing.assert_array_equal(trial.runs[2][1].position, trial.runs[3][1].position)
    assert [c.name for c in conditions] == [s.name for s in STRESSES]


def test_results_go_back_to_their_groups(groups):
    condition = try_stressed(Recorder(load_hand()), groups, np.eye(4), np.random.default_rng(1))[0]
    assert condition.top.success.tolist() == [True, False, False, True]
    assert condition.top.executed.tolist() == [True, False, True, True]
    assert condition.random.success.tolist() == [False, False]
    assert condition.blind_random_yaw.success.tolist() == [True]
    assert condition.blind_short_side.executed.tolist() == [False]


def test_density_sets_the_mass():
    obj = resolve_objects("procedural-val:1")[0].load()
    light = with_density(obj, 100.0)
    assert light.mass == pytest.approx(100 * sum(piece.volume for piece in obj.pieces))
    assert with_density(obj, None) is obj
    assert dataclasses.replace(light, mass=obj.mass).pieces is obj.pieces
