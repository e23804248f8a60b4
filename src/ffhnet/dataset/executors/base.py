"""What executors have in common: how a unit of work ends, and when it is given up."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, cast

from ffhnet.errors import FFHNetError

Job = TypeVar("Job")
Result = TypeVar("Result")

MAX_LOSSES = 3
"""A unit whose worker died this many times is given up: it is likely to be what kills them."""

UNITS_PER_WORKER = 200
"""A worker process is replaced after so many units, so that no leak in any library adds up."""


class WorkerLostError(FFHNetError):
    """The workers that had a unit died before it was done, `MAX_LOSSES` times."""


class UnexpectedError(Exception):
    """A unit raised what no bad input should: the first line says what, the rest is the traceback there."""


class Executor(Protocol):
    """Somewhere to run units of work."""

    def run(
        self,
        work: Callable[[Job], Result],
        jobs: Sequence[Job],
        on_result: Callable[[Job, Result], None],
        on_error: Callable[[Job, Exception], None],
    ) -> None:
        """Calls `work(job)` for every job in other processes, in any order.

        Exactly one of the two functions is called here, in the calling thread, as each job ends. What they
        raise stops the rest of the work and is raised here. A unit whose worker dies is run again.

        Args:
            work: a module-level function.
            jobs: its arguments, one per unit.
            on_result: called with job and result.
            on_error: called with the job and the FFHNetError that `work` raised, a WorkerLostError where the
                unit was given up, or an UnexpectedError where `work` raised anything else.
        """


@dataclass(frozen=True)
class Outcome(Generic[Result]):
    """How a unit ended: with an error, or else with a result."""

    result: Result | None
    error: Exception | None = None

    def report(
        self, job: Job, on_result: Callable[[Job, Result], None], on_error: Callable[[Job, Exception], None]
    ) -> None:
        """Calls one of the two."""
        if self.error is None:
            on_result(job, cast(Result, self.result))
        else:
            on_error(job, self.error)


def attempt(work: Callable[[Job], Result], job: Job) -> Outcome[Result]:
    """Calls `work(job)` in a worker; an error comes back as a value that surely travels between processes."""
    try:
        return Outcome(work(job))
    except FFHNetError as error:
        return Outcome(None, error)
    except Exception as error:
        summary = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(None, UnexpectedError(f"{summary}\n{traceback.format_exc()}"))


class Losses:
    """Counts the workers that died with each unit."""

    def __init__(self) -> None:
        self._count: Counter[int] = Counter()

    def add(self, unit: int, cause: str) -> Outcome | None:
        """Counts one more: how the unit ends where it is given up, or None where it is to be run again."""
        self._count[unit] += 1
        if self._count[unit] < MAX_LOSSES:
            return None
        return Outcome(None, WorkerLostError(f"its worker died {MAX_LOSSES} times, the last time {cause}"))
