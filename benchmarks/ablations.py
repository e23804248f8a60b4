"""What each idea is worth: the networks trained without it, on the same data with the same steps.

    ffhnet generate OWN --split val --count 24 --seed 31 --weights src/ffhnet/weights \
        --heuristic 0 --power 0 --perturb 0 --learned 40
    python benchmarks/ablations.py data/train0 ... --val data/val0 --own OWN --out runs/ablations \
        --json docs/results/ablations.json

Evaluators are compared on held-out trials of all proposers (`--val`) and on samples of the shipped generator
on the same objects (`--own`); generators by executing their raw samples, start collisions counted as
failures. Runs are shorter than the recipe's: rows compare with the first row, not with the shipped weights.
Rows that the JSON file already holds are not run again.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.table import Table

from ffhnet.apps.console import progress_bar
from ffhnet.dataset.executors import run_jobs
from ffhnet.dataset.records import PROPOSERS, read_training_data
from ffhnet.dataset.scoring import score
from ffhnet.dataset.training_data import TrainingData
from ffhnet.hands import load_hand
from ffhnet.hands.link_points import link_points
from ffhnet.hands.surface_points import surface_points
from ffhnet.inference.ffhnet import FFHNet
from ffhnet.metrics import wilson_interval
from ffhnet.model.checkpoint import load_checkpoint, read_info, save_checkpoint
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.objects.catalogue import ObjectSource, resolve_objects
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.views import seeded_views
from ffhnet.training.config import ClassShares, TrainingConfig
from ffhnet.training.train import LookPoints, train_evaluator, train_generator

SEED = 31
"""Of the views and samples on which generators are tried."""

Network = Literal["evaluator", "generator"]


@dataclass(frozen=True)
class Row:
    """One idea left out.

    Attributes:
        name: what is different.
        network: which network it concerns.
        config: the changed run.
        data: what of the training data remains.
    """

    name: str
    network: Network
    config: Callable[[TrainingConfig], TrainingConfig] = lambda config: config
    data: Callable[[TrainingData], TrainingData] = lambda data: data


def model(**changes: Any) -> Callable[[TrainingConfig], TrainingConfig]:
    """A run with another architecture."""
    return lambda run: dataclasses.replace(run, model=dataclasses.replace(run.model, **changes))


def run(**changes: Any) -> Callable[[TrainingConfig], TrainingConfig]:
    """A run with another recipe."""
    return lambda config: dataclasses.replace(config, **changes)


def proposed_by(*names: str) -> Callable[[TrainingData], TrainingData]:
    """Trials of some proposers alone."""
    codes = [PROPOSERS.index(name) for name in names]
    return lambda data: data.select_trials(np.isin(data.proposer, codes))


def half_of_the_objects(data: TrainingData) -> TrainingData:
    """Every other object."""
    return data.select_objects(np.arange(len(data.object_names)) % 2 == 0)


NO_LINKS = {"links": 0, "link_points": 0, "local_width": 0}
"""These need the joint angles, the palm points and the height of the table."""

ROWS = (
    Row("as shipped", "evaluator"),
    Row("without points on the links", "evaluator", model(**NO_LINKS)),
    Row("raw BPS instead of its projection", "evaluator", model(pca_components=None)),
    Row("without the joint angles (public code)", "evaluator", model(use_joints=False, **NO_LINKS)),
    Row("without the height of the table", "evaluator", model(use_table_height=False, **NO_LINKS)),
    Row("without distances around the palm", "evaluator", model(palm_points=0, **NO_LINKS)),
    Row("success as the only output", "evaluator", model(judge_robustness=False)),
    Row(
        "without start collisions as negatives",
        "evaluator",
        run(shares=ClassShares(success=0.47, failure=0.53, collision=0.0)),
    ),
    Row(
        "30/30/40 % success, failure, hard negatives (paper)",
        "evaluator",
        run(shares=ClassShares(success=0.3, failure=0.3, collision=0.0, hard_negative=0.4)),
    ),
    Row("trials of the heuristic alone", "evaluator", data=proposed_by("heuristic")),
    Row(
        "without trials on own samples",
        "evaluator",
        data=proposed_by("heuristic", "power", "perturb"),
    ),
    Row("half of the objects", "evaluator", data=half_of_the_objects),
    Row("as shipped", "generator"),
    Row("the paper's cVAE", "generator", model(generator="cvae")),
    Row("raw BPS instead of its projection", "generator", model(pca_components=None)),
    Row("without the height of the table", "generator", model(use_table_height=False, **NO_LINKS)),
    Row("without distances around the palm", "generator", model(palm_points=0, **NO_LINKS)),
    Row("all successes, however lucky", "generator", run(min_local_success=0.0, min_margin=0.0)),
    Row("successes of the heuristic alone", "generator", data=proposed_by("heuristic")),
    Row("without successes of own samples", "generator", data=proposed_by("heuristic", "power", "perturb")),
    Row("half of the objects", "generator", data=half_of_the_objects),
)


@dataclass(frozen=True)
class Options:
    """Train each network again without one idea at a time, and measure."""

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets to train on."""
    val: Path
    """Trials of all proposers on held-out objects."""
    own: Path
    """Trials of the shipped generator's samples on held-out objects."""
    out: Path
    """Folder of the runs."""
    json: Path
    """File of the figures."""
    networks: tuple[Network, ...] = ("evaluator", "generator")
    """Which rows."""
    steps: int = 1000
    """Steps of each run."""
    objects: str = "procedural-val:24"
    """Held-out objects on which generators are tried."""
    views: int = 2
    """Views of each, its resting poses in turn."""
    samples: int = 24
    """Samples of each view, all executed."""
    threads: int = 1
    """Processor threads of the training, and processes of the trials."""


@dataclass(frozen=True)
class SamplesJob:
    """One object on which a generator is tried."""

    source: ObjectSource
    weights: Path
    views: int
    samples: int


def main(options: Options) -> None:
    torch.set_num_threads(options.threads)
    data, val = read_training_data(list(options.data)), read_training_data([options.val])
    own = read_training_data([options.own])
    figures = json.loads(options.json.read_text()) if options.json.exists() else {}
    for row in ROWS:
        key = f"{row.network}: {row.name}"
        if row.network not in options.networks or key in figures:
            continue
        folder = options.out / key.replace(" ", "_").replace("/", "_")
        train(row, data, folder, options.steps)
        measured = rate(folder, val, own) if row.network == "evaluator" else execute(folder, options)
        figures[key] = {"steps": options.steps, **measured}
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    show(figures)


def train(row: Row, data: TrainingData, folder: Path, steps: int) -> None:
    """Both networks into a folder, of which only the row's has learned anything."""
    hand = load_hand(data.hand)
    links = link_points(hand)
    default = TrainingConfig.default(row.network)
    config = row.config(dataclasses.replace(default, model=default.model.with_links(links), steps=steps))
    limits = (hand.lower.tolist(), hand.upper.tolist())
    look = LookPoints(surface_points(hand, config.model.palm_points), links)
    learn = train_evaluator if row.network == "evaluator" else train_generator
    learn(row.data(data), None, config, folder, limits, look)
    info = read_info(folder)
    if row.network == "generator":
        save_checkpoint(folder, info, evaluator=FFHEvaluator(info.model))
    else:
        save_checkpoint(folder, info, generator=FlowGenerator(info.model))


def rate(folder: Path, val: TrainingData, own: TrainingData) -> dict[str, Any]:
    """How well an evaluator predicts trials of both kinds, start collisions included."""
    evaluator = load_network(folder).evaluator
    figures: dict[str, Any] = {}
    for name, trials in (("val", val), ("own", own)):
        scores = score(trials, evaluator)
        figures[name] = {
            "executed": scores.executed,
            "collisions": scores.collisions,
            "successes": scores.successes,
            "auroc": scores.auroc_all,
            "ece": scores.ece_executed,
        }
    return figures


def execute(folder: Path, options: Options) -> dict[str, Any]:
    """How many raw samples of a generator lift the object."""
    jobs = [
        SamplesJob(source, folder, options.views, options.samples)
        for source in resolve_objects(options.objects)
    ]
    with progress_bar("objects", len(jobs)) as step:
        results = run_jobs(try_samples, jobs, options.threads, step)
    tried, free, lifted = np.sum(results, axis=0).tolist()
    interval = wilson_interval(lifted, tried)
    return {"samples": tried, "free": free, "successes": lifted, "wilson95": [interval.low, interval.high]}


def try_samples(job: SamplesJob) -> tuple[int, int, int]:
    """Samples, those without start collision, and those that lift the object."""
    torch.set_num_threads(1)
    network, obj = load_network(job.weights), job.source.load()
    trial = GraspTrial(build_scene(load_hand(network.info.hand), obj))
    counts = np.zeros(3, dtype=int)
    for view, T_world_object, rng in seeded_views(obj, job.views, SEED):
        source = torch.Generator().manual_seed(int(rng.integers(2**31)))
        grasps = network.generate(view.observation, job.samples, source)
        results = trial.run(grasps.to_frame(view.T_world_view, "world"), T_world_object)
        counts += len(grasps), int(results.executed.sum()), int(results.success.sum())
    return counts[0], counts[1], counts[2]


@lru_cache(maxsize=1)
def load_network(folder: Path) -> FFHNet:
    """The networks of a row, loaded once per process."""
    return FFHNet(load_checkpoint(folder))


def show(figures: dict[str, Any]) -> None:
    """One table for each network."""
    evaluators, generators = (
        Table("evaluator", "AUROC, held out", "ECE", "AUROC, own samples", "ECE"),
        Table("generator", "free of start collisions", "success of raw samples", "95 %"),
    )
    for key, row in figures.items():
        network, name = key.split(": ", 1)
        if network == "evaluator":
            cells = [f"{row[data][value]:.3f}" for data in ("val", "own") for value in ("auroc", "ece")]
            evaluators.add_row(name, *cells)
        else:
            low, high = row["wilson95"]
            tried, free, lifted = row["samples"], row["free"], row["successes"]
            generators.add_row(
                name,
                f"{free}/{tried} {free / tried:.1%}",
                f"{lifted}/{tried} {lifted / tried:.1%}",
                f"{low:.1%} to {high:.1%}",
            )
    for table in (evaluators, generators):
        Console(width=120).print(table)


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.PositionalMetavarFromFieldName,)))
