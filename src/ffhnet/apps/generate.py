"""`ffhnet generate`: make training data, resumable."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.apps.extras import require_sim
from ffhnet.errors import OptionError


@dataclass(frozen=True)
class GenerateOptions:
    """Try grasps on procedural objects in physics and store them as Parquet files.

    A job that was stopped goes on where it was when the same command is given again.
    """

    out: Annotated[Path, tyro.conf.Positional]
    """Folder of the data set."""
    split: Literal["train", "val", "test"] = "train"
    """Split of procedural objects."""
    count: int = 400
    """Number of objects."""
    first: int = 0
    """Leave out this many objects of the split; for fresh objects in later rounds."""
    seed: int = 0
    """Seed of all randomness, together with the object's own."""
    placements: int = 2
    """Resting poses per object, at most."""
    views: int = 6
    """Simulated views per placement."""
    heuristic: int = 30
    """Executed trials per placement of the paper's sampler."""
    power: int = 30
    """Executed trials per placement of the power-grasp sampler."""
    perturb: int = 50
    """Trials per placement in each of two rounds around successes."""
    weights: Annotated[Path | None, absent("DIR")] = None
    """Weights whose generator proposes grasps too."""
    learned: int = 0
    """Executed trials per placement of that generator."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes."""


def run(options: GenerateOptions) -> None:
    """Generate, then print what the data set holds."""
    require_sim("generate")
    from ffhnet.dataset.generate import generate
    from ffhnet.dataset.object_trials import GenerateConfig
    from ffhnet.dataset.statistics import summarise
    from ffhnet.objects.catalogue import resolve_objects

    if options.count < 1 or options.first < 0 or options.workers < 1:
        raise OptionError("--count and --workers must be at least 1, --first at least 0")
    if (options.weights is None) != (options.learned == 0):
        raise OptionError("--weights and --learned go together: give both, or neither")
    config = GenerateConfig(
        seed=options.seed,
        placements=options.placements,
        views=options.views,
        heuristic=options.heuristic,
        power=options.power,
        perturb=options.perturb,
        learned=options.learned,
        weights=None if options.weights is None else str(options.weights),
    )
    sources = resolve_objects(f"procedural-{options.split}:{options.first + options.count}")[options.first :]
    with progress_bar("objects", len(sources)) as step:
        generate(sources, options.out, config, options.workers, lambda _: step())
    summary = summarise(options.out)
    print_table(summary.title, summary.columns, summary.rows)
