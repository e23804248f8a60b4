"""Scores against evaluators whose answers are known."""

import dataclasses

import numpy as np
import pytest
import torch

from ffhnet.dataset.scoring import score
from ffhnet.dataset.training_data import TrainingData
from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import make_transform
from ffhnet.model.evaluator import EvaluatorLogits

COUNT = 60


@pytest.fixture
def data():
    rng = np.random.default_rng(0)
    position = rng.uniform(-0.1, 0.1, (COUNT, 3))
    executed = rng.random(COUNT) < 0.8
    return TrainingData(
        hand="h",
        joint_names=("a",),
        closes=np.ones(1, bool),
        object_names=("o", "p"),
        placement_object=np.array([0, 1]),
        view_placement=np.array([0, 0, 1]),
        bps=np.zeros((3, 8)),
        table_height=-np.ones(3),
        T_world_view=np.stack([make_transform(about_z(k), np.array([0.1, 0.2, 0.3])) for k in range(3)]),
        trial_placement=np.arange(COUNT) % 2,
        rotation=np.tile(np.eye(3), (COUNT, 1, 1)),
        position=position,
        joints=np.zeros((COUNT, 1)),
        closed_joints=np.zeros((COUNT, 1)),
        margin=np.ones(COUNT),
        label=((position[:, 2] > 0) & executed).astype(float),
        robust=np.full(COUNT, np.nan),
        executed=executed,
        proposer=np.zeros(COUNT, int),
    )


def by_height(objects, grasps):
    """The world's z of the palm as a logit: z of the view frame lies 0.3 m above the world's origin."""
    return EvaluatorLogits(100 * (grasps.position[..., 2] + 0.3))


def test_a_perfect_evaluator(data):
    scores = score(data, by_height)
    assert scores.auroc_executed == 1.0
    assert scores.auroc_all < 1.0
    assert (scores.executed, scores.collisions) == (data.executed.sum(), (~data.executed).sum())
    assert scores.successes == data.success.sum()


def test_chance_and_calibration(data):
    scores = score(data, lambda objects, grasps: EvaluatorLogits(torch.zeros(grasps.position.shape[:2])))
    assert scores.auroc_executed == 0.5
    rate = data.label[data.executed].mean()
    assert scores.ece_executed == pytest.approx(abs(0.5 - rate), abs=0.05)
    with pytest.raises(AttributeError):
        dataclasses.replace(scores).executed = 3
