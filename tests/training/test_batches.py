"""Batches against a plain look-up of every grasp in them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError, OptionError
from ffhnet.geometry.rotations import geodesic_angle, matrix_from_euler_xyz
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.training.batches import Batch, BatchMaker, hard_negatives
from ffhnet.training.config import ClassShares

MakeWorld = Callable[..., TrainingData]


def look_up(data: TrainingData, batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """View (V,) and trial (V, G) of a batch, from the BPS and the third joint."""
    view = [int(np.flatnonzero((data.bps == row).all(axis=1))[0]) for row in batch.objects.bps.numpy()]
    trial = np.rint(batch.grasps.joints[..., 2].numpy() * data.num_trials).astype(int)
    return np.array(view), trial


def test_each_grasp_is_a_trial_of_its_views_placement_in_the_view_frame(make_world: MakeWorld):
    data = make_world(0)
    batch = BatchMaker.for_evaluator(data, ClassShares()).draw(np.random.default_rng(1), views=7, grasps=9)
    view, trial = look_up(data, batch)
    for i in range(7):
        assert batch.objects.table_height[i] == pytest.approx(data.table_height[view[i]])
        for j in range(9):
            t = trial[i, j]
            assert data.trial_placement[t] == data.view_placement[view[i]]
            T_world_palm = make_transform(data.rotation[t], data.position[t])
            T_view_palm = invert(data.T_world_view[view[i]]) @ T_world_palm
            np.testing.assert_allclose(batch.grasps.rotation[i, j], T_view_palm[:3, :3], atol=1e-6)
            np.testing.assert_allclose(batch.grasps.position[i, j], T_view_palm[:3, 3], atol=1e-6)
            np.testing.assert_allclose(batch.grasps.joints[i, j], data.joints[t], atol=1e-6)
            assert batch.label[i, j] == data.label[t]


def test_class_shares_are_exact(make_world: MakeWorld):
    data = make_world(0)
    shares = ClassShares(success=0.3, failure=0.2, collision=0.1, hard_negative=0.4)
    batch = BatchMaker.for_evaluator(data, shares).draw(np.random.default_rng(1), views=20, grasps=25)
    view, trial = look_up(data, batch)
    del view
    label = batch.label.numpy()
    assert (label > 0).sum() == 150
    assert (data.executed[trial] & (data.label[trial] == 0)).sum() == 100
    assert (~data.executed[trial]).sum() == 50
    assert ((label == 0) & (data.label[trial] > 0)).sum() == 200


def test_one_grasp_per_view_keeps_the_shares_over_the_batch(make_world: MakeWorld):
    batch = BatchMaker.for_evaluator(make_world(0), ClassShares(0.3, 0.3, 0.0, 0.4)).draw(
        np.random.default_rng(1), views=50, grasps=1
    )
    assert batch.label.sum() == 15


def test_a_placement_without_a_class_gives_other_trials(make_world: MakeWorld):
    data = make_world(0)
    never = dataclasses.replace(data, label=np.zeros_like(data.label))
    maker = BatchMaker.for_evaluator(never, ClassShares())
    batch = maker.draw(np.random.default_rng(1), views=10, grasps=10)
    view, trial = look_up(data, batch)
    assert (data.trial_placement[trial] == data.view_placement[view][:, None]).all()
    assert batch.label.sum() == 0


def test_natural_shares_follow_the_data(make_world: MakeWorld):
    data = make_world(0)
    batch = BatchMaker.for_evaluator(data, None).draw(np.random.default_rng(1), views=100, grasps=100)
    view, _ = look_up(data, batch)
    rate = np.bincount(data.trial_placement, weights=data.label) / np.bincount(data.trial_placement)
    assert batch.label.mean().item() == pytest.approx(rate[data.view_placement[view]].mean(), abs=0.01)


def test_generator_sees_successes_of_every_placement_that_has_any(make_world: MakeWorld):
    data = make_world(0, objects=6)
    label = np.where(data.trial_placement == 2, 0.0, data.label)
    data = dataclasses.replace(data, label=label)
    batch = BatchMaker.for_generator(data).draw(np.random.default_rng(1), views=100, grasps=4)
    view, trial = look_up(data, batch)
    assert data.success[trial].all()
    assert set(data.view_placement[view]) == {0, 1, 3, 4, 5}


def test_no_success_is_an_error(make_world: MakeWorld):
    data = make_world(0)
    with pytest.raises(DatasetError, match="no view"):
        BatchMaker.for_generator(dataclasses.replace(data, label=np.zeros_like(data.label)))


def test_same_seed_same_batch(make_world: MakeWorld):
    maker = BatchMaker.for_evaluator(make_world(0), ClassShares(0.3, 0.3, 0.0, 0.4))
    draws = [maker.draw(np.random.default_rng(seed), 8, 8).grasps.position.numpy() for seed in (5, 5, 6)]
    assert np.array_equal(draws[0], draws[1])
    assert not np.array_equal(draws[0], draws[2])


def test_hard_negatives_are_moved_by_exactly_the_papers_amounts():
    rng = np.random.default_rng(0)
    rotation = matrix_from_euler_xyz(rng.uniform(-3, 3, (200, 3)))
    position = rng.normal(size=(200, 3))
    turned, moved = hard_negatives(rng, rotation, position)
    np.testing.assert_allclose(np.abs(moved - position), 0.03)
    turn = turned @ np.swapaxes(rotation, -1, -2)
    signs = np.array(np.meshgrid(*[[-0.6, 0.6]] * 3)).reshape(3, -1).T
    distance = geodesic_angle(turn[:, None], matrix_from_euler_xyz(signs)[None])
    assert distance.min(axis=1).max() < 1e-6
    assert len(np.unique(distance.argmin(axis=1))) == 8


def test_shares_must_add_up():
    with pytest.raises(OptionError, match="add up to 1"):
        ClassShares(0.5, 0.5, 0.5)
