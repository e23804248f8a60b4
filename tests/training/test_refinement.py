"""A trained flow learns from the grasps, its own and the data's, that the evaluator believes in."""

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from training_world import JOINT_LIMITS, MODEL, killed, point_world

from ffhnet.dataset.training_data import TrainingData
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.training import TrainingConfig, refine_generator, train_evaluator, train_generator
from ffhnet.training.batches import view_tensors
from ffhnet.training.flow_refinement import FlowRefinementTask

MakeWorld = Callable[..., TrainingData]
Limits = tuple[tuple[float, ...], tuple[float, ...]]


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlowGenerator, FFHEvaluator]:
    data, folder = point_world(0, objects=100), tmp_path_factory.mktemp("trained")
    model = replace(MODEL, generator="flow", flow_steps=4)
    config = TrainingConfig(model=model, steps=200, views=32, grasps=32, metrics_every=100, state_every=100)
    generator = train_generator(data, None, config, folder, JOINT_LIMITS, progress=False)
    assert isinstance(generator, FlowGenerator)
    return generator, train_evaluator(data, None, config, folder, JOINT_LIMITS, progress=False)


@pytest.fixture
def config(trained: tuple[FlowGenerator, FFHEvaluator]) -> TrainingConfig:
    refinement = TrainingConfig.refinement(trained[0].config)
    return replace(refinement, steps=150, views=16, grasps=20, metrics_every=50, state_every=30)


def blame(folder: Path) -> float:
    held_out = json.loads((folder / "config.json").read_text())["training"]["generator"]["held_out"]
    return float(held_out["blame"])


def test_refined_samples_are_believed_in_more_and_nothing_else_changes(
    tmp_path: Path,
    make_world: MakeWorld,
    config: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    before = [copy.deepcopy(network.state_dict()) for network in trained]
    data, val = make_world(0, objects=100), make_world(1)
    as_it_was = replace(config, steps=1, learning_rate=0.0)
    for name, run in (("before", as_it_was), ("after", config)):
        refine_generator(data, val, run, tmp_path / name, joint_limits, *trained, progress=False)
    assert blame(tmp_path / "after") < 0.85 * blame(tmp_path / "before")
    for network, old in zip(trained, before, strict=True):
        assert all(torch.equal(old[name], tensor) for name, tensor in network.state_dict().items())


def test_a_killed_refinement_resumes_to_the_same_weights(
    tmp_path: Path,
    make_world: MakeWorld,
    config: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    data, config = make_world(0), replace(config, steps=50)
    whole = refine_generator(data, data, config, tmp_path / "whole", joint_limits, *trained, progress=False)
    with killed(FlowRefinementTask, at=37):
        refine_generator(data, data, config, tmp_path / "cut", joint_limits, *trained, progress=False)
    resumed = refine_generator(data, data, config, tmp_path / "cut", joint_limits, *trained, progress=False)
    assert all(torch.equal(whole.state_dict()[name], tensor) for name, tensor in resumed.state_dict().items())


def test_own_samples_are_drawn_by_belief_to_a_power(
    make_world: MakeWorld,
    config: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    data, (generator, evaluator) = make_world(0), trained
    limits = (torch.tensor(joint_limits[0]), torch.tensor(joint_limits[1]))
    judge = copy.deepcopy(evaluator)
    task = FlowRefinementTask(
        copy.deepcopy(generator), generator, judge, limits, replace(config, belief=2.0), data, None
    )
    task.prepare(progress=False)
    states, doubt = task._samples
    raw = generator.grasps(torch.from_numpy(states[:5]).float())
    with torch.inference_mode():
        said = task._doubt(view_tensors(data, np.arange(5)), raw)
    np.testing.assert_allclose(doubt[:5], said, atol=0.02, rtol=0.02)

    drawn = task._own(np.random.default_rng(0), np.zeros(1, dtype=int), 20000)[0].numpy()
    share = np.array([(np.abs(drawn - state).max(axis=1) < 1e-6).mean() for state in states[0].astype(float)])
    wanted = np.exp(-2.0 * doubt[0].astype(float))
    np.testing.assert_allclose(share, wanted / wanted.sum(), atol=0.02)
    assert share.max() > 1.3 / config.pairs
