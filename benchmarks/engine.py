"""The engine against the plain modules, and against the paper's networks run the published way.

    python benchmarks/engine.py [--grasps 400] [--runs 15] [--threads 2] [--json FILE]

Published way: the architecture of section III at full size, with the raw basis point set vector copied for
every grasp, in the plain modules. Its weights are random, which changes nothing about time. The runs of all
ways alternate, and factors are medians of the factors within a round, so that what else the machine does
slows all. Also shown: how time and memory grow with the number of grasps. The benchmark ends with an error
if the engine's answers are not the plain modules'.
"""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Annotated

import torch
import tyro
from rich.console import Console
from rich.table import Table

from ffhnet.apps.console import absent
from ffhnet.geometry.basis import basis_points
from ffhnet.inference.engine import Engine
from ffhnet.inference.ffhnet import find_weights
from ffhnet.model.checkpoint import Checkpoint, load_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

TOLERANCE = 1e-5
"""Largest difference of a pose (m, rad) or probability from the plain modules'."""

STAGES = ("look", "generate", "evaluate")


@dataclass(frozen=True)
class Options:
    """Milliseconds from a basis point set vector to rated grasps."""

    weights: Annotated[Path | None, absent("DIR", "the package's own")] = None
    """Weights to measure, beside an untrained network of the distilled size."""
    grasps: int = 400
    """Grasps of an object."""
    runs: int = 15
    """Rounds that count."""
    warm_up: int = 3
    """Rounds before them."""
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processor threads."""
    counts: tuple[int, ...] = (1, 10, 100, 1000, 10_000, 100_000)
    """Numbers of grasps for the curve; none leaves it out."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


@dataclass(frozen=True)
class Way:
    """A way from an object to rated grasps: a function for each stage, each given what the last one made."""

    name: str
    look: Callable[[ObjectTensors], object]
    generate: Callable[[object], GraspTensors]
    evaluate: Callable[[object, GraspTensors], object]
    times: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in (*STAGES, "all")})

    def run(self, objects: ObjectTensors) -> None:
        clock = [time.perf_counter()]
        seen = self.look(objects)
        clock.append(time.perf_counter())
        grasps = self.generate(seen)
        clock.append(time.perf_counter())
        self.evaluate(seen, grasps)
        clock.append(time.perf_counter())
        for stage, start, end in zip(STAGES, clock, clock[1:], strict=False):
            self.times[stage].append(1e3 * (end - start))
        self.times["all"].append(1e3 * (clock[-1] - clock[0]))


def source() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def published(num: int) -> Way:
    """The paper's networks with the object copied for every grasp."""
    config = ModelConfig.paper()
    generator, evaluator = FFHGenerator(config).eval(), FFHEvaluator(config).eval()

    def generate(objects: ObjectTensors) -> GraspTensors:
        return generator.sample(objects, 1, source())

    return Way("paper, published way", lambda objects: objects.repeat(num), generate, evaluator)


def plain(name: str, checkpoint: Checkpoint, num: int) -> Way:
    generator = checkpoint.generator
    return Way(
        f"{name}, plain modules",
        lambda objects: objects,
        lambda objects: generator.sample(objects, num, source()),
        checkpoint.evaluator,
    )


def fast(name: str, checkpoint: Checkpoint, num: int) -> Way:
    return Way(
        f"{name}, engine",
        Engine(checkpoint).look,
        lambda seen: seen.sample(num, source()),
        lambda seen, grasps: seen.rate(grasps),
    )


def untrained_student(trained: Checkpoint) -> Checkpoint:
    """The package's evaluator with an untrained flow of the size that `ffhnet distil` makes."""
    config = trained.info.model.student()
    flow = FlowGenerator(config).eval()
    if isinstance(trained.generator, FlowGenerator):
        flow.take_constants(trained.generator)
    info = dataclasses.replace(trained.info, model=config)
    return Checkpoint(info, flow, trained.evaluator)


def made_up_object() -> ObjectTensors:
    """A view of a cylinder on a table."""
    angle = torch.linspace(-1.6, 1.6, 40).repeat(25)
    height = torch.linspace(-0.07, 0.07, 25).repeat_interleave(40)
    cloud = torch.stack([-0.035 * angle.cos(), 0.035 * angle.sin(), height], dim=-1)
    distance = torch.cdist(torch.from_numpy(basis_points().copy()).float(), cloud).amin(dim=-1)
    return ObjectTensors(distance.unsqueeze(0), torch.tensor([-0.075]))


def check(checkpoint: Checkpoint, objects: ObjectTensors, num: int) -> float:
    """Largest difference between engine and plain modules; ends with an error if it is too large."""
    seen = Engine(checkpoint).look(objects)
    wanted = checkpoint.generator.sample(objects, num, source())
    got = seen.sample(num, source())
    pairs = list(zip(vars(wanted).values(), vars(got).values(), strict=True))
    logits, fast_logits = checkpoint.evaluator(objects, wanted), seen.rate(wanted)
    for value, other in zip(vars(logits).values(), vars(fast_logits).values(), strict=True):
        if value is not None:
            pairs.append((value.sigmoid(), other.sigmoid()))
    worst = max((a - b).abs().max().item() for a, b in pairs)
    if worst > TOLERANCE:
        sys.exit(f"the engine's answers differ from the plain modules' by {worst:.1e}, more than {TOLERANCE}")
    return worst


def curve(checkpoint: Checkpoint, objects: ObjectTensors, counts: tuple[int, ...]) -> list[dict[str, float]]:
    """Time and the process's largest memory so far, for growing numbers of grasps."""
    engine, rows = Engine(checkpoint), []
    for num in counts:
        times = []
        for _ in range(3 if num <= 10_000 else 1):
            start = time.perf_counter()
            seen = engine.look(objects)
            seen.rate(seen.sample(num, source()))
            times.append(1e3 * (time.perf_counter() - start))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rows.append({"grasps": num, "ms": median(times), "peak_mib": memory})
    return rows


@torch.inference_mode()
def main(options: Options) -> None:
    torch.set_num_threads(options.threads)
    trained = load_checkpoint(find_weights(options.weights))
    checkpoints = {"weights": trained, "distilled size": untrained_student(trained)}
    objects, num = made_up_object(), options.grasps
    difference = {name: check(checkpoint, objects, num) for name, checkpoint in checkpoints.items()}
    ways = [published(num)]
    for name, checkpoint in checkpoints.items():
        ways += [plain(name, checkpoint, num), fast(name, checkpoint, num)]
    for _ in range(options.warm_up + options.runs):
        for way in ways:
            way.run(objects)
    reference = ways[0].times["all"][options.warm_up :]
    rows = []
    for way in ways:
        counted = {stage: times[options.warm_up :] for stage, times in way.times.items()}
        factors = [slow / quick for slow, quick in zip(reference, counted["all"], strict=True)]
        medians = {f"{stage}_ms": median(times) for stage, times in counted.items()}
        rows.append({"name": way.name, **medians, "all_min_ms": min(counted["all"])})
        rows[-1]["times_published"] = median(factors)
    report = {
        "ways": rows,
        "largest_difference": difference,
        "curve": {name: curve(made, objects, options.counts) for name, made in checkpoints.items()},
        "protocol": {
            "grasps": num,
            "runs": options.runs,
            "threads": options.threads,
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "architecture": platform.machine(),
            "capability": torch.backends.cpu.get_cpu_capability(),
            "torch": torch.__version__,
        },
    }
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=2) + "\n")
    show(report)


def show(report: dict) -> None:
    console = Console(width=110)
    protocol = report["protocol"]
    title = f"{protocol['grasps']} grasps, {protocol['threads']} threads, medians of {protocol['runs']} (ms)"
    table = Table("way", *STAGES, "all", "fastest", "factor", title=title)
    for row in report["ways"]:
        cells = [f"{row[f'{key}_ms']:.1f}" for key in (*STAGES, "all", "all_min")]
        table.add_row(row["name"], *cells, f"{row['times_published']:.1f}")
    console.print(table)
    for name, rows in report["curve"].items():
        table = Table("grasps", "ms", "µs per grasp", "peak memory (MiB)", title=f"{name}, engine")
        for row in rows:
            each = 1e3 * row["ms"] / row["grasps"]
            table.add_row(f"{row['grasps']}", f"{row['ms']:.1f}", f"{each:.1f}", f"{row['peak_mib']:.0f}")
        console.print(table)
    worst = max(report["largest_difference"].values())
    console.print(f"largest difference from the plain modules: {worst:.1e}")


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.PositionalMetavarFromFieldName,)))
