"""A flow of two steps learns from one of many, and a small evaluator what a large one says of its grasps."""

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
from ffhnet.errors import OptionError
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import EvaluatorLogits, FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors
from ffhnet.training import (
    TrainingConfig,
    distill_evaluator,
    distill_generator,
    train_evaluator,
    train_generator,
)
from ffhnet.training.batches import view_tensors
from ffhnet.training.evaluator_distillation import EvaluatorDistillationTask
from ffhnet.training.flow_distillation import FlowDistillationTask

MakeWorld = Callable[..., TrainingData]
Limits = tuple[tuple[float, ...], tuple[float, ...]]


@pytest.fixture(scope="module")
def run() -> TrainingConfig:
    return TrainingConfig(steps=200, views=16, grasps=16, pairs=16, metrics_every=100, state_every=60)


@pytest.fixture(scope="module")
def trained(
    tmp_path_factory: pytest.TempPathFactory, run: TrainingConfig
) -> tuple[FlowGenerator, FFHEvaluator]:
    data, folder = point_world(0, objects=100), tmp_path_factory.mktemp("teacher")
    config = replace(
        run, views=32, grasps=32, steps=300, model=replace(MODEL, generator="flow", flow_steps=8)
    )
    teacher = train_generator(data, None, config, folder, JOINT_LIMITS, progress=False)
    assert isinstance(teacher, FlowGenerator)
    return teacher, train_evaluator(data, None, config, folder, JOINT_LIMITS, progress=False)


@pytest.fixture
def student(model: ModelConfig, run: TrainingConfig) -> TrainingConfig:
    return replace(run, model=replace(model, generator="flow", flow_steps=2, flow_width=48))


def test_guidance_makes_grasps_that_the_evaluator_believes_in(
    tmp_path: Path,
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    teacher, evaluator = trained
    before = [copy.deepcopy(network.state_dict()) for network in trained]
    data, val = make_world(0, objects=100), make_world(1)
    blame = {}
    for guidance in (0.0, 0.5):
        out = tmp_path / str(guidance)
        config = replace(student, guidance=guidance)
        module = distill_generator(data, val, config, out, joint_limits, *trained, progress=False)
        blame[guidance] = json.loads((out / "config.json").read_text())["training"]["generator"]["held_out"][
            "blame"
        ]
        rows = [json.loads(line) for line in (out / "generator_log.jsonl").open()]
        distance = [row["distance"] for row in rows if "distance" in row]
        guided = ["blame" in row for row in rows if "loss" in row][::6]
        if guidance == 0:
            assert distance[-1] < 0.3 * distance[0]
            assert guided == [False] * 4
        else:
            assert guided == [False, True, True, True]
    assert blame[0.5] < 0.8 * blame[0.0]
    assert module.config.flow_steps == 2
    for network, old in zip((teacher, evaluator), before, strict=True):
        assert all(torch.equal(old[name], tensor) for name, tensor in network.state_dict().items())
        assert all(parameter.requires_grad for parameter in network.parameters())


def test_a_killed_distillation_resumes_to_the_same_weights(
    tmp_path: Path,
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    data, config = make_world(0), replace(student, steps=90)
    whole = distill_generator(data, data, config, tmp_path / "whole", joint_limits, *trained, progress=False)
    with killed(FlowDistillationTask, at=77):
        distill_generator(data, data, config, tmp_path / "cut", joint_limits, *trained, progress=False)
    resumed = distill_generator(data, data, config, tmp_path / "cut", joint_limits, *trained, progress=False)
    assert all(torch.equal(whole.state_dict()[name], tensor) for name, tensor in resumed.state_dict().items())


def test_a_teacher_must_pass_the_times_of_its_student(
    tmp_path: Path,
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    odd = replace(student, model=replace(student.model, flow_steps=3))
    with pytest.raises(OptionError, match="8 steps cannot teach 3"):
        distill_generator(make_world(0), None, odd, tmp_path, joint_limits, *trained, progress=False)


def test_paths_to_failures_count_less(
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    teacher, evaluator = trained
    module = FlowGenerator(student.model)
    module.take_constants(teacher)
    lower, upper = (torch.tensor(limit) for limit in joint_limits)
    task = FlowDistillationTask(
        module, teacher, copy.deepcopy(evaluator), (lower, upper), student, make_world(0), None
    )
    task.prepare(progress=False)
    states, belief = task._paths
    views, ends = np.arange(20), torch.from_numpy(states[:20, -1]).float()
    raw = teacher.grasps(ends)
    grasps = GraspTensors(raw.rotation, raw.position, raw.joints.clamp(lower, upper))
    with torch.inference_mode():
        said = evaluator(view_tensors(make_world(0), views), grasps)
    assert said.robust is not None
    np.testing.assert_allclose(
        belief[:20], (said.success.sigmoid() * said.robust.sigmoid()).sqrt(), atol=0.02
    )
    assert belief.std() > 0.05
    before, _ = task.loss(0, np.random.default_rng(0))
    states[:, 1:][np.broadcast_to((belief < 0.01)[:, None], states[:, 1:].shape[:3])] += 100
    belief[belief < 0.01] = 0
    after, _ = task.loss(0, np.random.default_rng(0))
    torch.testing.assert_close(after, before, rtol=0.05, atol=0)


def test_a_small_evaluator_says_what_the_large_one_says(
    tmp_path: Path,
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    teacher, evaluator = trained
    before = copy.deepcopy(evaluator.state_dict())
    data, val = make_world(0, objects=100), make_world(1)
    off = {}
    for steps in (1, 200):
        config = replace(student, steps=steps, model=replace(student.model, width=32, dropout=0.0))
        out = tmp_path / str(steps)
        module = distill_evaluator(data, val, config, out, joint_limits, evaluator, teacher, progress=False)
        held_out = json.loads((out / "config.json").read_text())["training"]["evaluator"]["held_out"]
        off[steps] = held_out["off_teacher"]
    assert off[200] < 0.5 * off[1]
    assert held_out["auroc"] > 0.75
    assert module.head.in_features == 32
    assert torch.equal(module.condition.projection, evaluator.condition.projection)
    assert all(torch.equal(before[name], tensor) for name, tensor in evaluator.state_dict().items())


def test_half_of_a_batch_is_rated_by_the_teacher(
    make_world: MakeWorld,
    student: TrainingConfig,
    joint_limits: Limits,
    trained: tuple[FlowGenerator, FFHEvaluator],
):
    teacher, evaluator = trained
    lower, upper = (torch.tensor(limit) for limit in joint_limits)
    seen = []

    class Listener(FFHEvaluator):
        def forward(self, objects: ObjectTensors, grasps: GraspTensors) -> EvaluatorLogits:
            seen.append(grasps)
            return super().forward(objects, grasps)

    config = replace(student, grasps=7)
    task = EvaluatorDistillationTask(
        Listener(config.model), evaluator, teacher, (lower, upper), config, make_world(0), None
    )
    task.prepare(progress=False)
    task.loss(0, np.random.default_rng(0))
    (grasps,) = seen
    # The third joint of a trial is its number, in units that no generator meets so exactly.
    is_trial = (grasps.joints[..., 2] * 3600 - (grasps.joints[..., 2] * 3600).round()).abs() < 1e-2
    assert is_trial[:, :4].all()
    assert is_trial[:, 4:].float().mean() < 0.2
    with pytest.raises(OptionError, match="2 grasps per view or more"):
        EvaluatorDistillationTask(
            Listener(config.model),
            evaluator,
            teacher,
            (lower, upper),
            replace(config, grasps=1),
            make_world(0),
            None,
        )
