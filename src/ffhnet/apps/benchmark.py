"""`ffhnet benchmark`: how fast every stage is here, and how far the labels of trials can be trusted."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.apps.extras import require_sim
from ffhnet.apps.machine import describe_machine
from ffhnet.errors import MissingExtraError, OptionError

if TYPE_CHECKING:
    from ffhnet.dataset.physics_benchmark import ObjectMeasurement

PIECES = ((1, 1), (2, 3), (4, 8), (9, 99))
"""Groups of objects by their number of convex pieces."""


Part = Literal["inference", "perception", "startup", "training", "gpu", "physics"]
PARTS: tuple[Part, ...] = ("startup", "perception", "inference", "gpu", "training", "physics")


@dataclass(frozen=True)
class BenchmarkOptions:
    """Measure how fast every stage is on this machine, and how far the labels of trials can be trusted.

    Times are medians of rounds in which all that is compared runs once. Trials: CPU time of one process, for
    the grasps that `ffhnet generate` would try, start collisions included.
    """

    only: tuple[Part, ...] = PARTS
    """What to measure; physics takes minutes, the rest about one."""
    grasps: int = 400
    """Grasps of an object."""
    rounds: int = 15
    """Rounds that count."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    clock: Literal["wall", "processor"] = "wall"
    """Processor time makes sense of one thread on a busy machine."""
    counts: tuple[int, ...] = (1, 10, 100, 1000, 10_000, 100_000)
    """Numbers of grasps for the curve of time and memory."""
    points: tuple[int, ...] = (500, 2000, 10_000, 50_000)
    """Points of the clouds that are encoded."""
    objects: str = "procedural-val:40"
    """Objects of the trials; see `ffhnet objects list`."""
    first: int = 24
    """Leave out this many of them."""
    workers: int = 1
    """Processes for the trials; more than one disturb each other's timing."""
    weights: Annotated[Path | None, absent("DIR", "the package's own")] = None
    """Weights to measure, and whose generator proposes part of the trials."""
    learned: int = 45
    """Executed trials per placement of that generator, 0 to leave it out."""
    seed: int = 0
    """Seed of views and grasps."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


def run(options: BenchmarkOptions) -> None:
    """Measure and print."""
    from ffhnet.files import check_output, write_atomically

    if options.workers < 1 or options.first < 0 or options.learned < 0:
        raise OptionError("--workers must be at least 1, --first and --learned at least 0")
    if min(options.grasps, options.rounds, options.threads, *options.counts) < 1:
        raise OptionError("--grasps, --rounds, --threads and --counts must be at least 1")
    if options.json is not None:
        check_output(options.json, (".json",))
    report: dict[str, Any] = {"machine": describe_machine()}
    others = [part for part in options.only if part != "physics"]
    if others:
        from ffhnet.apps.speed.report import measure_speed

        report |= measure_speed(options, others)
    if "physics" in options.only:
        report |= _physics(options)
    if options.json is not None:
        write_atomically(options.json, (json.dumps(report, indent=2) + "\n").encode())


def _physics(options: BenchmarkOptions) -> dict[str, Any]:
    """The part of the report about trials."""
    try:
        require_sim("benchmark")
    except MissingExtraError as missing:
        if options.only == ("physics",):
            raise
        print(f"physics: skipped, {missing}")
        return {"physics": {"skipped": str(missing)}}

    from ffhnet.dataset.executors import run_jobs
    from ffhnet.dataset.object_trials import GenerateConfig
    from ffhnet.dataset.physics_benchmark import measure_object
    from ffhnet.inference.ffhnet import shipped_weights
    from ffhnet.objects.catalogue import resolve_objects

    sources = resolve_objects(options.objects)[options.first :]
    if not sources:
        raise OptionError(f"--first {options.first} leaves out all of {options.objects}")
    weights = None if options.learned == 0 else str(options.weights or shipped_weights())
    config = GenerateConfig(seed=options.seed, weights=weights, learned=options.learned, repeated_share=0)
    with progress_bar("objects", len(sources)) as step:
        measured = run_jobs(measure_object, [(source, config) for source in sources], options.workers, step)
    figures = _figures(measured)
    _print(measured, figures)
    mix = {name: getattr(options, name) for name in ("objects", "first", "seed", "learned")}
    return {"mix": mix, "physics": figures}


def _figures(measured: list[ObjectMeasurement]) -> dict[str, Any]:
    """The figures of all objects together; rates with their counts."""
    executed = sum(len(m.label) for m in measured)
    collisions = sum(m.collisions for m in measured)
    flips = sum(int((m.label != m.fine_label).sum()) for m in measured)
    seconds, steps = sum(m.seconds for m in measured), sum(m.steps for m in measured)
    bare = sum(m.bare_step for m in measured) / len(measured)
    return {
        "objects": len(measured),
        "executed": executed,
        "start_collisions": collisions,
        "trials_per_s_per_core": executed / seconds,
        "trials_per_s_per_core_with_start_collisions": (executed + collisions) / seconds,
        "label_flips": flips,
        "label_flip_rate": flips / executed,
        "label_flips_when_moved_by_1_um": sum(int((m.label != m.moved_label).sum()) for m in measured),
        "success_rate": sum(int(m.label.sum()) for m in measured) / executed,
        "fine_success_rate": sum(int(m.fine_label.sum()) for m in measured) / executed,
        "steps_per_trial": steps / executed,
        "step_us": 1e6 * seconds / steps,
        "bare_step_us": 1e6 * bare,
        "bare_step_ratio": seconds / steps / bare,
        "by_pieces": [_group(measured, low, high) for low, high in PIECES],
    }


def _group(measured: list[ObjectMeasurement], low: int, high: int) -> dict[str, Any]:
    group = [m for m in measured if low <= m.pieces <= high]
    executed, seconds = sum(len(m.label) for m in group), sum(m.seconds for m in group)
    bare = sum(m.bare_step * m.steps for m in group)
    return {
        "pieces": [low, high],
        "objects": len(group),
        "executed": executed,
        "trials_per_s_per_core": executed / seconds if group else None,
        "bare_step_ratio": seconds / bare if group else None,
    }


def _print(measured: list[ObjectMeasurement], figures: dict[str, Any]) -> None:
    import numpy as np

    from ffhnet.metrics import wilson_interval

    proposer = np.concatenate([m.proposer for m in measured])
    label = np.concatenate([m.label for m in measured])
    rows = []
    for name in [*dict.fromkeys(proposer.tolist()), "all"]:
        mine = np.ones(len(label), dtype=bool) if name == "all" else proposer == name
        cells = [name, str(int(mine.sum())), f"{label[mine].mean():.1%}"]
        for other in ("fine_label", "moved_label"):
            flips = int((label != np.concatenate([getattr(m, other) for m in measured]))[mine].sum())
            interval = wilson_interval(flips, int(mine.sum()))
            cells.append(f"{flips} = {flips / mine.sum():.2%} ({interval.low:.2%} to {interval.high:.2%})")
        rows.append(cells)
    columns = ("proposer", "executed", "success", "flips at a finer step", "flips when moved by 1 µm")
    print_table(f"Labels, {figures['objects']} objects", columns, rows)
    print(
        f"\n{figures['trials_per_s_per_core']:.1f} executed trials/s of one core "
        f"({figures['trials_per_s_per_core_with_start_collisions']:.1f} with start collisions); "
        f"{figures['steps_per_trial']:.0f} steps per trial, {figures['step_us']:.1f} µs per step, "
        f"bare mj_step {figures['bare_step_us']:.1f} µs, ratio {figures['bare_step_ratio']:.2f}"
    )
    for group in figures["by_pieces"]:
        if group["objects"]:
            low, high = group["pieces"]
            pieces = str(low) if low == high else f"{low} to {high}"
            print(
                f"  {pieces} convex pieces: {group['trials_per_s_per_core']:.1f} trials/s, "
                f"ratio {group['bare_step_ratio']:.2f} ({group['objects']} objects)"
            )
