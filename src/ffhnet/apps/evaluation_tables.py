"""The tables of `ffhnet evaluate` on the terminal."""

from __future__ import annotations

import math

from ffhnet.apps.console import print_table
from ffhnet.evaluation.cells import Cell, Estimate
from ffhnet.evaluation.tables import SMALL, SURE, THRESHOLDS, WORST_SHARE, ConditionCells, Row, Table

_BEST = (0.28, 0.05)
"""Kept shares that the paper's thresholds 0.9 and 0.95 came to."""


def print_evaluation(table: Table) -> None:
    """All tables, Table I first."""
    for show in (
        _print_thresholds,
        _print_objects,
        _print_methods,
        _print_shares,
        _print_conditions,
        _print_sure,
        _print_reliability,
    ):
        show(table)
        print()
    _print_summary(table)


def _print_thresholds(table: Table) -> None:
    compared = ("heuristic", "blind, any yaw", "blind, short side")
    columns = ("object", "views", *(f"Th {t:g}" for t in THRESHOLDS), *compared)
    rows = []
    for row in (*table.rows, table.total):
        cells = (*row.thresholds, row.heuristic, *_blind(row))
        rows.append((row.name, str(row.views), *(_rate(cell) for cell in cells)))
    empty = [""] * len(compared)
    means = [_percent(table.mean_rate(i)) for i in range(len(THRESHOLDS))]
    rows.insert(len(table.rows), ("mean of objects", "", *means, *empty))
    kept = [f"{cell.retained:.0%}" for cell in table.total.thresholds]
    rows.append(("kept", "", *kept, *empty))
    print_table("Table I: lifted / tried, start collisions counted as failures", columns, rows)


def _print_objects(table: Table) -> None:
    best = (*(f"own best {share:.0%}" for share in _BEST), "top-1", "top-5")
    columns = ("object", *best, "blind, any yaw", "blind, short side", "stable", "distinct", "types, bit")
    rows = []
    for row in (*table.rows, table.total):
        own = (row.best(share).own for share in _BEST)
        cells = (*own, row.nominal.top1, row.nominal.top, *_blind(row))
        covered = ("-", "-", "-")
        if row.coverage is not None:
            c = row.coverage
            covered = (f"{c.stable.value:.0f}", f"{c.distinct.value:.0f}", f"{c.type_entropy.value:.2f}")
        rows.append((row.name, *(_rate(cell) for cell in cells), *covered))
    print_table("Best grasps of each object, and how many different ones it has", columns, rows)


def _blind(row: Row) -> tuple[Cell, Cell]:
    return row.nominal.blind_random_yaw, row.nominal.blind_short_side


def _print_methods(table: Table) -> None:
    parts = table.parts
    columns = ("method", *(f"{row.name} ({row.views} views)" for row in parts), "total, no start collisions")
    methods = [
        ("heuristic", [row.heuristic for row in parts]),
        ("blind, any yaw", [row.nominal.blind_random_yaw for row in parts]),
        ("blind, short side", [row.nominal.blind_short_side for row in parts]),
        ("generator", [row.raw for row in parts]),
    ]
    for share in _BEST:
        methods.append((f"  best {share:.0%} of all", [row.best(share).everywhere for row in parts]))
        methods.append((f"  own best {share:.0%}", [row.best(share).own for row in parts]))
    methods.append(("  top-5", [row.nominal.top for row in parts]))
    methods.append(("  top-1", [row.nominal.top1 for row in parts]))
    rows = [
        (name, *(_with_interval(cell) for cell in cells), _executed_only(cells[0])) for name, cells in methods
    ]
    rows.append(("points of top-1 over the better blind", *(_points(row.nominal.lead) for row in parts), ""))
    print_table("Table II: success, 95 % by bootstrap over objects", columns, rows)


def _print_shares(table: Table) -> None:
    total = table.total
    columns = ("kept", "best of all samples", "each object's own best", "own, no start collisions")
    rows = [("100%", *[_with_interval(total.raw)] * 2, _executed_only(total.raw))]
    for kept in total.kept:
        cells = (_with_interval(kept.everywhere), _with_interval(kept.own), _executed_only(kept.own))
        rows.append((f"{kept.share:.0%}", *cells))
    for name, cell in zip(("blind, any yaw", "blind, short side"), _blind(total), strict=True):
        rows.append((name, *[_with_interval(cell)] * 2, _executed_only(cell)))
    print_table("Success against kept share", columns, rows)


def _print_conditions(table: Table) -> None:
    groups = ("top-1", "top group", "random", "blind, any yaw", "blind, short side")
    columns = ("views", "world", *groups, "points over blind")
    rows = []
    for row in table.parts:
        for i, condition in enumerate(row.conditions):
            rows.append((row.name if i == 0 else "", *_condition_row(condition)))
    print_table("Other worlds (strict: the top group is the best 10 of 100, else the best 5)", columns, rows)


def _condition_row(condition: ConditionCells) -> tuple[str, ...]:
    ours = (condition.top1, condition.top, condition.random)
    blind = (condition.blind_random_yaw, condition.blind_short_side)
    return (condition.name, *(_with_interval(cell) for cell in (*ours, *blind)), _points(condition.lead))


def _print_sure(table: Table) -> None:
    columns = ("views", "world", "always", *(f"score {score:g} or more" for score in SURE))
    rows = []
    for row in table.parts:
        for i, condition in enumerate(c for c in row.conditions if c.sure):
            cells = [f"{_rate(cell)} of {cell.retained:.0%} of the views" for cell in condition.sure]
            rows.append((row.name if i == 0 else "", condition.name, _rate(condition.top1), *cells))
    print_table("The best grasp of each view, executed only where its score is high enough", columns, rows)


def _print_reliability(table: Table) -> None:
    bins = [b for b in table.calibration.bins if b.count]
    columns = ("predicted", *(f"{b.low:.0%} to {b.high:.0%}" for b in bins))
    rows = [
        ("samples", *(str(b.count) for b in bins)),
        ("mean predicted", *(_percent(b.predicted) for b in bins)),
        ("observed", *(_percent(b.observed) for b in bins)),
    ]
    print_table("Reliability of the predicted probability", columns, rows)


def _print_summary(table: Table) -> None:
    quality = table.calibration
    print(f"AUROC with start collisions {_number(quality.auroc, '.3f')}")
    print(f"AUROC without start collisions {_number(quality.auroc_executed, '.3f')}")
    print(f"AUROC within a view {_number(quality.auroc_within_view, '.3f')}")
    print(f"ECE {_number(quality.ece, '.3f')}")
    worst = table.worst.best(WORST_SHARE).own
    print(f"worst object, own best {WORST_SHARE:.0%}: {table.worst.name} {_rate(worst)}")
    if table.small is not None:
        print(f"objects under {1000 * SMALL:.0f} mm as they lie, raw: {_with_interval(table.small.raw)}")
    coverage = table.total.coverage
    if coverage is not None:
        print(f"stable grasps on a full view {_number(coverage.stable, '.0f')} (mean over objects)")
        print(f"distinct stable grasps {_number(coverage.distinct, '.0f')}")
        print(f"entropy of their types {_number(coverage.type_entropy, '.2f')} bit")
    for view in table.unseen:
        print(f"not seen, so not counted: a view of {view.object_name}, {view.pose_name}")


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{100 * value:.0f} %"


def _rate(cell: Cell) -> str:
    return "-" if cell.kept == 0 else f"{cell.successes}/{cell.kept} {_percent(cell.rate)}"


def _with_interval(cell: Cell) -> str:
    """Counts, rate and bootstrap interval; the Wilson interval, marked W, where that does not exist."""
    if cell.kept == 0:
        return "-"
    mark = "W " if cell.interval is None else ""
    interval = cell.interval or cell.wilson
    bounds = f"{mark}{100 * interval.low:.1f}-{100 * interval.high:.1f}"
    return f"{cell.successes}/{cell.kept} {100 * cell.rate:.1f} % ({bounds})"


def _executed_only(cell: Cell) -> str:
    executed = cell.kept - cell.collisions
    return "-" if executed == 0 else f"{cell.successes}/{executed} {100 * cell.rate_executed:.1f} %"


def _number(estimate: Estimate, form: str) -> str:
    if math.isnan(estimate.value):
        return "-"
    text = format(estimate.value, form)
    if estimate.interval is None:
        return text
    return f"{text} ({format(estimate.interval.low, form)} to {format(estimate.interval.high, form)})"


def _points(lead: Estimate) -> str:
    if math.isnan(lead.value):
        return "-"
    text = f"{100 * lead.value:+.1f}"
    if lead.interval is None:
        return text
    return f"{text} ({100 * lead.interval.low:+.1f} to {100 * lead.interval.high:+.1f})"
