"""`ffhnet distil`: weights whose generator takes a tenth of the work per sample."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ffhnet.apps.console import absent
from ffhnet.apps.extras import require_sim
from ffhnet.errors import OptionError, WeightsError


@dataclass(frozen=True)
class DistilOptions:
    """Teach a small flow of two steps to end where a trained one ends; a run that was stopped goes on."""

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets, of which only the views are used."""
    weights: Path
    """Trained weights with a flow as generator; their evaluator is taken over as it is."""
    out: Path
    """Folder of the new weights."""
    val: Annotated[Path | None, absent("DIR")] = None
    """Data set of held-out objects to measure on."""
    guidance: float = 0.0
    """Weight of the evaluator's opinion: more samples succeed, but it judges them less well."""
    steps: Annotated[int | None, absent("N", "the preset's")] = None
    """Optimiser steps."""
    seed: int = 0
    """Seed of initial weights, noise and batches."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to compute; auto takes a GPU where there is one."""


def run(options: DistilOptions) -> None:
    """Distil, and write both networks."""
    require_sim("distil")
    import dataclasses

    import torch

    from ffhnet.dataset.records import read_training_data
    from ffhnet.model.checkpoint import load_checkpoint
    from ffhnet.model.flow import FlowGenerator
    from ffhnet.training import TrainingConfig, distill_generator
    from ffhnet.training.processes import joined

    if options.threads < 1 or (options.steps is not None and options.steps < 1) or options.guidance < 0:
        raise OptionError("--threads and --steps must be at least 1, --guidance at least 0")
    torch.set_num_threads(options.threads)
    trained = load_checkpoint(options.weights)
    info = trained.info
    if not isinstance(trained.generator, FlowGenerator):
        raise WeightsError(f"wanted weights with a flow, {options.weights} holds a {info.model.generator}")
    config = dataclasses.replace(TrainingConfig.default("student"), model=info.model.student())
    config = dataclasses.replace(
        config, steps=options.steps or config.steps, guidance=options.guidance, seed=options.seed
    )
    data = read_training_data(list(options.data))
    val = None if options.val is None else read_training_data([options.val])
    limits = (info.joint_lower, info.joint_upper)
    with joined(options.device) as processes:
        distill_generator(
            data, val, config, options.out, limits, trained.generator, trained.evaluator, processes=processes
        )
