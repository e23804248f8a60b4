"""The smallest pieces of the tables: counts of grasps with their rates and intervals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ffhnet.evaluation import bootstrap
from ffhnet.evaluation.outcomes import Tries, ViewOutcome
from ffhnet.metrics import Interval, wilson_interval


@dataclass(frozen=True)
class Estimate:
    """A figure and its 95 % interval by bootstrap over objects (None of a single object)."""

    value: float
    interval: Interval | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"value": self.value, "bootstrap95": as_list(self.interval)}


@dataclass(frozen=True)
class Cell:
    """Grasps that a rule kept: how many, how many of them lifted the object, out of how many.

    Attributes:
        kept: grasps tried, start collisions included.
        successes: grasps that lifted the object.
        collisions: of the kept, those whose start collided (failures here, left out in the paper).
        total: grasps that the rule chose from.
        interval: of the rate, 95 % by bootstrap over objects; None of a single object.
        interval_executed: the same of the rate without start collisions.
    """

    kept: int
    successes: int
    collisions: int
    total: int
    interval: Interval | None = None
    interval_executed: Interval | None = None

    @property
    def rate(self) -> float:
        """Success rate, start collisions counted as failures; NaN if nothing was kept."""
        return self.successes / self.kept if self.kept else float("nan")

    @property
    def rate_executed(self) -> float:
        """Success rate without start collisions, as the paper counts; NaN if nothing was executed."""
        executed = self.kept - self.collisions
        return self.successes / executed if executed else float("nan")

    @property
    def retained(self) -> float:
        """Share of the grasps that was kept."""
        return self.kept / self.total if self.total else float("nan")

    @property
    def wilson(self) -> Interval:
        """95 % Wilson interval, as if all grasps were independent: too narrow, but defined at 100 %."""
        return wilson_interval(self.successes, self.kept)

    def to_json(self) -> dict[str, Any]:
        """The contract's keys and more."""
        return {
            "executed": self.kept,
            "successes": self.successes,
            "start_collisions": self.collisions,
            "retained": self.retained,
            "rate": self.rate,
            "bootstrap95": as_list(self.interval),
            "wilson95": as_list(self.wilson),
            "rate_without_collisions": self.rate_executed,
            "bootstrap95_without_collisions": as_list(self.interval_executed),
        }


def as_list(interval: Interval | None) -> list[float] | None:
    """For JSON."""
    return None if interval is None else [interval.low, interval.high]


def count(kept: Tries, total: int | None = None) -> Cell:
    """The cell of some grasps out of `total` (all if None), without an interval."""
    return Cell(
        kept=len(kept),
        successes=int(kept.success.sum()),
        collisions=int((~kept.executed).sum()),
        total=len(kept) if total is None else total,
    )


def pool(cells: Sequence[Cell]) -> Cell:
    """One cell of one per object, with intervals."""
    kept, successes, collisions, total = (
        np.array([getattr(cell, name) for cell in cells], dtype=int)
        for name in ("kept", "successes", "collisions", "total")
    )
    return Cell(
        int(kept.sum()),
        int(successes.sum()),
        int(collisions.sum()),
        int(total.sum()),
        bootstrap.interval(bootstrap.ratio(successes, kept), len(cells)),
        bootstrap.interval(bootstrap.ratio(successes, kept - collisions), len(cells)),
    )


@dataclass(frozen=True)
class Drawn:
    """The drawn samples of some views in one table: what rates and calibration are counted on.

    Attributes:
        probability: predicted success probability.
        score: what the network ranks by.
        tries: what became of them.
    """

    probability: Float[np.ndarray, " N"]
    score: Float[np.ndarray, " N"]
    tries: Tries

    @classmethod
    def of(cls, views: Sequence[ViewOutcome]) -> Drawn:
        """Of all these views."""
        samples = [view.samples for view in views]
        return cls(
            np.concatenate([s.probability[s.drawn] for s in samples]),
            np.concatenate([s.score[s.drawn] for s in samples]),
            Tries.join([s.tries[s.drawn] for s in samples]),
        )

    @property
    def order(self) -> np.ndarray:
        """Best score first."""
        return np.argsort(-self.score, kind="stable")

    def __len__(self) -> int:
        return len(self.score)


def best_of_each(drawn: Sequence[Drawn], share: float) -> Cell:
    """Each object's own best share, pooled: every object gives the same part of its samples."""
    return pool([count(d.tries[d.order[: round(share * len(d))]], total=len(d)) for d in drawn])


def best_of_all(drawn: Sequence[Drawn], shares: Sequence[float]) -> list[Cell]:
    """The best shares of all samples together: easy objects give more of them."""
    score = np.concatenate([d.score for d in drawn])
    order = np.argsort(-score, kind="stable")
    owner = np.repeat(np.arange(len(drawn)), [len(d) for d in drawn])[order]
    tries = Tries.join([d.tries for d in drawn])[order]
    draws = bootstrap.object_draws(len(drawn)) if len(drawn) > 1 else np.zeros((0, 1), dtype=int)
    # D × 2 × S: rates with and without start collisions.
    rates = np.array([_best_rates(draw[owner], tries, shares) for draw in draws]).reshape(-1, 2, len(shares))
    cells = []
    for i, share in enumerate(shares):
        best = count(tries[: round(share * len(score))], total=len(score))
        with_collisions, without = (bootstrap.interval(rates[:, k, i], len(drawn)) for k in range(2))
        cells.append(dataclasses.replace(best, interval=with_collisions, interval_executed=without))
    return cells


def _best_rates(
    weight: Int[np.ndarray, " N"], tries: Tries, shares: Sequence[float]
) -> Float[np.ndarray, "2 S"]:
    """Success of the best shares where each sample occurs `weight` times, with and without collisions."""
    kept, successes, executed = (
        np.concatenate([[0], np.cumsum(weight * column)]) for column in (1, tries.success, tries.executed)
    )
    wanted = [round(share * kept[-1]) for share in shares]
    ends = np.searchsorted(kept, wanted, side="right") - 1
    with np.errstate(invalid="ignore"):
        return successes[ends] / np.stack([kept[ends], executed[ends]])
