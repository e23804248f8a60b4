"""Selection of objects keeps everything that belongs together together."""

import dataclasses

import numpy as np
import pytest

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError

NAMES = ("box", "can", "cup", "jar")


@pytest.fixture
def data() -> TrainingData:
    """Every value carries the number of its object, so that a mix-up shows."""
    rng = np.random.default_rng(0)
    placement_object = np.array([2, 0, 3, 0, 1, 2])
    view_placement = rng.permutation(np.repeat(np.arange(6), 2))
    trial_placement = rng.permutation(np.repeat(np.arange(6), 5))
    view_object, trial_object = placement_object[view_placement], placement_object[trial_placement]
    return TrainingData(
        hand="hand",
        joint_names=("a", "b"),
        closes=np.ones(1, bool),
        object_names=NAMES,
        placement_object=placement_object,
        view_placement=view_placement,
        bps=np.repeat(view_object[:, None], 8, axis=1).astype(np.float16),
        table_height=-view_object.astype(float),
        T_world_view=np.eye(4) * view_object[:, None, None],
        trial_placement=trial_placement,
        rotation=np.eye(3) * trial_object[:, None, None],
        position=np.repeat(trial_object[:, None], 3, axis=1).astype(float),
        joints=np.repeat(trial_object[:, None], 2, axis=1).astype(float),
        closed_joints=np.repeat(trial_object[:, None], 2, axis=1).astype(float),
        margin=np.ones(len(trial_object)),
        label=np.where(np.arange(30) % 2, 1.0, 0.0),
        robust=np.arange(30) / 30,
        executed=np.arange(30) % 2 == 1,
        proposer=trial_object,
    )


@pytest.mark.parametrize("keep", [("jar", "can"), np.array([False, True, False, True])])
def test_selection_keeps_views_and_trials_with_their_object(data: TrainingData, keep):
    part = data.select_objects(keep)
    assert part.object_names == ("can", "jar")
    assert (part.num_placements, part.num_views, part.num_trials) == (2, 4, 10)
    old = np.array([1, 3])
    view_object = old[part.placement_object[part.view_placement]]
    trial_object = old[part.placement_object[part.trial_placement]]
    for views in (part.bps[:, 0], -part.table_height, part.T_world_view[:, 0, 0]):
        np.testing.assert_array_equal(views, view_object)
    for trials in (part.rotation[:, 0, 0], part.position[:, 1], part.joints[:, 1], part.proposer):
        np.testing.assert_array_equal(trials, trial_object)


def test_parts_add_up_to_the_whole(data: TrainingData):
    parts = [data.select_objects([name]) for name in NAMES]
    assert sum(part.num_views for part in parts) == data.num_views
    assert sum(part.num_trials for part in parts) == data.num_trials
    assert sum(int(part.success.sum()) for part in parts) == data.success.sum()


def test_select_trials_keeps_rows_together(data: TrainingData):
    chosen = data.select_trials(data.executed)
    assert chosen.executed.all()
    assert 0 < chosen.num_trials < data.num_trials
    np.testing.assert_array_equal(chosen.position, data.position[data.executed])
    np.testing.assert_array_equal(chosen.trial_placement, data.trial_placement[data.executed])
    assert chosen.num_views == data.num_views


def test_unknown_object(data: TrainingData):
    with pytest.raises(DatasetError, match="not in this data set: mug"):
        data.select_objects(["box", "mug"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": np.zeros((30, 3))}, r"joints must have shape \(30, 2\), got \(30, 3\)"),
        ({"bps": np.zeros((11, 8))}, "bps must have shape"),
        ({"placement_object": np.array([0, 1, 2, 3, 4, 0])}, "placement_object must lie in"),
        ({"view_placement": -np.ones(12, dtype=int)}, "view_placement must lie in"),
        ({"label": np.full(30, 2.0)}, "between 0 and 1"),
        ({"label": np.ones(30)}, "not executed"),
    ],
)
def test_inconsistent_arrays_are_refused(data: TrainingData, change: dict, message: str):
    with pytest.raises(DatasetError, match=message):
        dataclasses.replace(data, **change)


def test_local_success_is_a_weighted_rate_of_the_neighbours():
    """Against a plain double loop; lonely trials fall back on the overall rate."""
    from ffhnet.dataset.robustness import PRIOR_WEIGHT, local_success
    from ffhnet.geometry.rotations import geodesic_angle, matrix_from_euler_xyz

    rng = np.random.default_rng(0)
    count = 40
    rotation = matrix_from_euler_xyz(rng.uniform(-0.4, 0.4, (count, 3)))
    position = rng.uniform(-0.03, 0.03, (count, 3))
    position[0] = 5.0
    success = rng.random(count) < 0.5
    data = TrainingData(
        hand="h",
        joint_names=("a",),
        closes=np.ones(1, bool),
        object_names=("o", "p"),
        placement_object=np.array([0, 1]),
        view_placement=np.array([0]),
        bps=np.zeros((1, 8)),
        table_height=np.zeros(1),
        T_world_view=np.eye(4)[None],
        trial_placement=np.arange(count) % 2,
        rotation=rotation,
        position=position,
        joints=np.zeros((count, 1)),
        closed_joints=np.zeros((count, 1)),
        margin=np.ones(count),
        label=success.astype(float),
        robust=np.full(count, np.nan),
        executed=np.ones(count, bool),
        proposer=np.zeros(count, int),
    )
    rate = local_success(data)
    assert rate[0] == pytest.approx(success.mean())
    for i in (1, 2, 17):
        total, weight = PRIOR_WEIGHT * success.mean(), PRIOR_WEIGHT
        for j in range(count):
            if j != i and j % 2 == i % 2:
                distance = np.linalg.norm(position[i] - position[j]) / 0.02
                angle = geodesic_angle(rotation[i], rotation[j]) / np.radians(20)
                near = np.exp(-(distance**2 + angle**2) / 2)
                total, weight = total + near * success[j], weight + near
        assert rate[i] == pytest.approx(total / weight)
