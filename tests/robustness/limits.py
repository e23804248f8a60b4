"""Bounds for what opens the files of others, in the process that does it (Linux)."""

from __future__ import annotations

import contextlib
import resource
import signal
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

MEMORY = 2**30
"""Bytes that opening a small file may take on top of what the process has."""

SECONDS = 5.0
"""Processor time that it may take: on a crowded machine the clock on the wall says nothing."""


class Hang(BaseException):
    """The time is over. Nobody who catches `Exception` can swallow it."""


@contextlib.contextmanager
def limits(memory: int = MEMORY, seconds: float = SECONDS) -> Iterator[None]:
    """Raises Hang, or lets MemoryError be raised, where the bounds are passed inside."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    previous = signal.signal(signal.SIGPROF, _hang)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + memory, before[1]))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.signal(signal.SIGPROF, previous)


def _hang(_number: int, _frame: FrameType | None) -> None:
    raise Hang
