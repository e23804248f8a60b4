"""The tables: every figure of an evaluation with its counts and intervals, and their JSON.

Rates, thresholds, kept shares and calibration are counted on the drawn samples, a random subset of the same
size on each view; top-1 and top-5, the blind controls and stress on the groups of `Condition`; distinct
grasps and grasp types on full views.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffhnet.evaluation import bootstrap
from ffhnet.evaluation.calibration import Calibration, measure_calibration
from ffhnet.evaluation.cells import Cell, Drawn, Estimate, best_of_all, best_of_each, count, pool
from ffhnet.evaluation.outcomes import Condition, Tries, UnseenView, ViewOutcome

THRESHOLDS = (0.0, 0.5, 0.7, 0.9, 0.95)
"""Columns of Table I."""

KEPT_SHARES = (0.83, 0.73, 0.5, 0.28, 0.1, 0.05)
"""What the paper's thresholds 0.5, 0.7, 0.9 and 0.95 kept, and two more: comparable between evaluators, which
thresholds are not."""

SURE = (0.25, 0.5, 0.75, 0.9)
"""Scores below which a careful robot might not execute the best grasp of a view."""

WORST_SHARE = 0.28
"""Kept share by which the worst object is told."""

SMALL = 0.04
"""m: objects that lie lower than this on the table are small."""


@dataclass(frozen=True)
class KeptShare:
    """Success of the best grasps by the network's score.

    Attributes:
        share: of the drawn samples that is kept.
        everywhere: the best of all samples together.
        own: each object's own best, pooled.
    """

    share: float
    everywhere: Cell
    own: Cell

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"global": self.everywhere.to_json(), "own": self.own.to_json()}


@dataclass(frozen=True)
class ConditionCells:
    """The groups of `Condition` over some views.

    Attributes:
        name: of the condition.
        top1: the first grasp of each view.
        top: all its top grasps, five (ten in the strict protocol).
        random: some drawn samples, without those that collide in the nominal world (with them in the strict
            protocol).
        blind_random_yaw, blind_short_side: the blind controls.
        lead: of top-1 over the better of them, as a share.
        sure: the first grasps of the views on which its score reaches each of `SURE`, out of all views; empty
            in the strict protocol, whose first grasp is not the best one.
    """

    name: str
    top1: Cell
    top: Cell
    random: Cell
    blind_random_yaw: Cell
    blind_short_side: Cell
    lead: Estimate
    sure: tuple[Cell, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        groups = ("top1", "top", "random", "blind_random_yaw", "blind_short_side", "lead")
        sure = {f"{score}": cell.to_json() for score, cell in zip(SURE, self.sure, strict=False)}
        return {**{group: getattr(self, group).to_json() for group in groups}, "top1_by_score": sure}


@dataclass(frozen=True)
class CoverageMeans:
    """Means over objects of what full views showed.

    Attributes:
        views: full views.
        stable: of all samples of a view.
        distinct: of these, different ones.
        type_entropy: of the grasp types of the stable ones, bits.
    """

    views: int
    stable: Estimate
    distinct: Estimate
    type_entropy: Estimate

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "full_views": self.views,
            "stable": self.stable.to_json(),
            "distinct": self.distinct.to_json(),
            "type_entropy_bits": self.type_entropy.to_json(),
        }


@dataclass(frozen=True)
class Row:
    """All figures of some views: of one object, of all, of those in one kind of pose.

    Attributes:
        name: of the object or of the kind.
        views, objects: how many.
        thresholds: one cell per threshold of `THRESHOLDS`.
        kept: success against kept share, one entry per share of `KEPT_SHARES`.
        heuristic: the paper's sampler after its collision filter.
        conditions: nominal first, then each stress, then the strict protocol, as far as they were tried.
        coverage: None without full views.
    """

    name: str
    views: int
    objects: int
    thresholds: tuple[Cell, ...]
    kept: tuple[KeptShare, ...]
    heuristic: Cell
    conditions: tuple[ConditionCells, ...]
    coverage: CoverageMeans | None

    @property
    def raw(self) -> Cell:
        """Every drawn sample."""
        return self.thresholds[0]

    @property
    def nominal(self) -> ConditionCells:
        """Top grasps and blind controls in the nominal world."""
        return self.conditions[0]

    def best(self, share: float) -> KeptShare:
        """The entry of one of `KEPT_SHARES`."""
        return self.kept[KEPT_SHARES.index(share)]

    def to_json(self) -> dict[str, Any]:
        """The contract's keys and more."""
        return {
            "placements": self.views,
            "objects": self.objects,
            "thresholds": {f"{t}": c.to_json() for t, c in zip(THRESHOLDS, self.thresholds, strict=True)},
            "top1": self.nominal.top1.to_json(),
            "top5": self.nominal.top.to_json(),
            "kept": {f"{kept.share}": kept.to_json() for kept in self.kept},
            "heuristic": self.heuristic.to_json(),
            "conditions": {condition.name: condition.to_json() for condition in self.conditions},
            "coverage": None if self.coverage is None else self.coverage.to_json(),
        }


@dataclass(frozen=True)
class Table:
    """All tables of an evaluation.

    Attributes:
        rows: per object.
        total: of all views.
        standing, other, small: of the views with the object standing as modelled, in another pose, and
            of those with an object lower than `SMALL`; None where there are none.
        calibration: of the predicted probabilities.
        unseen: views on which nothing could be tried.
    """

    rows: tuple[Row, ...]
    total: Row
    standing: Row | None
    other: Row | None
    small: Row | None
    calibration: Calibration
    unseen: tuple[UnseenView, ...]

    @property
    def worst(self) -> Row:
        """The object whose own best grasps hold least often."""
        return min(self.rows, key=lambda row: _nan_last(row.best(WORST_SHARE).own.rate))

    @property
    def parts(self) -> tuple[Row, ...]:
        """Total first, then standing, other and small as far as there are any."""
        return tuple(row for row in (self.total, self.standing, self.other, self.small) if row is not None)

    def mean_rate(self, column: int) -> float:
        """Mean over objects of a threshold's success rate, as the paper averages; empty cells left out."""
        rates = [row.thresholds[column].rate for row in self.rows]
        return float(np.nanmean(rates)) if not np.isnan(rates).all() else float("nan")

    def to_json(self, protocol: dict[str, Any]) -> str:
        """JSON text of the command contract."""
        content: dict[str, Any] = {
            "protocol": protocol,
            "objects": {row.name: row.to_json() for row in self.rows},
            **{row.name: row.to_json() for row in self.parts},
            "worst_object": {"name": self.worst.name, **self.worst.best(WORST_SHARE).own.to_json()},
            "mean_of_objects": {f"{t}": self.mean_rate(i) for i, t in enumerate(THRESHOLDS)},
            "evaluator": self.calibration.to_json(),
            "unseen_views": [{"object": u.object_name, "pose": u.pose_name} for u in self.unseen],
        }
        return json.dumps(_without_nan(content)) + "\n"


def make_table(outcomes: Sequence[ViewOutcome], unseen: Sequence[UnseenView] = ()) -> Table:
    """The tables of all views; objects in the order in which they first appear."""
    objects = _by_object(outcomes)

    def part(name: str, fits: Callable[[ViewOutcome], bool]) -> Row | None:
        views = [outcome for outcome in outcomes if fits(outcome)]
        return make_row(name, views) if views else None

    return Table(
        rows=tuple(make_row(views[0].object_name, views) for views in objects),
        total=make_row("total", outcomes),
        standing=part("standing", lambda view: view.standing),
        other=part("other", lambda view: not view.standing),
        small=part("small", lambda view: view.height < SMALL),
        calibration=measure_calibration([[Drawn.of([view]) for view in views] for views in objects]),
        unseen=tuple(unseen),
    )


def make_row(name: str, outcomes: Sequence[ViewOutcome]) -> Row:
    """All figures of some views, with intervals over their objects."""
    objects = _by_object(outcomes)
    drawn = [Drawn.of(views) for views in objects]
    names = [condition.name for condition in _conditions(outcomes[0])]
    return Row(
        name=name,
        views=len(outcomes),
        objects=len(objects),
        thresholds=tuple(
            pool([count(d.tries[d.probability >= threshold], total=len(d)) for d in drawn])
            for threshold in THRESHOLDS
        ),
        kept=tuple(
            KeptShare(share, everywhere, best_of_each(drawn, share))
            for share, everywhere in zip(KEPT_SHARES, best_of_all(drawn, KEPT_SHARES), strict=True)
        ),
        heuristic=pool([_count_all(views, lambda view: view.heuristic) for views in objects]),
        conditions=tuple(_condition_cells(objects, i, n) for i, n in enumerate(names)),
        coverage=_coverage(objects),
    )


def _by_object(outcomes: Sequence[ViewOutcome]) -> list[list[ViewOutcome]]:
    groups: dict[str, list[ViewOutcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.object_name, []).append(outcome)
    return list(groups.values())


def _conditions(view: ViewOutcome) -> tuple[Condition, ...]:
    return (*view.conditions, *view.strict)


def _count_all(views: Sequence[ViewOutcome], group: Callable[[ViewOutcome], Tries]) -> Cell:
    """The cell of one group of grasps of every view."""
    return count(Tries.join([group(view) for view in views]))


def _condition_cells(objects: list[list[ViewOutcome]], index: int, name: str) -> ConditionCells:
    def per_object(group: Callable[[Condition], Tries]) -> list[Cell]:
        return [_count_all(views, lambda view: group(_conditions(view)[index])) for views in objects]

    top1 = per_object(lambda c: c.top[:1])
    blind = [per_object(lambda c: c.blind_random_yaw), per_object(lambda c: c.blind_short_side)]
    return ConditionCells(
        name=name,
        top1=pool(top1),
        top=pool(per_object(lambda c: c.top)),
        random=pool(per_object(lambda c: c.random)),
        blind_random_yaw=pool(blind[0]),
        blind_short_side=pool(blind[1]),
        lead=_lead(top1, blind),
        sure=() if index >= len(objects[0][0].conditions) else _sure(objects, index),
    )


def _sure(objects: list[list[ViewOutcome]], index: int) -> tuple[Cell, ...]:
    """The first grasp in one world, where its score reaches each of `SURE`."""
    scores = [np.array([view.samples.score[0] for view in views]) for views in objects]
    first = [Tries.join([view.conditions[index].top[:1] for view in views]) for views in objects]
    return tuple(
        pool([count(t[s >= least], total=len(t)) for t, s in zip(first, scores, strict=True)])
        for least in SURE
    )


def _lead(top1: list[Cell], blind: list[list[Cell]]) -> Estimate:
    """Of top-1 over the better control, which is chosen anew in each draw."""
    value = pool(top1).rate - max(pool(cells).rate for cells in blind)
    ours, *theirs = (
        bootstrap.ratio(np.array([c.successes for c in cells]), np.array([c.kept for c in cells]))
        for cells in (top1, *blind)
    )
    return Estimate(value, bootstrap.interval(ours - np.max(theirs, axis=0), len(top1)))


def _coverage(objects: list[list[ViewOutcome]]) -> CoverageMeans | None:
    full = [[view.coverage for view in views if view.coverage is not None] for views in objects]
    full = [found for found in full if found]
    if not full:
        return None

    def mean(measure: str) -> Estimate:
        values = np.array([np.mean([getattr(coverage, measure) for coverage in found]) for found in full])
        known = values[np.isfinite(values)]
        rates = bootstrap.ratio(known, np.ones(len(known))) if len(known) else known
        value = float(known.mean()) if len(known) else float("nan")
        return Estimate(value, bootstrap.interval(rates, len(known)))

    return CoverageMeans(sum(map(len, full)), mean("stable"), mean("distinct"), mean("type_entropy"))


def _nan_last(value: float) -> float:
    return float("inf") if np.isnan(value) else value


def _without_nan(value: Any) -> Any:
    """NaN is no JSON: empty rates become null."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
