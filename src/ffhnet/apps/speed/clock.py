"""Timing things that run in turns, so that what else the machine does slows all of them alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median, quantiles


@dataclass(frozen=True)
class Times:
    """Milliseconds of each counted round."""

    ms: tuple[float, ...]

    @property
    def median(self) -> float:
        """Middle round."""
        return median(self.ms)

    def times_faster(self, than: Times) -> float:
        """Median over rounds of how many times longer `than` took in the same round."""
        return median(slow / quick for slow, quick in zip(than.ms, self.ms, strict=True))

    def to_json(self) -> dict[str, float]:
        """Median, quartiles and fastest round, ms."""
        low, _, high = quantiles(self.ms, n=4) if len(self.ms) > 1 else self.ms * 3
        return {"median": self.median, "quartile_1": low, "quartile_3": high, "fastest": min(self.ms)}


@dataclass(frozen=True)
class Clock:
    """How often to measure, and with which clock.

    Attributes:
        rounds: that count.
        now: seconds; `time.process_time` makes sense of a busy machine, but not of several threads.
    """

    rounds: int
    now: Callable[[], float] = time.perf_counter

    def in_turns(self, ways: Mapping[str, Callable[[], object]], warm_up: int = 2) -> dict[str, Times]:
        """The times of each way, in rounds in which all of them run once; the first few do not count."""
        kept: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(warm_up + self.rounds):
            for name, way in ways.items():
                start = self.now()
                way()
                kept[name].append(1e3 * (self.now() - start))
        return {name: Times(tuple(values[warm_up:])) for name, values in kept.items()}
