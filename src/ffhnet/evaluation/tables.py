"""Table I and II from the outcomes of an evaluation: counts, rates, intervals, JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffhnet.evaluation.protocol import ViewOutcome
from ffhnet.metrics import auroc, expected_calibration_error, wilson_interval

THRESHOLDS = (0.0, 0.5, 0.7, 0.9, 0.95)
"""Columns of Table I."""

KEPT_SHARES = (0.28, 0.05)
"""What the paper's thresholds 0.9 and 0.95 kept: comparable between evaluators, unlike thresholds."""


@dataclass(frozen=True)
class Cell:
    """Grasps that a rule kept: how many, how many of them lifted the object, out of how many.

    Attributes:
        kept: grasps tried, start collisions included.
        successes: grasps that lifted the object.
        collisions: of the kept, those whose start collided (failures here, left out in the paper).
        total: grasps that the rule chose from.
    """

    kept: int
    successes: int
    collisions: int
    total: int

    @property
    def rate(self) -> float:
        """Success rate, start collisions counted as failures; NaN if nothing was kept."""
        return self.successes / self.kept if self.kept else float("nan")

    @property
    def retained(self) -> float:
        """Share of the grasps that was kept."""
        return self.kept / self.total if self.total else float("nan")

    def to_json(self) -> dict[str, Any]:
        """The contract's keys, with the 95 % Wilson interval over grasps."""
        interval = wilson_interval(self.successes, self.kept)
        return {
            "executed": self.kept,
            "successes": self.successes,
            "start_collisions": self.collisions,
            "retained": self.retained,
            "interval95": [interval.low, interval.high],
        }


@dataclass(frozen=True)
class Row:
    """All cells of one object, or of all objects together.

    Attributes:
        name: of the object, or "total".
        views: number of views.
        thresholds: one cell per threshold of `THRESHOLDS`.
        best: one cell per share of `KEPT_SHARES`, the row's own best grasps.
        top1: the highest-rated grasp of each view.
        heuristic: the paper's sampler after its collision filter.
    """

    name: str
    views: int
    thresholds: tuple[Cell, ...]
    best: tuple[Cell, ...]
    top1: Cell
    heuristic: Cell

    def to_json(self) -> dict[str, Any]:
        """The contract's keys."""
        return {
            "placements": self.views,
            "thresholds": {str(t): c.to_json() for t, c in zip(THRESHOLDS, self.thresholds, strict=True)},
            "best": {str(s): c.to_json() for s, c in zip(KEPT_SHARES, self.best, strict=True)},
            "top1": self.top1.to_json(),
            "heuristic": self.heuristic.to_json(),
        }


@dataclass(frozen=True)
class Table:
    """Table I: a row per object and one for all, with the evaluator's quality on these samples.

    Attributes:
        rows: per object.
        total: all grasps together.
        auroc_executed, auroc_all: of the predicted probabilities, without and with start collisions.
        ece: expected calibration error over all samples.
    """

    rows: tuple[Row, ...]
    total: Row
    auroc_executed: float
    auroc_all: float
    ece: float

    def mean_rate(self, column: int) -> float:
        """Mean over objects of a threshold's success rate, as the paper averages; empty cells left out."""
        rates = [row.thresholds[column].rate for row in self.rows]
        return float(np.nanmean(rates)) if not np.isnan(rates).all() else float("nan")

    def to_json(self, protocol: dict[str, Any]) -> str:
        """JSON text of the command contract."""
        content = {
            "protocol": protocol,
            "objects": {row.name: row.to_json() for row in self.rows},
            "total": self.total.to_json(),
            "evaluator": {
                "auroc_executed": self.auroc_executed,
                "auroc_all": self.auroc_all,
                "ece": self.ece,
            },
        }
        return json.dumps(_without_nan(content), indent=2) + "\n"


def make_table(outcomes: Sequence[ViewOutcome]) -> Table:
    """The table of all views; objects in the order in which they first appear."""
    names = list(dict.fromkeys(outcome.object_name for outcome in outcomes))
    probability, success, executed = _columns(outcomes)
    return Table(
        rows=tuple(_row(name, [o for o in outcomes if o.object_name == name]) for name in names),
        total=_row("total", outcomes),
        auroc_executed=auroc(success[executed].astype(float), probability[executed]),
        auroc_all=auroc(success.astype(float), probability),
        ece=expected_calibration_error(success.astype(float), probability),
    )


def _columns(outcomes: Sequence[ViewOutcome]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        np.concatenate([o.probability for o in outcomes]),
        np.concatenate([o.success for o in outcomes]),
        np.concatenate([o.executed for o in outcomes]),
    )


def _row(name: str, outcomes: Sequence[ViewOutcome]) -> Row:
    probability, success, executed = _columns(outcomes)

    def cell(chosen: np.ndarray, total: int) -> Cell:
        return Cell(
            kept=len(probability[chosen]),
            successes=int(success[chosen].sum()),
            collisions=int((~executed[chosen]).sum()),
            total=total,
        )

    everything, order = len(probability), np.argsort(-probability, kind="stable")
    ends = np.cumsum([len(o.probability) for o in outcomes])
    starts = ends - [len(o.probability) for o in outcomes]
    first = np.array([s + int(np.argmax(probability[s:e])) for s, e in zip(starts, ends, strict=True)])
    heuristic = np.concatenate([o.heuristic_success for o in outcomes])
    return Row(
        name=name,
        views=len(outcomes),
        thresholds=tuple(cell(np.flatnonzero(probability >= t), everything) for t in THRESHOLDS),
        best=tuple(cell(order[: round(share * everything)], everything) for share in KEPT_SHARES),
        top1=cell(first, len(first)),
        heuristic=Cell(len(heuristic), int(heuristic.sum()), 0, len(heuristic)),
    )


def _without_nan(value: Any) -> Any:
    """NaN is no JSON: empty rates become null."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
