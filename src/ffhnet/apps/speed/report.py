"""All parts of the benchmark but the trials: measured, printed, and as the report's JSON."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from ffhnet.apps.console import busy, print_table
from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.apps.speed.gpu import measure_gpu
from ffhnet.apps.speed.networks import has_reduced, measure_counts, measure_networks
from ffhnet.apps.speed.pipeline import (
    measure_encodings,
    measure_pipeline,
    measure_tracking,
    segmented,
    use_compiled_encoder,
)
from ffhnet.apps.speed.startup import measure_startup
from ffhnet.apps.speed.training import measure_training
from ffhnet.inference import FFHNet
from ffhnet.inference.ffhnet import REALTIME, find_weights
from ffhnet.model.checkpoint import load_checkpoint
from ffhnet.model.tensors import ObjectTensors

if TYPE_CHECKING:
    from ffhnet.apps.benchmark import BenchmarkOptions


def measure_speed(options: BenchmarkOptions, parts: Sequence[str]) -> dict[str, Any]:
    """Measure the parts that are named, print their tables, and give their figures."""
    torch.set_num_threads(options.threads)
    clock = Clock(options.rounds, time.process_time if options.clock == "processor" else time.perf_counter)
    weights, observation = find_weights(options.weights), segmented()
    height = torch.tensor([observation.table_height], dtype=torch.float32)
    objects = ObjectTensors(torch.from_numpy(observation.bps)[None], height)
    report: dict[str, Any] = {
        "protocol": {
            "grasps": options.grasps,
            "rounds": options.rounds,
            "threads": options.threads,
            "clock": options.clock,
            "load_at_start": os.getloadavg()[0],
            "capability": torch.backends.cpu.get_cpu_capability(),
        },
        "inference": {},
    }
    if "startup" in parts:
        report["startup"] = _startup()
    if "perception" in parts:
        report["perception"], report["inference"] = _perception(options, weights, clock)
    if "inference" in parts:
        report["inference"] |= _inference(options, weights, objects, clock)
    if "gpu" in parts:
        report["gpu"] = figures = measure_gpu(weights, objects, options.grasps, options.rounds)
        print("GPU: " + (f"skipped, {figures['skipped']}" if "skipped" in figures else f"{figures}"))
    if "training" in parts:
        with busy("training steps"):
            times = measure_training(Clock(max(2, options.rounds // 5), clock.now))
        report["training"] = {f"{name}_ms": value.median for name, value in times.items()}
        _print_times("Training, one step", times)
    return report


def _startup() -> dict[str, dict[str, float]]:
    with busy("start-up"):
        figures = measure_startup()
    rows = [[name, *(f"{value:.2f}" for value in times.values())] for name, times in figures.items()]
    print_table("Cold start", ("command", "wall (s)", "processor (s)"), rows)
    return figures


def _perception(
    options: BenchmarkOptions, weights: Path, clock: Clock
) -> tuple[dict[str, Any], dict[str, float | None]]:
    """Figures of perception, and those of the whole way, which count as inference."""
    with busy("stages"):
        encoder = use_compiled_encoder()
        networks = {
            "engine": FFHNet.from_pretrained(weights, device="cpu"),
            REALTIME: FFHNet.from_pretrained(REALTIME, device="cpu"),
        }
        if has_reduced(networks["engine"].info.model):
            networks["reduced"] = FFHNet.from_pretrained(weights, device="cpu", precision="reduced")
        times = measure_pipeline(networks, options.grasps, clock)
        tracking = measure_tracking(networks, clock)
        encodings = measure_encodings(options.points, clock)
    _print_times(f"Stages, {options.grasps} grasps, encoder: {encoder}", times)
    rows = [
        [
            f"{row['points']}",
            f"{row['tree_ms']:.2f}",
            "-" if row["compiled_ms"] is None else f"{row['compiled_ms']:.2f}",
        ]
        for row in encodings
    ]
    print_table("Encodings", ("points", "k-d tree (ms)", "compiled (ms)"), rows)
    figures = {
        "depth_to_observation_ms": times["depth_to_observation"].median,
        "encoder": encoder,
        "stages": _spreads(times),
        "encodings": encodings,
        "tracking": tracking,
    }
    rows = [
        [str(row["weights"]), str(row["grasps"]), f"{row['ms']:.1f}", f"{row['per_second']:.1f}"]
        for row in tracking
    ]
    print_table("Tracking", ("weights", "samples per cloud", "ms", "clouds per second"), rows)
    whole = {name: times[f"{name}: whole"].median for name in networks}
    return figures, {
        "bps_ms": times["bps"].median,
        "whole_ms": whole["engine"],
        "realtime_whole_ms": whole[REALTIME],
        "reduced_whole_ms": whole.get("reduced"),
    }


def _inference(
    options: BenchmarkOptions, weights: Path, objects: ObjectTensors, clock: Clock
) -> dict[str, Any]:
    with busy("networks"):
        checkpoint = load_checkpoint(weights)
        realtime = load_checkpoint(find_weights(REALTIME))
        times, figures = measure_networks(checkpoint, realtime, objects, options.grasps, clock)
        curve = measure_counts(checkpoint, objects, options.counts, clock)
    _print_times(f"Networks, {options.grasps} grasps, {options.threads} threads", times)
    factors = {
        "the paper's networks, published way": "times_faster_than_published",
        "its own plain modules": "times_faster_than_plain",
        "the published way, with the weights realtime": "realtime_times_faster_than_published",
    }
    if figures["reduced_ms"] is None:
        print(f"reduced precision: skipped, {figures['reduced_skipped']}")
    else:
        factors["the published way, in reduced precision"] = "reduced_times_faster_than_published"
        factors["itself, in reduced precision"] = "reduced_times_faster_than_exact"
    rows = [[name, f"{figures[key]:.2f}"] for name, key in factors.items()]
    print_table("The engine", ("against", "times as fast"), rows)
    print(f"largest difference from the plain modules: {figures['largest_difference']:.1e}")
    columns = ("grasps", "ms", "µs per grasp", "peak memory (MiB)")
    rows = [
        [f"{value:.0f}" if i != 2 else f"{value:.1f}" for i, value in enumerate(row.values())]
        for row in curve
    ]
    print_table("Engine, growing numbers of grasps", columns, rows)
    return {**figures, "ways": _spreads(times), "curve": curve}


def _spreads(times: Mapping[str, Times]) -> dict[str, dict[str, float]]:
    return {name: value.to_json() for name, value in times.items()}


def _print_times(title: str, times: Mapping[str, Times]) -> None:
    rows = [[name, *(f"{ms:.2f}" for ms in value.to_json().values())] for name, value in times.items()]
    print_table(title, ("stage", "median (ms)", "quartile 1", "quartile 3", "fastest"), rows)
