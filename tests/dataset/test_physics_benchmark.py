"""The benchmark measures the trials that a data set would hold, and finds labels that differ."""

import numpy as np
import pytest

from ffhnet.dataset import physics_benchmark
from ffhnet.dataset.object_trials import GenerateConfig, try_object
from ffhnet.dataset.physics_benchmark import measure_object
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.simulation.trial import GraspTrial

SMALL = GenerateConfig(
    placements=1, views=1, heuristic=3, power=4, perturb=0, max_collisions=2, repeated_share=0
)
SOURCE = resolve_objects("procedural-test:1")[0]


@pytest.fixture(scope="module")
def measured():
    return measure_object((SOURCE, SMALL))


def test_it_measures_the_trials_of_the_generation_job(measured):
    blocks, _ = try_object(SOURCE.load(), SMALL)
    label = np.concatenate([block.results.success[block.results.executed] for block in blocks])
    np.testing.assert_array_equal(measured.label, label)
    assert measured.collisions == sum(int((~block.results.executed).sum()) for block in blocks)
    assert set(measured.proposer) == {"heuristic", "power"}


def test_speed_is_that_of_real_steps(measured):
    assert measured.steps > 50 * len(measured.label)
    # A trial cannot be faster than its bare steps, nor is it slower by orders of magnitude.
    ratio = measured.seconds / measured.steps / measured.bare_step
    assert 0.8 < ratio < 20


def test_a_reference_that_differs_is_seen(monkeypatch):
    """With a reference whose labels are all turned round, every label counts as flipped."""
    run = GraspTrial.run

    def turned(self, grasps, T_world_object):
        results = run(self, grasps, T_world_object)
        if self._physics.timestep < SMALL.physics.timestep:
            results.outcome[:] = np.where(results.success, 3, 0)
        return results

    monkeypatch.setattr(physics_benchmark.GraspTrial, "run", turned)
    measured = measure_object((SOURCE, SMALL))
    assert (measured.label != measured.fine_label).all()
    assert (measured.label == measured.moved_label).mean() > 0.5
