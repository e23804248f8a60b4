"""The networks' part: the engine against the plain modules, and against the paper's networks.

Published way: the architecture of section III at full size, with the raw basis point set vector copied for
every grasp, in the plain modules. Its weights are random, which changes nothing about time.
"""

from __future__ import annotations

import resource
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch

from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.inference.engine import Engine
from ffhnet.inference.precision import product_dtype
from ffhnet.model.checkpoint import Checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import EvaluatorLogits, FFHEvaluator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

NO_REDUCED = "this processor has no instructions for products of bfloat16, or the generator is small"

Answer = tuple[GraspTensors, EvaluatorLogits]


@dataclass(frozen=True)
class Way:
    """A way from an object to rated grasps, in two stages and whole."""

    generate: Callable[[], GraspTensors]
    evaluate: Callable[[GraspTensors], EvaluatorLogits]

    def __call__(self) -> Answer:
        """Both stages."""
        grasps = self.generate()
        return grasps, self.evaluate(grasps)


def published(objects: ObjectTensors, num: int) -> Way:
    """The paper's networks with the object copied for every grasp."""
    config = ModelConfig.paper()
    generator, evaluator = FFHGenerator(config).eval(), FFHEvaluator(config).eval()
    return Way(
        lambda: generator.sample(objects.repeat(num), 1, _source()),
        lambda grasps: evaluator(objects.repeat(num), grasps),
    )


def plain(checkpoint: Checkpoint, objects: ObjectTensors, num: int) -> Way:
    """The modules of `ffhnet.model`."""
    return Way(
        lambda: checkpoint.generator.sample(objects, num, _source()),
        lambda grasps: checkpoint.evaluator(objects, grasps),
    )


def fast(engine: Engine, objects: ObjectTensors, num: int) -> Way:
    """The engine, which looks at the object again each time."""
    seen = [engine.look(objects)]

    def generate() -> GraspTensors:
        seen[0] = engine.look(objects)
        return seen[0].sample(num, _source())

    return Way(generate, lambda grasps: seen[0].rate(grasps))


def largest_difference(checkpoint: Checkpoint, objects: ObjectTensors, num: int) -> float:
    """Between engine and modules: of poses (m, rad) from the same noise, and of probabilities."""
    wanted, logits = plain(checkpoint, objects, num)()
    seen = Engine(checkpoint).look(objects)
    got, rated = seen.sample(num, _source()), seen.rate(wanted)
    pairs = [*zip(vars(wanted).values(), vars(got).values(), strict=True)]
    for value, other in zip(vars(logits).values(), vars(rated).values(), strict=True):
        if value is not None:
            pairs.append((value.sigmoid(), other.sigmoid()))
    return max((a - b).abs().max().item() for a, b in pairs)


@torch.inference_mode()
def measure_networks(
    checkpoint: Checkpoint, realtime: Checkpoint, objects: ObjectTensors, num: int, clock: Clock
) -> tuple[dict[str, Times], dict[str, Any]]:
    """Times of all ways, and figures of the contract: medians, factors, the largest difference."""
    engines = {"engine": Engine(checkpoint), "realtime": Engine(realtime)}
    if has_reduced(checkpoint.info.model):
        engines["reduced"] = Engine(checkpoint, "reduced")
    ways = {
        "published": published(objects, num),
        "plain": plain(checkpoint, objects, num),
        **{name: fast(engine, objects, num) for name, engine in engines.items()},
    }
    stages: dict[str, Callable[[], object]] = {}
    for name, engine in engines.items():
        seen = engine.look(objects)
        stages[f"{name}: look"] = partial(engine.look, objects)
        stages[f"{name}: generate"] = partial(seen.sample, num, _source())
        stages[f"{name}: evaluate"] = partial(seen.rate, ways[name].generate())
    times = clock.in_turns({**ways, **stages})
    slow = times["published"]
    figures = {
        **{f"{name}_ms": times[name].median for name in ways},
        **_reduced_figures(times),
        "times_faster_than_published": times["engine"].times_faster(slow),
        "times_faster_than_plain": times["engine"].times_faster(times["plain"]),
        "realtime_times_faster_than_published": times["realtime"].times_faster(slow),
        "largest_difference": max(
            largest_difference(weights, objects, num) for weights in (checkpoint, realtime)
        ),
    }
    return times, figures


def has_reduced(config: ModelConfig) -> bool:
    """Whether reduced precision makes a difference for a generator on this processor."""
    width = config.flow_width if config.generator == "flow" else 0
    return product_dtype("reduced", width, torch.device("cpu")) != torch.float32


def _reduced_figures(times: Mapping[str, Times]) -> dict[str, Any]:
    if "reduced" not in times:
        return {"reduced_ms": None, "reduced_skipped": NO_REDUCED}
    reduced = times["reduced"]
    return {
        "reduced_ms": reduced.median,
        "reduced_times_faster_than_published": reduced.times_faster(times["published"]),
        "reduced_times_faster_than_exact": reduced.times_faster(times["engine"]),
    }


@torch.inference_mode()
def measure_counts(
    checkpoint: Checkpoint, objects: ObjectTensors, counts: Sequence[int], clock: Clock
) -> list[dict[str, float]]:
    """Time of the engine for growing numbers of grasps, and the largest memory of the process so far."""
    engine, rows = Engine(checkpoint), []
    for num in counts:
        way = fast(engine, objects, num)
        few = Clock(3 if num <= 1000 else 1, clock.now)
        ms = few.in_turns({"way": way}, warm_up=1 if num <= 1000 else 0)["way"].median
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rows.append({"grasps": num, "ms": ms, "us_per_grasp": 1e3 * ms / num, "peak_mib": peak})
    return rows


def _source() -> torch.Generator:
    return torch.Generator().manual_seed(0)
