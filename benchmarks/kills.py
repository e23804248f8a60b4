"""Kills a generation job at random moments, resumes it, and compares it with one that nobody disturbed.

    python benchmarks/kills.py --kills 20

Prints what was killed and whether the files are the same, byte for byte; leaves with status 1 where not.
Needs /proc (Linux).
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pyarrow.parquet as pq
import tyro

_SETTINGS = ("--placements=1", "--views=2", "--heuristic=4", "--power=4", "--perturb=4")


@dataclass(frozen=True)
class Options:
    """Random kills of a generation job."""

    kills: int = 20
    """Processes to kill, in as many jobs as it takes."""
    objects: int = 12
    """Objects of each job."""
    workers: int = 2
    """Workers of each job."""
    executor: Literal["local", "ray"] = "local"
    """Where the jobs run."""
    longest: float = 10.0
    """Kills are up to this many seconds apart, uniformly."""
    seed: int = 0
    """Of times and victims."""


def main(options: Options) -> None:
    chance = random.Random(options.seed)
    killed = {"driver": 0, "worker": 0}
    longest_orphan, jobs, same, starts = 0.0, 0, True, 0
    with tempfile.TemporaryDirectory() as folder:
        undisturbed = Path(folder) / "undisturbed"
        _start(undisturbed, options).wait()
        expected = _contents(undisturbed)
        if len(expected) != 2 * options.objects:
            sys.exit(f"the undisturbed job wrote {len(expected)} files for {options.objects} objects")
        while sum(killed.values()) < options.kills:
            out = Path(folder) / f"disturbed-{jobs}"
            jobs += 1
            while len(list(out.glob("trials/[!.]*.parquet"))) < options.objects:
                driver, starts = _start(out, options), starts + 1
                while sum(killed.values()) < options.kills:
                    try:
                        driver.wait(timeout=chance.uniform(0, options.longest))
                        break
                    except subprocess.TimeoutExpired:
                        workers = _workers(driver.pid)
                    victim = chance.choice([driver.pid, *workers])
                    if victim == driver.pid:
                        driver.kill()
                        killed["driver"] += 1
                        longest_orphan = max(longest_orphan, _seconds_until_gone(workers))
                        break
                    _kill(victim)
                    killed["worker"] += 1
                if driver.wait() > 0:
                    sys.exit(f"a job that was not killed ended with status {driver.returncode}")
            same = same and _contents(out) == expected
        rows = {path.stem: pq.read_metadata(path).num_rows for path in undisturbed.glob("trials/*.parquet")}
    report = {
        "executor": options.executor,
        "kills": killed,
        "jobs": jobs,
        "starts": starts,
        "objects": len(rows),
        "rows": sum(rows.values()),
        "longest_orphan_s": round(longest_orphan, 2),
        "identical": same,
    }
    print(json.dumps(report, indent=2))
    sys.exit(0 if same else 1)


def _start(out: Path, options: Options) -> subprocess.Popen:
    program = "from ffhnet.apps.cli import main; main()"
    objects = ["--objects", f"procedural-test:{options.objects}"]
    where = ["--executor", options.executor, "--workers", str(options.workers)]
    return subprocess.Popen(
        [sys.executable, "-c", program, "generate", str(out), *objects, *where, *_SETTINGS],
        stdout=subprocess.DEVNULL,
    )


def _contents(out: Path) -> dict[str, bytes]:
    """Every file of a job, hidden ones too, but for its lock."""
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file() and path.name not in (".lock", "dataset.json")
    }


def _workers(driver: int) -> list[int]:
    """Worker processes below a driver."""
    commands = {pid: Path(f"/proc/{pid}/cmdline") for pid in _descendants(driver)}
    return [pid for pid, file in commands.items() if _is_worker(file)]


def _is_worker(command: Path) -> bool:
    try:
        text = command.read_bytes()
    except OSError:
        return False
    return b"spawn_main" in text or text.startswith(b"ray::")


def _descendants(pid: int) -> list[int]:
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:
        return []
    return children + [below for child in children for below in _descendants(child)]


def _kill(pid: int) -> None:
    # It may have ended by itself meanwhile.
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def _seconds_until_gone(pids: list[int]) -> float:
    start = time.monotonic()
    while any(_is_worker(Path(f"/proc/{pid}/cmdline")) for pid in pids):
        if time.monotonic() - start > 60:
            sys.exit(f"workers {pids} went on for a minute after their driver was killed")
        time.sleep(0.02)
    return time.monotonic() - start


if __name__ == "__main__":
    main(tyro.cli(Options))
