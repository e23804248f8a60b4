"""Training one network from data to a checkpoint folder."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError
from ffhnet.model.checkpoint import CheckpointInfo, save_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.pca import fit_projection
from ffhnet.training.config import TrainingConfig
from ffhnet.training.loop import fit, seeded
from ffhnet.training.tasks import EvaluatorTask, GeneratorTask

Network = TypeVar("Network", FFHGenerator, FFHEvaluator)


def train_generator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    start: FFHGenerator | None = None,
    device: torch.device | str = "cpu",
    progress: bool = True,
) -> FFHGenerator:
    """Train an FFHGenerator on the successes in `data` and write it to `out_dir`.

    Args:
        data: training views and trials.
        val: held-out objects for metrics, or None.
        config: architecture and run.
        out_dir: gets the checkpoint, a log and a state file; an interrupted run goes on from the latter.
        joint_limits: lower and upper limits in radians, in the order of `data.joint_names`.
        start: network to go on from instead of random weights; it is not changed.
        device: where to train.
        progress: show a progress bar.

    Raises:
        DatasetError: nothing to train on, or data of another hand or with other sizes than the model's.
        WeightsError: `out_dir` holds a run with another configuration.
    """
    _check_data(data, config.model)
    module = _initial(FFHGenerator, data, config, start).to(device)
    metrics = fit(GeneratorTask(module, config, data, val), config, out_dir, "generator", progress)
    info = _info(data, config, joint_limits, "generator", metrics)
    save_checkpoint(out_dir, info, generator=module, half=True)
    return module


def train_evaluator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    start: FFHEvaluator | None = None,
    device: torch.device | str = "cpu",
    progress: bool = True,
) -> FFHEvaluator:
    """Train an FFHEvaluator on all trials in `data` and write it to `out_dir`; else as `train_generator`."""
    _check_data(data, config.model)
    module = _initial(FFHEvaluator, data, config, start).to(device)
    metrics = fit(EvaluatorTask(module, config, data, val), config, out_dir, "evaluator", progress)
    info = _info(data, config, joint_limits, "evaluator", metrics)
    save_checkpoint(out_dir, info, evaluator=module, half=True)
    return module


def _initial(
    kind: type[Network], data: TrainingData, config: TrainingConfig, start: Network | None
) -> Network:
    if start is not None:
        return copy.deepcopy(start)
    with seeded(config.seed):
        module = kind(config.model)
    if config.model.pca_components is not None:
        module.condition.set_projection(fit_projection(data.bps, config.model.pca_components))
    return module


def _check_data(data: TrainingData, model: ModelConfig) -> None:
    came = (len(data.joint_names), data.bps.shape[1])
    if came != (model.num_joints, model.bps_size):
        raise DatasetError(
            f"the model takes {model.num_joints} joints and {model.bps_size} BPS values, "
            f"the data has {came[0]} and {came[1]}"
        )


def _info(
    data: TrainingData,
    config: TrainingConfig,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    name: str,
    metrics: dict[str, float],
) -> CheckpointInfo:
    summary: dict[str, Any] = {
        "objects": len(data.object_names),
        "views": data.num_views,
        "trials": data.num_trials,
        "successes": int(data.success.sum()),
        "steps": config.steps,
        "batch": [config.views, config.grasps],
        "seed": config.seed,
        "held_out": metrics,
    }
    lower, upper = joint_limits
    return CheckpointInfo(
        hand=data.hand,
        joint_names=data.joint_names,
        joint_lower=tuple(float(x) for x in lower),
        joint_upper=tuple(float(x) for x in upper),
        model=config.model,
        training={name: summary},
    )
