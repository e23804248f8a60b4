"""Does to jobs and files what labs do to them, and counts what is survived.

    python benchmarks/faults.py --kills 20 --flips 200 --json faults.json

A job that was killed is started again until it ends, and must end in the same files as one that nobody
disturbed. Evaluation keeps no state: it begins anew, and its file is there whole or not at all. Kills of data
generation have a file of their own, `kills.py`. Leaves with status 1 where anything was not survived.
Linux only.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import absent

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from injections import contents, fill_disk, flip_bit
from writers import CHECKED, WRITERS

TESTS = Path(__file__).parents[1] / "tests"
COMMAND = "from ffhnet.apps.cli import main; main()"
JUMPS = """
import random, time
real, chance = time.time, random.Random(0)
time.time = lambda: real() + chance.choice((-1e9, -3600.0, 0.0, 3600.0, 1e9))
"""
"""Lets the clock of the day jump by up to 30 years at every look."""

TRAIN = """
import sys, torch
sys.path.append({tests!r})
from pathlib import Path
from conftest import JOINT_LIMITS, MODEL, point_world
from ffhnet.errors import FFHNetError
from ffhnet.training import TrainingConfig, train_evaluator
torch.set_num_threads(1)
config = TrainingConfig(model=MODEL, steps={steps}, views=15, grasps=16, metrics_every=100, state_every=5)
try:
    train_evaluator(point_world(0), None, config, Path({out!r}), JOINT_LIMITS, progress=False)
except FFHNetError as error:
    sys.exit(str(error))
"""

Start = Callable[[Path, str], subprocess.Popen]


@dataclass(frozen=True)
class Options:
    """Injected faults."""

    kills: int = 20
    """Of training, and half as many of evaluation."""
    steps: int = 1500
    """Of each training."""
    flips: int = 200
    """Turned bits in each file."""
    pairs: int = 5
    """Of jobs that begin at once in one folder."""
    seed: int = 0
    """Of times and places."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the counts to this file."""


def main(options: Options) -> None:
    report = {}
    with tempfile.TemporaryDirectory() as place:
        for name, counts in injected(Path(place), options):
            report[name] = counts
            print(f"{name}: {', '.join(f'{number} {what}' for what, number in counts.items())}", flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    good = {"refused", "found", "harmless", "the same files", "one refused, the other the same files"}
    sys.exit(int(any(outcome not in good for counts in report.values() for outcome in counts)))


def injected(root: Path, options: Options) -> Iterator[tuple[str, Counter[str]]]:
    """One kind of fault after the other, with what came of it and how often."""
    chance = random.Random(options.seed)
    yield from full_disks(root)
    yield from turned_bits(root, options.flips, chance)
    jobs: dict[str, Start] = {
        "training": lambda out, before: train(out, options.steps, before),
        "evaluation": evaluate,
    }
    for (name, start), kills in zip(jobs.items(), (options.kills, options.kills // 2), strict=True):
        usual, seconds = undisturbed(root / f"{name} alone", start)
        yield f"clock that jumps in {name}", jumped(root / f"{name} jumps", start, usual)
        if name == "training":
            yield "two trainings in one folder", together(root / "two", start, usual, options.pairs)
        yield f"kill -9 of {name}", killed(root / name, start, usual, seconds, kills, chance)


def full_disks(root: Path) -> Iterator[tuple[str, Counter[str]]]:
    """Every writer where a file may take up 0 to 99 % of what it needs."""
    for writer in WRITERS:
        folder = root / f"full {writer.name}"
        folder.mkdir()
        writer.write(folder)
        shares = [k / 20 for k in range(20)] + [0.99]
        yield f"full disk: {writer.name}", Counter(fill_disk(writer, folder, share) for share in shares)


def turned_bits(root: Path, flips: int, chance: random.Random) -> Iterator[tuple[str, Counter[str]]]:
    """Every file that has checksums, with one bit turned at a time."""
    for writer in CHECKED:
        folder = root / f"bits {writer.name}"
        folder.mkdir()
        writer.write(folder)
        for name in writer.files:
            outcomes = (flip_bit(writer, folder, name, chance) for _ in range(flips))
            yield f"turned bit: {writer.name}, {name}", Counter(outcomes)


def train(out: Path, steps: int, before: str) -> subprocess.Popen:
    program = TRAIN.format(tests=str(TESTS / "training"), steps=steps, out=str(out))
    return subprocess.Popen([sys.executable, "-c", before + program], stderr=subprocess.PIPE, text=True)


def evaluate(out: Path, before: str) -> subprocess.Popen:
    out.mkdir(exist_ok=True)
    settings = ["--objects", "procedural-test:2", "--placements", "1", "--samples", "10", "--heuristic", "2"]
    command = [
        "evaluate",
        *settings,
        "--full-views",
        "0",
        "--workers",
        "1",
        "--json",
        str(out / "table.json"),
    ]
    return subprocess.Popen(
        [sys.executable, "-c", before + COMMAND, *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def undisturbed(out: Path, start: Start) -> tuple[dict[str, bytes], float]:
    """The files of a job and how many seconds it takes."""
    begin = time.monotonic()
    ended = start(out, "")
    _, message = ended.communicate()
    if ended.returncode != 0:
        sys.exit(f"a job that nobody disturbed ended with status {ended.returncode}: {message}")
    return contents(out), time.monotonic() - begin


def killed(
    root: Path, start: Start, usual: dict[str, bytes], seconds: float, kills: int, chance: random.Random
) -> Counter[str]:
    """Jobs killed at random moments and begun again, up to the number of kills."""
    outcomes: Counter[str] = Counter()
    done = jobs = 0
    while done < kills:
        out, before = root.with_name(f"{root.name} {jobs}"), done
        jobs += 1
        while True:
            process = start(out, "")
            if done < kills:
                try:
                    process.communicate(timeout=chance.uniform(0, seconds))
                except subprocess.TimeoutExpired:
                    process.kill()
                    done += 1
            _, message = process.communicate()
            if process.returncode == 0:
                break
            if process.returncode != -9:
                outcomes[f"ended with {process.returncode}: {message[-80:]}"] += 1
                break
        found = contents(out)
        same = {name: found.get(name) for name in usual} == usual
        outcomes["the same files" if same else "other files"] += done - before
    return +outcomes


def jumped(out: Path, start: Start, usual: dict[str, bytes]) -> Counter[str]:
    """One job whose clock jumps."""
    process = start(out, JUMPS)
    process.communicate()
    return Counter(["the same files" if contents(out) == usual else "other files"])


def together(root: Path, start: Start, usual: dict[str, bytes], pairs: int) -> Counter[str]:
    """Two jobs at once in one folder: the later one must say so and leave, the other must not notice."""
    outcomes: Counter[str] = Counter()
    for number in range(pairs):
        out = root.with_name(f"{root.name} {number}")
        both = [start(out, "") for _ in range(2)]
        ends = sorted((process.communicate()[1], process.returncode) for process in both)
        refused = [message for message, status in ends if status == 1 and "another process" in message]
        good = [status for _, status in ends].count(0) == 1 and len(refused) == 1 and contents(out) == usual
        outcomes["one refused, the other the same files" if good else f"{ends}"] += 1
    return outcomes


if __name__ == "__main__":
    main(tyro.cli(Options))
