"""`ffhnet evaluate`: Table I and II in physics."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.apps.extras import require_sim
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    from ffhnet.evaluation.tables import Cell, Row, Table


@dataclass(frozen=True)
class EvaluateOptions:
    """Execute every generated grasp in physics and count what each threshold would have kept."""

    objects: str = "procedural-test:12"
    """procedural-test:COUNT, a folder of meshes, a mesh file, or the name of one object."""
    weights: Annotated[Path | None, absent("DIR", "the shipped weights")] = None
    """Folder of weights."""
    placements: int = 3
    """Random views per object."""
    samples: int = 400
    """Grasps sampled and executed per view."""
    heuristic: int = 60
    """Grasps of the paper's sampler executed per view, for comparison."""
    all_poses: bool = False
    """Cycle through the object's stable poses instead of the first one, which is standing."""
    seed: int = 0
    """Seed of views and samples."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write counts and protocol to this file."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes."""


def run(options: EvaluateOptions) -> None:
    """Evaluate and print the tables."""
    require_sim("evaluate")
    import dataclasses

    from ffhnet.dataset.executors import run_jobs
    from ffhnet.evaluation.protocol import Protocol, ViewOutcome, evaluate_object
    from ffhnet.evaluation.tables import make_table
    from ffhnet.files import check_output, write_atomically
    from ffhnet.objects.catalogue import resolve_objects

    if min(options.placements, options.samples, options.workers) < 1 or options.heuristic < 0:
        raise OptionError("--placements, --samples and --workers must be at least 1, --heuristic at least 0")
    if options.json is not None:
        check_output(options.json, (".json",))
    protocol = Protocol(
        weights=None if options.weights is None else str(options.weights),
        placements=options.placements,
        samples=options.samples,
        heuristic=options.heuristic,
        all_poses=options.all_poses,
        seed=options.seed,
    )
    sources = resolve_objects(options.objects)
    outcomes: dict[str, list[ViewOutcome]] = {}
    with progress_bar("objects", len(sources)) as step:

        def done(views: list[ViewOutcome]) -> None:
            outcomes[views[0].object_name] = views
            step()

        jobs = [(source, number, protocol) for number, source in enumerate(sources)]
        run_jobs(evaluate_object, jobs, options.workers, done)
    # Processes end in any order; the table is in the order in which the objects were named.
    table = make_table([view for source in sources for view in outcomes[source.name]])
    _print(table)
    if options.json is not None:
        described = {**dataclasses.asdict(protocol), "objects": options.objects}
        write_atomically(options.json, table.to_json(described).encode())


def _print(table: Table) -> None:
    from ffhnet.evaluation.tables import KEPT_SHARES, THRESHOLDS

    columns = ("object", "views", *(f"Th {t:g}" for t in THRESHOLDS))
    columns += (*(f"own best {share:.0%}" for share in KEPT_SHARES), "top-1", "heuristic")
    rows = [_cells(row) for row in table.rows]
    means = [f"{100 * table.mean_rate(i):.0f} %" for i in range(len(THRESHOLDS))]
    rows.append(("mean of objects", "", *means, *([""] * (len(columns) - 2 - len(means)))))
    rows.append(_cells(table.total))
    rows.append(("kept", "", *(f"{cell.retained:.0%}" for cell in table.total.thresholds), "", "", "", ""))
    print_table("Success (lifted / tried), start collisions counted as failures", columns, rows)
    raw, best = table.total.thresholds[0], table.total.best
    executed = raw.kept - raw.collisions
    print(
        f"\nheuristic {_with_interval(table.total.heuristic)}; generator {_with_interval(raw)}, "
        f"without start collisions {raw.successes / max(executed, 1):.1%} ({raw.successes}/{executed});"
    )
    for share, cell in zip(KEPT_SHARES, best, strict=True):
        print(f"best {share:.0%} by the evaluator {_with_interval(cell)};")
    print(
        f"top-1 {_with_interval(table.total.top1)}; AUROC {table.auroc_executed:.3f} on executed samples, "
        f"{table.auroc_all:.3f} with start collisions; ECE {table.ece:.3f}"
    )


def _cells(row: Row) -> tuple[str, ...]:
    cells = (*row.thresholds, *row.best, row.top1, row.heuristic)
    return (row.name, str(row.views), *(_rate(cell) for cell in cells))


def _rate(cell: Cell) -> str:
    return "-" if cell.kept == 0 else f"{cell.successes}/{cell.kept} {100 * cell.rate:.0f} %"


def _with_interval(cell: Cell) -> str:
    from ffhnet.metrics import wilson_interval

    interval = wilson_interval(cell.successes, cell.kept)
    rate = "-" if cell.kept == 0 else f"{cell.rate:.1%}"
    return f"{rate} ({cell.successes}/{cell.kept}; 95 % {interval.low:.1%} to {interval.high:.1%})"
