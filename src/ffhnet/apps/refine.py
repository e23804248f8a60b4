"""`ffhnet refine`: a generator that keeps to the grasps which the evaluator believes in."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ffhnet.apps.console import absent
from ffhnet.apps.extras import require_sim
from ffhnet.apps.trained_flow import check_size, load_flow
from ffhnet.errors import OptionError


@dataclass(frozen=True)
class RefineOptions:
    """Teach a generator by its own samples, as the evaluator rates them; a run that was stopped goes on.

    The evaluator stays as it is. The result can be refined again.
    """

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets that the weights were trained on."""
    weights: Path
    """Trained weights with a flow as generator."""
    out: Path
    """Folder of the new weights."""
    val: Annotated[Path | None, absent("DIR")] = None
    """Data set of held-out objects to measure on."""
    belief: Annotated[float | None, absent("X", "the preset's")] = None
    """Grasps count as the evaluator's belief in them to this power."""
    temperature: Annotated[float | None, absent("SD", "as it was")] = None
    """Standard deviation of the noise from which the new weights sample: what is surer may vary more."""
    solver: Annotated[Literal["euler", "adams"] | None, absent("NAME", "as it was")] = None
    """How the new weights go from noise to grasps."""
    steps: Annotated[int | None, absent("N", "the preset's")] = None
    """Optimiser steps."""
    seed: int = 0
    """Seed of noise and batches."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to compute; auto takes a GPU where there is one."""


def run(options: RefineOptions) -> None:
    """Refine the generator, and write both networks."""
    require_sim("refine")
    import dataclasses

    import torch

    from ffhnet.dataset.records import read_training_data
    from ffhnet.model.checkpoint import save_checkpoint
    from ffhnet.training import TrainingConfig, refine_generator
    from ffhnet.training.processes import joined

    check_size(options.threads, options.steps)
    if options.belief is not None and not 0 <= options.belief < float("inf"):
        raise OptionError(f"--belief is a power of at least 0, got {options.belief}")
    torch.set_num_threads(options.threads)
    trained, flow = load_flow(options.weights)
    info = trained.info
    if options.out.resolve() == options.weights.resolve():
        raise OptionError("--out must be another folder than --weights")
    preset = TrainingConfig.refinement(info.model)
    model = info.model
    if options.temperature is not None:
        model = dataclasses.replace(model, temperature=options.temperature)
    if options.solver is not None:
        model = dataclasses.replace(model, flow_solver=options.solver)
    config = dataclasses.replace(
        preset,
        model=model,
        steps=options.steps or preset.steps,
        belief=preset.belief if options.belief is None else options.belief,
        seed=options.seed,
    )
    data = read_training_data(list(options.data))
    val = None if options.val is None else read_training_data([options.val])
    limits = (info.joint_lower, info.joint_upper)
    with joined(options.device) as processes:
        refine_generator(data, val, config, options.out, limits, flow, trained.evaluator, processes=processes)
        if processes.first:
            judge = {name: run for name, run in info.training.items() if name == "evaluator"}
            described = dataclasses.replace(info, model=model, training=judge)
            save_checkpoint(options.out, described, evaluator=trained.evaluator.cpu(), half=True)
