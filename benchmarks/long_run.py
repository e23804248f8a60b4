"""Thousands of requests in one process, a stream through the tracker, and threads that share one network.

    python benchmarks/long_run.py --requests 10000 --minutes 60 --json long_run.json

Every answer is compared to the bit with the first one to the same question. Memory is the resident set, its
slope that of a line through the second half, when all caches are full. A request begins with an observation;
the stream begins with a depth image, each with new noise. Leaves with status 1 where an answer was another.
Linux only.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.grasps import Grasps
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import GraspTracker
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.observation import Observation, observe_depth
from ffhnet.perception.sensor_noise import StereoNoise

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from scenes import depth_view

VIEWS = [("spray_flask_2000005", 1), ("jar_2000004", 2), ("thin_box_2000008", 3)]
SEEDS = 20
"""Different seeds; with the views as many different questions."""


@dataclass(frozen=True)
class Options:
    """How long it runs."""

    requests: int = 10_000
    """One after the other."""
    minutes: float = 60.0
    """Of streaming; 0 for none."""
    rate: float = 30.0
    """Depth images per second of the stream, fewer where the answers take longer."""
    threads: int = 4
    """That share one network."""
    shared: int = 1000
    """Requests of all of them together."""
    num: int = 20
    """Samples of each request."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


@dataclass(frozen=True)
class Served:
    """What requests came to: seconds of each, MB after each, and how many answers were not the first one."""

    seconds: np.ndarray
    memory_mb: np.ndarray
    different: int

    def figures(self) -> dict[str, float]:
        """Counts, quantiles of latency, and the slope of memory."""
        half = len(self.memory_mb) // 2
        slope = np.polyfit(np.arange(half, len(self.memory_mb)), self.memory_mb[half:], 1)[0]
        p50, p99 = np.percentile(1000 * self.seconds, [50, 99])
        early, late = np.array_split(1000 * self.seconds, 10)[0], np.array_split(1000 * self.seconds, 10)[-1]
        return {
            "requests": len(self.seconds),
            "different": self.different,
            "p50_ms": round(float(p50), 2),
            "p99_ms": round(float(p99), 2),
            "p50_first_tenth_ms": round(float(np.median(early)), 2),
            "p50_last_tenth_ms": round(float(np.median(late)), 2),
            "memory_start_mb": round(float(self.memory_mb[0]), 1),
            "memory_end_mb": round(float(self.memory_mb[-1]), 1),
            "slope_kb_per_1000": round(1e6 * float(slope), 1),
        }


def main(options: Options) -> None:
    torch.set_num_threads(1)
    network = FFHNet.from_pretrained(device="cpu")
    views = [
        observe_depth(depth_view(*view, noise=1.0)[0], REALSENSE_D415, np.random.default_rng(0))
        for view in VIEWS
    ]
    first = [network.grasp(views[k % len(views)], options.num, k) for k in range(len(views) * SEEDS)]
    report = {"requests": one_by_one(network, views, first, options).figures()}
    report["threads"] = together(network, views, first, options).figures()
    if options.minutes > 0:
        report["stream"] = stream(network, options).figures()
    columns = tuple(report["requests"])
    rows = [[name, *(f"{figures[column]:g}" for column in columns)] for name, figures in report.items()]
    print_table(f"{options.num} samples per request, {options.threads} threads", ("", *columns), rows)
    if options.json is not None:
        settings = {
            "num": options.num,
            "threads": options.threads,
            "minutes": options.minutes,
            "rate": options.rate,
        }
        options.json.write_text(json.dumps({**settings, **report}, indent=1) + "\n")
    sys.exit(int(any(figures["different"] > 0 for figures in report.values())))


def one_by_one(network: FFHNet, views: list[Observation], first: list[Grasps], options: Options) -> Served:
    seconds, memory = np.zeros(options.requests), np.zeros(options.requests)
    different = 0
    with progress_bar("requests", options.requests) as step:
        for i in range(options.requests):
            question = i % len(first)
            start = time.perf_counter()
            answer = network.grasp(views[question % len(views)], options.num, question)
            seconds[i] = time.perf_counter() - start
            different += not same(answer, first[question])
            memory[i] = resident_mb()
            step()
    return Served(seconds, memory, different)


def together(network: FFHNet, views: list[Observation], first: list[Grasps], options: Options) -> Served:
    def ask(i: int) -> tuple[float, float, bool]:
        question = i % len(first)
        start = time.perf_counter()
        answer = network.grasp(views[question % len(views)], options.num, question)
        return time.perf_counter() - start, resident_mb(), same(answer, first[question])

    with ThreadPoolExecutor(options.threads) as pool:
        seconds, memory, equal = zip(*pool.map(ask, range(options.shared)), strict=True)
    return Served(np.array(seconds), np.array(memory), equal.count(False))


def stream(network: FFHNet, options: Options) -> Served:
    """Depth images of a still object, each with new noise; an answer is wrong where it is not finite."""
    tracker, rng = GraspTracker(network, options.num), np.random.default_rng(0)
    clean = depth_view(*VIEWS[0], noise=0.0)[0]
    seconds, memory, different = [], [], 0
    due = time.monotonic()
    end = due + 60 * options.minutes
    while time.monotonic() < end:
        time.sleep(max(due - time.monotonic(), 0.0))
        due = max(due + 1 / options.rate, time.monotonic())
        depth = StereoNoise().apply(clean, REALSENSE_D415, rng)
        start = time.perf_counter()
        grasps = tracker.update(observe_depth(depth, REALSENSE_D415, rng), seed=len(seconds))
        seconds.append(time.perf_counter() - start)
        memory.append(resident_mb())
        different += not (np.isfinite(grasps.position).all() and np.isfinite(grasps.score).all())
    return Served(np.array(seconds), np.array(memory), different)


def same(one: Grasps, other: Grasps) -> bool:
    fields = ("rotation", "position", "joints", "probability", "robustness")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in fields)


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


if __name__ == "__main__":
    main(tyro.cli(Options))
