"""Real depth captures: a grasp for every object, and grasps executed on the meshes registered to them.

    python benchmarks/captures.py ../shared/data/captures [--seeds 20] [--json docs/results/captures.json]

Every capture is observed and grasps are planned for all its objects. Objects whose true mesh and pose are
known stand in physics where they were registered, and the best feasible grasp of each seed, planned from the
real depth alone, is executed on them. Results are kept in the file as they come: run again, it goes on where
it was stopped, and begins anew when the weights or the options have changed.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import torch
import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from ffhnet.dataset.executors.local import LocalExecutor
from ffhnet.evaluation.captures import find_captures, read_capture
from ffhnet.evaluation.captures_physics import CapturePhysics
from ffhnet.evaluation.captures_survey import MAX_WIDTH, MIN_HEIGHT, MIN_SEEN, survey
from ffhnet.feasibility.planner import Planner
from ffhnet.hands import Hand, load_hand
from ffhnet.inference import FFHNet
from ffhnet.inference.ffhnet import find_weights
from ffhnet.inference.weights_calibration import weights_digest
from ffhnet.metrics import wilson_interval


@dataclass(frozen=True)
class Options:
    """What is measured.

    Attributes:
        captures: folder of captures, GROUP/NAME; meshes are named relative to its parent.
        json: where results are kept.
        weights: folder of weights, the shipped ones if none.
        seeds: executed grasps per registered object.
        samples: grasps sampled at a time.
        workers: processes.
    """

    captures: tyro.conf.Positional[Path]
    json: Path = Path("docs/results/captures.json")
    weights: Path | None = None
    seeds: int = 20
    samples: int = 400
    workers: int = 1


@dataclass(frozen=True)
class Job:
    """One part of the work on a capture: its "trials", or its "survey"."""

    folder: Path
    part: Literal["trials", "survey"]
    options: Options


def main(options: Options) -> None:
    _, hand = load(options.weights)
    protocol = {
        "weights_sha256": weights_digest(find_weights(options.weights)),
        "hand": hand.name,
        "seeds": options.seeds,
        "samples": options.samples,
        "clearly_graspable": {"max_width": MAX_WIDTH, "min_height": MIN_HEIGHT, "min_points": MIN_SEEN},
    }
    results = kept(options.json, protocol)
    folders = find_captures(options.captures)
    jobs = [Job(folder, part, options) for part in ("trials", "survey") for folder in folders]
    jobs = [job for job in jobs if name(job.folder) not in results[job.part]]
    with Progress() as progress:
        task = progress.add_task("captures", total=len(jobs))

        def keep(job: Job, result: dict) -> None:
            results[job.part][name(job.folder)] = result
            write(options.json, results)
            progress.advance(task)

        def stop(job: Job, error: Exception) -> None:
            raise error

        LocalExecutor(options.workers).run(work, jobs, keep, stop)
    for part in ("trials", "survey"):
        results[part] = {name(folder): results[part][name(folder)] for folder in folders}
    results["summary"] = summarise(results)
    write(options.json, results)
    show(results)


@lru_cache(maxsize=1)
def load(weights: Path | None) -> tuple[Planner, Hand]:
    """What a process needs once."""
    torch.set_num_threads(1)
    network = FFHNet.from_pretrained(weights)
    hand = load_hand(network.info.hand)
    return Planner(network, hand), hand


def name(folder: Path) -> str:
    return f"{folder.parent.name}/{folder.name}"


def work(job: Job) -> dict:
    """Results as they stand in the file."""
    options = job.options
    planner, hand = load(options.weights)
    capture = read_capture(job.folder)
    if job.part == "survey":
        seen = survey(capture, planner, options.samples)
        return {
            "good": seen.good,
            "refusal": seen.refusal,
            "found": [{**asdict(one), "obstacle": one.obstacle} for one in seen.found],
            "masked": [{**asdict(one), "obstacle": one.obstacle} for one in seen.masked],
        }
    runs = {}
    for target in capture.registered:
        physics = CapturePhysics(capture, target, hand, planner)
        rows = [physics.run(seed, options.samples) for seed in range(options.seeds)]
        runs[target.name] = [{**asdict(row), "success": row.success} for row in rows]
    return runs


def kept(path: Path, protocol: dict) -> dict:
    """Results of an earlier run by the same protocol, or none."""
    if path.exists():
        results: dict = json.loads(path.read_text())
        if results["protocol"] == protocol:
            return results
    return {"protocol": protocol, "summary": None, "trials": {}, "survey": {}}


def write(path: Path, results: dict) -> None:
    path.write_text(json.dumps(results, indent=1) + "\n")


def summarise(results: dict) -> dict:
    """Counts over all captures, all clearly graspable objects and all trials."""
    rows = list(results["survey"].values())
    clear = {
        kind: [one for row in rows for one in row[kind] if one["obstacle"] is None]
        for kind in ("found", "masked")
    }
    trials = [trial for runs in results["trials"].values() for rows in runs.values() for trial in rows]
    won = sum(trial["success"] for trial in trials)
    interval = wilson_interval(won, len(trials))
    return {
        "captures": len(rows),
        "captures_refused": sum(row["refusal"] is not None for row in rows),
        "captures_good": sum(row["good"] for row in rows),
        **{f"clear_{kind}": len(ones) for kind, ones in clear.items()},
        **{
            f"clear_{kind}_with_grasp": sum(one["feasible"] > 0 for one in ones)
            for kind, ones in clear.items()
        },
        "trials": len(trials),
        "successes": won,
        "success": won / len(trials),
        "success_95": [interval.low, interval.high],
    }


def show(results: dict) -> None:
    console = Console(width=130)
    table = Table("capture", "object", "success", "failures", "moved (mm)", "mask")
    for capture, objects in results["trials"].items():
        for target, runs in objects.items():
            lost = [run["outcome"] for run in runs if not run["success"]]
            causes = ", ".join(f"{cause} {lost.count(cause)}" for cause in sorted(set(lost)))
            moved = f"{1000 * runs[0]['moved']:.0f}"
            masked = "yes" if runs[0]["masked"] else "no"
            table.add_row(capture, target, f"{len(runs) - len(lost)}/{len(runs)}", causes, moved, masked)
    console.print(table)
    for key, value in results["summary"].items():
        console.print(f"{key}: {value}")


if __name__ == "__main__":
    main(tyro.cli(Options))
