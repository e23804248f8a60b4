"""`ffhnet distil`: weights whose networks take a thirtieth of the multiplications."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.console import absent
from ffhnet.apps.extras import require_sim
from ffhnet.apps.trained_flow import check_size, load_flow
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    from ffhnet.model.config import ModelConfig
    from ffhnet.training.config import Network, TrainingConfig


@dataclass(frozen=True)
class DistilOptions:
    """Teach small networks what trained ones know; a run that was stopped goes on.

    A flow of two steps learns to end where that of `--weights` ends, an evaluator then to rate its grasps.
    """

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets; their trials teach the evaluator only."""
    weights: Path
    """Trained weights with a flow as generator."""
    out: Path
    """Folder of the new weights."""
    val: Annotated[Path | None, absent("DIR")] = None
    """Data set of held-out objects to measure on."""
    guidance: float = 0.0
    """Weight of the evaluator's opinion: more samples succeed, but it judges them less well."""
    steps: Annotated[int | None, absent("N", "the preset's")] = None
    """Optimiser steps of each network."""
    seed: int = 0
    """Seed of initial weights, noise and batches."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to compute; auto takes a GPU where there is one."""


def run(options: DistilOptions) -> None:
    """Distil both networks, and write them."""
    require_sim("distil")
    import torch

    from ffhnet.dataset.records import read_training_data
    from ffhnet.training import distill_evaluator, distill_generator
    from ffhnet.training.processes import joined

    check_size(options.threads, options.steps)
    if options.guidance < 0:
        raise OptionError(f"wanted --guidance at least 0, got {options.guidance}")
    torch.set_num_threads(options.threads)
    trained, flow = load_flow(options.weights)
    info = trained.info
    first, second = _config(options, "generator", info.model), _config(options, "evaluator", info.model)
    data = read_training_data(list(options.data))
    val = None if options.val is None else read_training_data([options.val])
    limits = (info.joint_lower, info.joint_upper)
    with joined(options.device) as processes:
        student = distill_generator(
            data, val, first, options.out, limits, flow, trained.evaluator, processes=processes
        )
        distill_evaluator(
            data, val, second, options.out, limits, trained.evaluator, student, processes=processes
        )


def _config(options: DistilOptions, network: Network, teacher: ModelConfig) -> TrainingConfig:
    """The preset's run of a network, with what the options change."""
    import dataclasses

    from ffhnet.training import TrainingConfig

    config = TrainingConfig.distillation(network, teacher)
    return dataclasses.replace(
        config, steps=options.steps or config.steps, guidance=options.guidance, seed=options.seed
    )
