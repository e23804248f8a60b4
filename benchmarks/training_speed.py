"""Seconds per training step against the straightforward loop on the same data.

    python benchmarks/training_speed.py data/train0 [--steps 10] [--threads 2] [--json FILE]

The straightforward loop gives every grasp its own copy of the object, as if each were a view of its own, and
takes the optimiser as it comes. Both make the same steps: the benchmark ends with an error if their losses
differ by more than rounding. The raw loop does likewise without the projection of the BPS: all its values
enter each layer that sees the object, as in the paper. The steps of the loops alternate, so that what else
the machine does slows all.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Annotated, Literal

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.table import Table

from ffhnet.apps.console import absent
from ffhnet.dataset.records import read_training_data
from ffhnet.dataset.training_data import TrainingData
from ffhnet.hands import load_hand
from ffhnet.hands.surface_points import surface_points
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.training.batches import Batch, BatchMaker
from ffhnet.training.config import TrainingConfig
from ffhnet.training.loop import seeded
from ffhnet.training.tasks import EvaluatorTask, FlowTask, GeneratorTask, Task
from ffhnet.training.train import initial_network

WARM_UP = 2
"""Steps that are not counted."""

TOLERANCE = 1e-3
"""Largest relative difference between the losses of the two loops."""

Network = Literal["flow", "cvae", "evaluator"]
KINDS = {
    "flow": (FlowGenerator, FlowTask),
    "cvae": (FFHGenerator, GeneratorTask),
    "evaluator": (FFHEvaluator, EvaluatorTask),
}


@dataclass(frozen=True)
class Options:
    """Seconds per training step of each network."""

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets to train on."""
    networks: tuple[Network, ...] = ("flow", "cvae", "evaluator")
    """What is measured, with the default preset."""
    steps: int = 10
    """Steps of each loop."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


@dataclass
class Loop:
    """A network with its optimiser, and the seconds that its steps took."""

    task: Task
    optimizer: torch.optim.Optimizer
    wall: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)

    def step(self, step: int) -> float:
        wall, processor = time.perf_counter(), time.process_time()
        with seeded(0, step) as rng:
            loss, _ = self.task.loss(step, rng)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.wall.append(time.perf_counter() - wall)
        self.processor.append(time.process_time() - processor)
        return loss.item()


class TiledBatches:
    """The batches of a `BatchMaker` with one grasp per view, the views repeated."""

    def __init__(self, plain: BatchMaker):
        self.plain = plain

    def draw(self, rng: np.random.Generator, views: int, grasps: int) -> Batch:
        batch = self.plain.draw(rng, views, grasps)
        labels = ("label", "robust", "collision")
        return dataclasses.replace(
            batch,
            objects=batch.objects.repeat(grasps),
            grasps=batch.grasps.ungrouped(),
            **{name: getattr(batch, name).reshape(-1, 1) for name in labels},
        )


def main(options: Options) -> None:
    torch.set_num_threads(options.threads)
    data = read_training_data(list(options.data))
    figures = {name: measure(name, data, options.steps) for name in options.networks}
    report = {
        "networks": figures,
        "protocol": {
            "views": data.num_views,
            "trials": data.num_trials,
            "steps": options.steps,
            "threads": options.threads,
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "architecture": platform.machine(),
            "torch": torch.__version__,
        },
    }
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=2) + "\n")
    show(report)


def measure(name: Network, data: TrainingData, steps: int) -> dict[str, float]:
    """Medians over the steps of both loops."""
    network = "evaluator" if name == "evaluator" else "generator"
    config = TrainingConfig.default(network, len(data.joint_names))
    if name != "evaluator":
        config = dataclasses.replace(config, model=dataclasses.replace(config.model, generator=name))
    points = surface_points(load_hand(data.hand), config.model.palm_points)
    raw = dataclasses.replace(config, model=dataclasses.replace(config.model, pca_components=None))
    loops = {
        "grouped": make_loop(name, data, config, points, tiled=False),
        "straightforward": make_loop(name, data, config, points, tiled=True),
        "raw": make_loop(name, data, raw, points, tiled=True),
    }
    for step in range(WARM_UP + steps):
        loss = {key: loop.step(step) for key, loop in loops.items()}
        # Later, rounding has grown.
        if step == 0 and not math.isclose(loss["grouped"], loss["straightforward"], rel_tol=TOLERANCE):
            sys.exit(f"{name}: the loops differ, their first losses are {loss}")
    figures = {f"{key}_wall_s": median(loop.wall[WARM_UP:]) for key, loop in loops.items()}
    return figures | {f"{key}_processor_s": median(loop.processor[WARM_UP:]) for key, loop in loops.items()}


def make_loop(
    name: Network, data: TrainingData, config: TrainingConfig, points: np.ndarray, tiled: bool
) -> Loop:
    """The project's loop, or the straightforward one."""
    network, task_kind = KINDS[name]
    module = initial_network(network, data, config, None, points)
    task = task_kind(module.train(), config, data, None)
    if tiled:
        task._batches = TiledBatches(task._batches)
    optimizer = torch.optim.AdamW(
        module.parameters(),
        lr=config.learning_rate,
        weight_decay=config.weight_decay,
        fused=None if tiled else True,
    )
    return Loop(task, optimizer)


def show(report: dict) -> None:
    table = Table("network", "clock", "grouped (s)", "straightforward (s)", "factor", "raw (s)", "factor")
    for name, row in report["networks"].items():
        for clock in ("wall", "processor"):
            ours, plain, raw = (row[f"{key}_{clock}_s"] for key in ("grouped", "straightforward", "raw"))
            factors = f"{plain / ours:.1f}", f"{raw / ours:.1f}"
            table.add_row(name, clock, f"{ours:.3f}", f"{plain:.3f}", factors[0], f"{raw:.3f}", factors[1])
    Console(width=110).print(table)


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.PositionalMetavarFromFieldName,)))
