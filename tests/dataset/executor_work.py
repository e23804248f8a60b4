"""Cheap units of work for the tests of executors; importable by worker processes."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

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

    def starts(self):
        return sorted(int(path.name.split("-")[1]) for path in self.notes.glob(f"{self.number}-*-*"))


def noted_square(task):
    """Kills its own process in its first `deaths` starts."""
    start = len(task.starts())
    (task.notes / f"{task.number}-{os.getpid()}-{start}").touch()
    if start < task.deaths:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(task.seconds)
    return square(task.number)


def process_id(number):
    time.sleep(0.01)
    return os.getpid()
