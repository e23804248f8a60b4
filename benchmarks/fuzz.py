"""Damages the inputs of every door and counts what comes of it.

    python benchmarks/fuzz.py --inputs 2000 --json fuzz.json

Each door has a process of its own, which may take 1 GiB more memory than it has after opening a valid input,
write files of 64 MiB, and take 5 s of processor time for an input. Anything but an opened input or a typed
error is a fault; a process that dies or hangs is one as well, and the next takes over. The same number is the
same damage, so that a fault can be repeated with --first and --inputs 1. Leaves with status 1 where there was
any fault. Linux only.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from ffhnet.apps.console import absent, print_table
from ffhnet.errors import FFHNetError

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from doors import DOORS, Door
from limits import SECONDS, Hang, limits

SPAWN = multiprocessing.get_context("spawn")
REPORT = "report.json"
FILE_SIZE = 2**26
"""Bytes of a file that may be written."""


@dataclass(frozen=True)
class Options:
    """Damaged inputs at every door."""

    inputs: int = 2000
    """For each door."""
    first: int = 0
    """Number of the first one."""
    door: str = ""
    """Only doors whose name has this in it."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the counts to this file."""


def main(options: Options) -> None:
    doors = [door for door in DOORS if options.door in door.name]
    report = {door.name: fuzz(door, options.first, options.inputs) for door in doors}
    rows = [
        [name, *(str(c[k]) for k in ("inputs", "opened", "refused")), str(sum(c["faults"].values())),
         f"{c['slowest_s']:.2f}", f"{c['grown_mb']:.0f}"]
        for name, c in report.items()
    ]  # fmt: skip
    columns = ("door", "inputs", "opened", "refused", "faults", "slowest (s)", "grown (MB)")
    print_table("Damaged inputs", columns, rows)
    faults = {name: counts["faults"] for name, counts in report.items() if counts["faults"]}
    for name, found in faults.items():
        for fault, count in found.items():
            print(f"{name}: {count} x {fault}")
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    sys.exit(1 if faults else 0)


def fuzz(door: Door, first: int, inputs: int) -> dict[str, Any]:
    """The counts of one door, from as many processes as it takes."""
    total = nothing()
    while total["inputs"] < inputs:
        with tempfile.TemporaryDirectory() as folder:
            begin, rest = first + total["inputs"], inputs - total["inputs"]
            process = SPAWN.Process(target=work, args=(door.name, Path(folder), begin, rest))
            process.start()
            process.join()
            counts = json.loads((Path(folder) / REPORT).read_text())
        if process.exitcode != 0:
            # The report is that before the input which was the process's last.
            ended = f"process ended with {process.exitcode} at input {begin + counts['inputs']}"
            counts["faults"][ended] = 1
            counts["inputs"] += 1
        for name in ("inputs", "opened", "refused"):
            total[name] += counts[name]
        for name in ("slowest_s", "grown_mb"):
            total[name] = max(total[name], counts[name])
        for fault, count in counts["faults"].items():
            total["faults"][fault] = total["faults"].get(fault, 0) + count
    return total


def nothing() -> dict[str, Any]:
    """Counts of no inputs."""
    return {"inputs": 0, "opened": 0, "refused": 0, "faults": {}, "slowest_s": 0.0, "grown_mb": 0.0}


def work(name: str, place: Path, first: int, inputs: int) -> None:
    """Open damaged inputs one after the other; the report is always up to date."""
    door = next(door for door in DOORS if door.name == name)
    warnings.simplefilter("ignore")
    logging.disable()
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_SIZE, FILE_SIZE))
    folder = place / "input"
    folder.mkdir()
    # MuJoCo writes a log of its warnings where it is.
    os.chdir(place)
    door.build(folder)
    door.open(folder)
    before = peak_mb()
    counts = nothing()
    report = place / REPORT
    for number in range(first, first + inputs):
        report.write_text(json.dumps(counts))
        attempt(door, folder, number, counts)
        counts["inputs"] += 1
        counts["grown_mb"] = max(counts["grown_mb"], peak_mb() - before)
    report.write_text(json.dumps(counts))


def attempt(door: Door, folder: Path, number: int, counts: dict[str, Any]) -> None:
    """One damaged input; adds to the counts."""
    # Code that never comes back to Python is ended by the system.
    signal.setitimer(signal.ITIMER_VIRTUAL, 2 * SECONDS)
    start = time.process_time()
    try:
        with limits():
            door.attempt(folder, number)
        counts["opened"] += 1
    except FFHNetError:
        counts["refused"] += 1
    except (Exception, Hang) as error:
        fault = f"{type(error).__name__} {str(error)[:80]}"
        counts["faults"][fault] = counts["faults"].get(fault, 0) + 1
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    counts["slowest_s"] = max(counts["slowest_s"], time.process_time() - start)


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000


if __name__ == "__main__":
    main(tyro.cli(Options))
