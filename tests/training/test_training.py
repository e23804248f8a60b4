"""Both networks learn a small world, and a killed run resumes to the same weights."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from training_world import killed

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError, OptionError, WeightsError
from ffhnet.model import load_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.losses import JOINTS_WEIGHT, KL_WEIGHT
from ffhnet.training import LookPoints, TrainingConfig, train_evaluator, train_generator
from ffhnet.training import loop as loop_module
from ffhnet.training.batches import BatchMaker
from ffhnet.training.tasks import EvaluatorTask, FlowTask, GeneratorTask

MakeWorld = Callable[..., TrainingData]
Limits = tuple[tuple[float, ...], tuple[float, ...]]


@pytest.fixture
def short(model: ModelConfig) -> TrainingConfig:
    return TrainingConfig(model=model, steps=60, views=6, grasps=5, metrics_every=25, state_every=30)


def last_metrics(folder: Path, name: str) -> dict[str, float]:
    return json.loads((folder / "config.json").read_text())["training"][name]["held_out"]


def test_evaluator_learns_the_small_world(
    tmp_path: Path, make_world: MakeWorld, model: ModelConfig, joint_limits: Limits
):
    config = TrainingConfig(model=model, steps=300, views=32, grasps=32)
    train_evaluator(make_world(0, objects=150), make_world(1), config, tmp_path, joint_limits, progress=False)
    metrics = last_metrics(tmp_path, "evaluator")
    assert metrics["auroc"] > 0.93
    assert metrics["ece"] < 0.1
    rows = [json.loads(line) for line in (tmp_path / "evaluator_log.jsonl").read_text().splitlines()]
    assert rows[-1]["loss"] < 0.6 * rows[0]["loss"]
    assert [row["step"] for row in rows if "auroc" in row] == [200]


def test_generator_learns_the_small_world(
    tmp_path: Path, make_world: MakeWorld, model: ModelConfig, joint_limits: Limits
):
    # The paper's weights: in this world joints say nothing of the pose and have to be learned for themselves.
    config = TrainingConfig(
        model=model, steps=300, views=32, grasps=32, kl_weight=KL_WEIGHT, joints_weight=JOINTS_WEIGHT
    )
    data, val = make_world(0, objects=150), make_world(1)
    generator = train_generator(data, val, config, tmp_path, joint_limits, progress=False)
    metrics = last_metrics(tmp_path, "generator")
    assert metrics["rotation_deg"] < 15  # 90 for a network that knows nothing
    assert metrics["joints_rad"] < 0.08  # 0.25 likewise
    assert metrics["position_mm"] < 35
    assert metrics["kl_nats"] > 1
    # Samples from the prior, on objects never seen, lie around the objects' points.
    batch = BatchMaker.for_generator(val).draw(np.random.default_rng(0), views=64, grasps=32)
    latent = torch.randn(64, 50, 5, generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        sampled = generator.decode(batch.objects, latent).position
    own = batch.grasps.position.mean(1, keepdim=True)
    assert (sampled - own).norm(dim=-1).median() < 0.7 * (sampled - own.roll(1, 0)).norm(dim=-1).median()


def test_flow_learns_the_small_world(
    tmp_path: Path, make_world: MakeWorld, model: ModelConfig, joint_limits: Limits
):
    config = TrainingConfig(model=replace(model, generator="flow"), steps=300, views=32, grasps=32)
    data, val = make_world(0, objects=150), make_world(1)
    generator = train_generator(data, val, config, tmp_path, joint_limits, progress=False)
    assert last_metrics(tmp_path, "generator")["velocity_error"] < 1.2  # 2 for a velocity of zero
    batch = BatchMaker.for_generator(val).draw(np.random.default_rng(0), views=64, grasps=32)
    with torch.inference_mode():
        sampled = generator.sample(batch.objects, 50, torch.Generator().manual_seed(0)).position
    own = batch.grasps.position.mean(1, keepdim=True)
    assert (sampled - own).norm(dim=-1).median() < 0.7 * (sampled - own.roll(1, 0)).norm(dim=-1).median()


@pytest.mark.parametrize(
    ("train", "task_kind", "kind"),
    [
        (train_generator, GeneratorTask, "cvae"),
        (train_generator, FlowTask, "flow"),
        (train_evaluator, EvaluatorTask, "flow"),
    ],
)
def test_killed_run_resumes_to_the_same_weights(
    tmp_path: Path,
    make_world: MakeWorld,
    short: TrainingConfig,
    joint_limits: Limits,
    train,
    task_kind,
    kind,
    monkeypatch,
):
    data = make_world(0)
    short = replace(short, model=replace(short.model, generator=kind, palm_points=4))
    train = partial(train, look=LookPoints(np.linspace(-0.05, 0.05, 12).reshape(4, 3)))
    whole = train(data, data, short, tmp_path / "whole", joint_limits, progress=False)

    plain_loss = task_kind.loss
    with killed(task_kind, at=47):
        train(data, data, short, tmp_path / "cut", joint_limits, progress=False)
    first_step = []

    def watched(self, step: int, rng: np.random.Generator):
        first_step.append(step)
        return plain_loss(self, step, rng)

    monkeypatch.setattr(task_kind, "loss", watched)
    resumed = train(data, data, short, tmp_path / "cut", joint_limits, progress=False)
    assert first_step[0] == 30
    for name, tensor in resumed.state_dict().items():
        assert torch.equal(tensor, whole.state_dict()[name]), name
    (log_whole,) = (tmp_path / "whole").glob("*.jsonl")
    (log_cut,) = (tmp_path / "cut").glob("*.jsonl")
    assert log_cut.read_text() == log_whole.read_text()


def test_a_finished_run_is_not_trained_again(
    tmp_path: Path, make_world: MakeWorld, short: TrainingConfig, joint_limits: Limits, monkeypatch
):
    data = make_world(0)
    first = train_evaluator(data, None, short, tmp_path, joint_limits, progress=False)
    monkeypatch.setattr(EvaluatorTask, "loss", None)
    again = train_evaluator(data, None, short, tmp_path, joint_limits, progress=False)
    assert torch.equal(first.head.weight, again.head.weight)


def test_seed_decides_everything(
    tmp_path: Path, make_world: MakeWorld, short: TrainingConfig, joint_limits: Limits
):
    data, weights = make_world(0), []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        torch.manual_seed(len(weights))
        config = replace(short, steps=5, seed=seed)
        trained = train_generator(data, None, config, tmp_path / name, joint_limits, progress=False)
        weights.append(trained.position_head.weight)
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])


def test_training_leaves_the_callers_random_state_alone(
    tmp_path: Path, make_world: MakeWorld, short: TrainingConfig, joint_limits: Limits
):
    torch.manual_seed(3)
    wanted = torch.rand(1)
    torch.manual_seed(3)
    config = replace(short, steps=2)
    train_generator(make_world(0), None, config, tmp_path, joint_limits, progress=False)
    assert torch.equal(torch.rand(1), wanted)


def test_both_networks_make_one_checkpoint(
    tmp_path: Path, make_world: MakeWorld, short: TrainingConfig, joint_limits: Limits
):
    data = make_world(0)
    generator = train_generator(data, None, short, tmp_path, joint_limits, progress=False)
    evaluator = train_evaluator(data, None, short, tmp_path, joint_limits, progress=False)
    loaded = load_checkpoint(tmp_path, hand="point_hand")
    # Matrices are stored in 16 bits, vectors in 32.
    assert torch.equal(loaded.generator.position_head.weight, generator.position_head.weight.half().float())
    assert torch.equal(loaded.generator.position_head.bias, generator.position_head.bias)
    assert torch.equal(loaded.evaluator.head.weight, evaluator.head.weight.half().float())
    assert set(loaded.info.training) == {"generator", "evaluator"}
    assert loaded.generator.condition.projection.abs().sum() > 0


def test_state_of_another_run_is_refused(
    tmp_path: Path, make_world: MakeWorld, short: TrainingConfig, joint_limits: Limits
):
    data = make_world(0)
    train_evaluator(data, None, replace(short, steps=1), tmp_path, joint_limits, progress=False)
    with pytest.raises(WeightsError, match="another configuration"):
        train_evaluator(data, None, replace(short, steps=2), tmp_path, joint_limits, progress=False)
    state = tmp_path / "evaluator_state.safetensors"
    state.write_bytes(state.read_bytes()[:100])
    with pytest.raises(WeightsError, match="damaged"):
        train_evaluator(data, None, replace(short, steps=1), tmp_path, joint_limits, progress=False)


def test_data_must_fit_the_model(tmp_path: Path, make_world: MakeWorld, joint_limits: Limits):
    with pytest.raises(DatasetError, match="15 joints and 4096 BPS values, the data has 3 and 64"):
        train_generator(make_world(0), None, TrainingConfig(), tmp_path, joint_limits, progress=False)


def test_paper_preset_runs_and_follows_section_3d(
    tmp_path: Path, make_world: MakeWorld, model: ModelConfig, joint_limits: Limits
):
    paper = TrainingConfig.paper(num_joints=3)
    assert (paper.optimizer, paper.learning_rate_at(4000), paper.views * paper.grasps) == ("adam", 1e-4, 5012)
    assert [paper.kl_weight_at(step) for step in (0, 299, 301)] == [0, 0, 5e-3]
    small = replace(paper.model, bps_size=64, inner_width=16, width=16)
    config = replace(paper, model=small, steps=3, views=40)
    data = make_world(0)
    train_generator(data, data, config, tmp_path, joint_limits, progress=False)
    train_evaluator(data, data, config, tmp_path, joint_limits, progress=False)


def test_default_schedules():
    config = TrainingConfig(steps=1000)
    rates = [config.learning_rate_at(step) for step in range(1000)]
    assert rates[0] == 1e-3
    assert (np.diff(rates) < 0).all()
    assert rates[-1] < 1e-8
    assert [config.kl_weight_at(s) for s in (0, 35, 70, 999)] == pytest.approx([0, 0.015, 0.03, 0.03])
    with pytest.raises(OptionError, match="kl_full"):
        TrainingConfig(kl_start=0.5, kl_full=0.1)


def test_each_step_has_its_own_random_numbers():
    with loop_module.seeded(0, 1) as rng:
        first = (rng.random(), torch.rand(1).item())
    with loop_module.seeded(0, 2) as rng:
        second = (rng.random(), torch.rand(1).item())
    with loop_module.seeded(0, 1) as rng:
        again = (rng.random(), torch.rand(1).item())
    assert first == again
    assert first[0] != second[0]
    assert first[1] != second[1]
