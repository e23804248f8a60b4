"""Cheap units of work for worker processes, and an executor that needs none."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from ffhnet.dataset.executors.base import attempt
from ffhnet.errors import ObjectError


def square(number):
    return number * number


def bad_or_square(number):
    """Two bad units among good ones."""
    if number == 2:
        raise ObjectError("wanted an object, got number two")
    if number == 3:
        raise ValueError("nobody\nforesaw this")
    return square(number)


@dataclass(frozen=True)
class Task:
    """A unit that notes each of its starts in a folder, as a file with its process id."""

    number: int
    notes: Path
    seconds: float = 0.0
    deaths: int = 0
    gate: Path | None = None

    def starts(self):
        return sorted(int(path.name.split("-")[1]) for path in self.notes.glob(f"{self.number}-*-*"))


def noted_square(task):
    """Kills its own process in its first `deaths` starts; then waits for its gate to be there."""
    start = len(task.starts())
    (task.notes / f"{task.number}-{os.getpid()}-{start}").touch()
    if start < task.deaths:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(task.seconds)
    while task.gate is not None and not task.gate.exists():
        time.sleep(0.02)
    return square(task.number)


def process_id(number):
    time.sleep(0.01)
    return os.getpid()


class HereExecutor:
    """Runs units in this process, where starting others would add nothing to a test."""

    def run(self, work, jobs, on_result, on_error):
        for job in jobs:
            attempt(work, job).report(job, on_result, on_error)
