"""Throughput of two Ray workers against two local processes, and the memory of workers over a job.

    python benchmarks/executors.py --objects 40 --json executors.json

Every executor tries the same objects, one executor after the other. "cold" counts from the call, with the
start of processes and cluster; "warm" from the moment the first unit begins.
"""

from __future__ import annotations

import json
import os
import resource
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from ffhnet.apps.console import absent
from ffhnet.dataset.executors import Executor, LocalExecutor, RayExecutor
from ffhnet.dataset.generate import Unit, run_unit
from ffhnet.dataset.object_trials import GenerateConfig
from ffhnet.objects.catalogue import resolve_objects

SMALL = GenerateConfig(placements=1, views=2, heuristic=4, power=4, perturb=4, max_collisions=4)


@dataclass(frozen=True)
class Options:
    """Throughput and memory of executors."""

    objects: int = 40
    """Objects that each executor tries."""
    workers: int = 2
    """Workers of each."""
    units: Literal["small", "whole"] = "small"
    """Objects tried with a few grasps, or with all that `ffhnet generate` tries."""
    executors: tuple[Literal["local", "ray"], ...] = ("local", "ray")
    """What is measured."""
    repeats: int = 1
    """Rounds; all executors are measured in each."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


@dataclass(frozen=True)
class Usage:
    """What a unit saw of its worker: memory in MB, times as of `time.time`."""

    worker: int
    begin: float
    resident: float
    peak: float


def measured(unit: Unit) -> Usage:
    begin = time.time()
    run_unit(unit)
    # Linux counts the peak in kB.
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return Usage(os.getpid(), begin, pages * os.sysconf("SC_PAGE_SIZE") / 1e6, peak)


def measure(executor: Executor, units: list[Unit]) -> dict[str, float | int | list[float]]:
    usages: list[Usage] = []
    start = time.time()

    def fail(_: Unit, error: Exception) -> None:
        raise error

    ends: list[float] = []

    def done(_: Unit, usage: Usage) -> None:
        usages.append(usage)
        ends.append(time.time())

    executor.run(measured, units, done, fail)
    tenth = max(1, len(usages) // 10)
    resident = [
        float(np.mean([u.resident for u in usages[i : i + tenth]])) for i in range(0, len(usages), tenth)
    ]
    return {
        "cold_s": ends[-1] - start,
        "warm_s": ends[-1] - min(usage.begin for usage in usages),
        "worker_processes": len({usage.worker for usage in usages}),
        "peak_rss_mb": max(usage.peak for usage in usages),
        "mean_rss_mb_by_tenth": [round(value, 1) for value in resident],
    }


def main(options: Options) -> None:
    config = SMALL if options.units == "small" else GenerateConfig()
    units = [Unit(source, config) for source in resolve_objects(f"procedural-train:{options.objects}")]
    kinds = {"local": LocalExecutor(options.workers), "ray": RayExecutor(workers=options.workers)}
    rounds = [
        {name: measure(kinds[name], units) for name in options.executors} for _ in range(options.repeats)
    ]
    report = {
        "objects": options.objects,
        "workers": options.workers,
        "units": options.units,
        "rounds": rounds,
    }
    if {"local", "ray"} <= set(options.executors):
        report["ray_to_local_throughput"] = {
            key: float(np.median([r["local"][f"{key}_s"] / r["ray"][f"{key}_s"] for r in rounds]))
            for key in ("cold", "warm")
        }
    text = json.dumps(report, indent=2)
    print(text)
    if options.json is not None:
        options.json.write_text(text + "\n")


if __name__ == "__main__":
    main(tyro.cli(Options))
