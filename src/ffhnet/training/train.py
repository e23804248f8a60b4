"""Training one network from data to a checkpoint folder."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from jaxtyping import Float

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError, OptionError
from ffhnet.hands.link_points import LinkPoints
from ffhnet.model.checkpoint import CheckpointInfo, Generator, save_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.pca import fit_projection
from ffhnet.training.batches import BatchMaker
from ffhnet.training.config import TrainingConfig
from ffhnet.training.evaluator_distillation import EvaluatorDistillationTask
from ffhnet.training.flow_distillation import FlowDistillationTask
from ffhnet.training.flow_refinement import FlowRefinementTask
from ffhnet.training.loop import fit, seeded
from ffhnet.training.processes import ALONE, Processes
from ffhnet.training.tasks import EvaluatorTask, FlowTask, GeneratorTask, Task

Network = TypeVar("Network", FFHGenerator, FlowGenerator, FFHEvaluator)

STATISTICS_VIEWS, STATISTICS_GRASPS = 256, 32
"""Size of the batch from which a flow takes mean and deviation of its state."""


@dataclass(frozen=True)
class LookPoints:
    """Where around the hand networks look.

    Attributes:
        palm: points fixed to the palm, m, palm frame.
        links: points on the hand's links, for models that look there.
    """

    palm: Float[np.ndarray, "K 3"]
    links: LinkPoints | None = None


def train_generator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    look: LookPoints | None = None,
    progress: bool = True,
    processes: Processes = ALONE,
) -> Generator:
    """Train the generator of `config.model` on the successes in `data` and write it to `out_dir`.

    Args:
        data: training views and trials.
        val: held-out objects for metrics, or None.
        config: architecture and run.
        out_dir: gets the checkpoint, a log and a state file; an interrupted run goes on from the latter.
        joint_limits: lower and upper limits in radians, in the order of `data.joint_names`.
        look: where around the hand the networks look, for models that do.
        progress: show a progress bar.
        processes: those that train this network together, and where; each calls this with the same
            arguments, draws its part of the batch, and gets the same network. Process 0 writes.

    Raises:
        DatasetError: nothing to train on, or data of another hand or with other sizes than the model's.
        WeightsError: `out_dir` holds a run with another configuration.
    """
    _check_data(data, config.model)
    part = dataclasses.replace(config, views=processes.share(config.views))
    task: Task
    module: Generator
    if config.model.generator == "flow":
        module = initial_network(FlowGenerator, data, config, look).to(processes.device)
        task = FlowTask(module, part, data, val)
    else:
        module = initial_network(FFHGenerator, data, config, look).to(processes.device)
        task = GeneratorTask(module, part, data, val)
    _fit_and_write(task, module, data, config, out_dir, joint_limits, progress, processes)
    return module


def distill_generator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    teacher: FlowGenerator,
    evaluator: FFHEvaluator,
    progress: bool = True,
    processes: Processes = ALONE,
) -> FlowGenerator:
    """Distil the flow of `config.model` from a larger one (`flow_distillation.py`), and write it.

    Args:
        data: views to learn on.
        val: held-out views for metrics, or None.
        config: architecture and run.
        out_dir: as for `train_generator`.
        joint_limits: lower and upper limits in radians.
        teacher: a trained flow, which gives projection, statistics and palm points; it is not changed.
        evaluator: trained; it guides, and is not changed either.
        progress: show a progress bar.
        processes: as for `train_generator`.

    Raises:
        OptionError: the teacher does not pass the times of its student.
    """
    _check_data(data, config.model)
    steps, taught = config.model.flow_steps, teacher.config.flow_steps
    if taught % steps:
        raise OptionError(f"a teacher of {taught} steps cannot teach {steps}: wanted a multiple")
    with seeded(config.seed):
        module = FlowGenerator(config.model).to(processes.device)
    module.take_constants(teacher)
    part = dataclasses.replace(config, views=processes.share(config.views))
    lower, upper = (torch.tensor(limit, dtype=torch.float32) for limit in joint_limits)
    judge = copy.deepcopy(evaluator)
    task = FlowDistillationTask(module, teacher, judge, (lower, upper), part, data, val)
    _fit_and_write(task, module, data, config, out_dir, joint_limits, progress, processes)
    return module


def refine_generator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    trained: FlowGenerator,
    evaluator: FFHEvaluator,
    progress: bool = True,
    processes: Processes = ALONE,
) -> FlowGenerator:
    """Go on with a trained flow, by what the evaluator says of its samples (`flow_refinement.py`); write it.

    Args:
        data: views and trials to learn on.
        val: held-out views for metrics, or None.
        config: the run, with the flow's own architecture; the temperature may be another.
        out_dir: as for `train_generator`.
        joint_limits: lower and upper limits in radians.
        trained: the flow to begin with; it is not changed.
        evaluator: trained; it is not changed either.
        progress: show a progress bar.
        processes: as for `train_generator`.
    """
    _check_data(data, config.model)
    module = FlowGenerator(config.model).to(processes.device)
    module.load_state_dict(trained.state_dict())
    part = dataclasses.replace(config, views=processes.share(config.views))
    lower, upper = (torch.tensor(limit, dtype=torch.float32) for limit in joint_limits)
    judge = copy.deepcopy(evaluator)
    task = FlowRefinementTask(module, trained, judge, (lower, upper), part, data, val)
    _fit_and_write(task, module, data, config, out_dir, joint_limits, progress, processes)
    return module


def distill_evaluator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    teacher: FFHEvaluator,
    generator: FlowGenerator,
    progress: bool = True,
    processes: Processes = ALONE,
) -> FFHEvaluator:
    """Distil the evaluator of `config.model` from a larger one (`evaluator_distillation.py`), and write it.

    Args:
        data: views and trials to learn on.
        val: held-out objects for metrics, or None.
        config: architecture and run.
        out_dir: as for `train_generator`.
        joint_limits: lower and upper limits in radians.
        teacher: a trained evaluator, which gives projection and palm points; it is not changed.
        generator: the flow whose grasps the student will rate.
        progress: show a progress bar.
        processes: as for `train_generator`.
    """
    _check_data(data, config.model)
    with seeded(config.seed):
        module = FFHEvaluator(config.model).to(processes.device)
    module.take_constants(teacher)
    part = dataclasses.replace(config, views=processes.share(config.views))
    lower, upper = (torch.tensor(limit, dtype=torch.float32) for limit in joint_limits)
    task = EvaluatorDistillationTask(module, teacher, generator, (lower, upper), part, data, val)
    _fit_and_write(task, module, data, config, out_dir, joint_limits, progress, processes)
    return module


def train_evaluator(
    data: TrainingData,
    val: TrainingData | None,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    look: LookPoints | None = None,
    progress: bool = True,
    processes: Processes = ALONE,
) -> FFHEvaluator:
    """Train an FFHEvaluator on all trials in `data` and write it to `out_dir`; else as `train_generator`."""
    _check_data(data, config.model)
    module = initial_network(FFHEvaluator, data, config, look).to(processes.device)
    part = dataclasses.replace(config, views=processes.share(config.views))
    task = EvaluatorTask(module, part, data, val)
    _fit_and_write(task, module, data, config, out_dir, joint_limits, progress, processes)
    return module


def initial_network(
    kind: type[Network],
    data: TrainingData,
    config: TrainingConfig,
    look: LookPoints | None,
) -> Network:
    """The network to begin with; what is fixed during training is fitted to the data."""
    with seeded(config.seed):
        module = kind(config.model)
    if config.model.pca_components is not None:
        module.condition.set_projection(fit_projection(data.bps, config.model.pca_components))
    geometry = None if isinstance(module, FFHGenerator) else module.geometry
    if geometry is not None:
        if look is None:
            raise OptionError(
                f"this model looks at {config.model.palm_points} points around the palm, got none"
            )
        geometry.set_points(look.palm[: len(geometry.points)])
        if geometry.links is not None:
            if look.links is None:
                raise OptionError(f"this model looks at {config.model.link_points} points on links, got none")
            geometry.links.take(look.links)
    if isinstance(module, FlowGenerator):
        batches = BatchMaker.for_generator(data, config.min_local_success, config.min_margin)
        rng = np.random.default_rng(config.seed)
        module.set_statistics(batches.draw(rng, STATISTICS_VIEWS, STATISTICS_GRASPS).grasps)
    return module


def _check_data(data: TrainingData, model: ModelConfig) -> None:
    came = (len(data.joint_names), data.bps.shape[1])
    if came != (model.num_joints, model.bps_size):
        raise DatasetError(
            f"the model takes {model.num_joints} joints and {model.bps_size} BPS values, "
            f"the data has {came[0]} and {came[1]}"
        )


def _fit_and_write(
    task: Task,
    module: Generator | FFHEvaluator,
    data: TrainingData,
    config: TrainingConfig,
    out_dir: Path,
    joint_limits: tuple[Sequence[float], Sequence[float]],
    progress: bool,
    processes: Processes,
) -> None:
    """Train `module` by `task`; process 0 writes it beside what `out_dir` already holds."""
    name = "evaluator" if isinstance(module, FFHEvaluator) else "generator"
    metrics = fit(task, config, out_dir, name, progress, processes)
    if not processes.first:
        return
    info = _info(data, config, joint_limits, name, metrics)
    if isinstance(module, FFHEvaluator):
        save_checkpoint(out_dir, info, evaluator=module, half=True)
    else:
        save_checkpoint(out_dir, info, generator=module, half=True)


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
