"""Could a better ranking choose a better grasp? Tries the first grasps of each view again and again.

    python benchmarks/ranking.py --objects varied-val:40,procedural-val:40 --json OUT

Every trial is under all stresses. Compares the grasp that the weights call best with a random one of the
first, and with the choice of who knows the outcome of half of the repeats; all are judged by the other half.
The gap to the last is what another ranking of the same grasps could win, with knowledge that no camera gives.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from jaxtyping import Bool

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.dataset.executors import run_jobs
from ffhnet.evaluation.protocol import load_network
from ffhnet.evaluation.stress import STRESSES, PoseErrors, try_in
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import ObjectSource, resolve_objects
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.views import seeded_views

ALL = next(stress for stress in STRESSES if stress.name == "all")


@dataclass(frozen=True)
class Options:
    """What a perfect ranking of the first grasps would be worth."""

    objects: str = "varied-val:40,procedural-val:40"
    """Objects, two views each, the second in another stable pose."""
    first: int = 24
    """Grasps of each view, those of the highest scores among 400."""
    repeats: int = 8
    """Trials of each grasp, an even number."""
    seed: int = 19
    """Of views, samples and pose errors."""
    weights: Annotated[Path | None, absent("DIR", "the package's own")] = None
    """Folder of the weights."""
    workers: int = 2
    """Processes."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


@dataclass(frozen=True)
class RankingJob:
    """One object: a unit of work for a process."""

    source: ObjectSource
    options: Options


def main(options: Options) -> None:
    figures = []
    for objects in options.objects.split(","):
        jobs = [RankingJob(source, options) for source in resolve_objects(objects)]
        with progress_bar(objects, len(jobs)) as step:
            results = run_jobs(try_first, jobs, options.workers, step)
        figures.append(summary(objects, [held for views in results for held in views]))
    columns = tuple(figures[0])
    print_table("Held under all stresses", columns, [[str(v) for v in f.values()] for f in figures])
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


def summary(objects: str, views: list[Bool[np.ndarray, "R N"]]) -> dict[str, str | int | float]:
    """Shares of trials that held, mean over the views of some objects."""
    best = np.mean([held[:, 0].mean() for held in views])
    any_of_first = np.mean([held.mean() for held in views])
    known = np.mean([known_choice(held) for held in views])
    return {
        "objects": objects,
        "views": len(views),
        "best by score": round(float(best), 3),
        "random one of the first": round(float(any_of_first), 3),
        "chosen by half of the repeats": round(float(known), 3),
    }


def known_choice(held: Bool[np.ndarray, "R N"]) -> float:
    """The grasp that held most often in one half of the repeats, judged by the other; both ways round."""
    half = len(held) // 2
    parts = held[:half].mean(axis=0), held[half:].mean(axis=0)
    return float(np.mean([judge[choose.argmax()] for choose, judge in (parts, parts[::-1])]))


def try_first(job: RankingJob) -> list[Bool[np.ndarray, "R N"]]:
    """What became of the first grasps of each of two views."""
    torch.set_num_threads(1)
    options = job.options
    weights = None if options.weights is None else str(options.weights)
    network, obj = load_network(weights), job.source.load()
    trial = GraspTrial(build_scene(load_hand(network.info.hand), obj))
    views: list[np.ndarray] = []
    for view, T_world_object, rng in seeded_views(obj, 2, options.seed):
        ranked = network.grasp(view.observation, 400, seed=int(rng.integers(2**31)))
        first = ranked[np.arange(options.first)].to_frame(view.T_world_camera, "world")
        tries = [
            try_in(ALL, trial, first, T_world_object, PoseErrors.draw(len(first), rng))
            for _ in range(options.repeats)
        ]
        views.append(np.stack([t.success for t in tries]))
    return views


if __name__ == "__main__":
    main(tyro.cli(Options))
