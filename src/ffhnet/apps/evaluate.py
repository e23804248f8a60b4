"""`ffhnet evaluate`: the paper's tables and harder ones, in physics."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ffhnet.apps.console import absent, busy, progress_bar
from ffhnet.apps.evaluate_arm import run_arm
from ffhnet.apps.extras import require_sim
from ffhnet.apps.hand_option import HandOption, for_workers, weights_for
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    from ffhnet.evaluation.protocol import Protocol


@dataclass(frozen=True)
class EvaluateOptions:
    """Execute generated grasps in physics: success by threshold and kept share, blind controls, stress."""

    objects: str = "procedural-test:12"
    """procedural-test:COUNT, a folder of meshes, a mesh file, or the name of one object."""
    protocol: Literal["paper", "arm"] = "paper"
    """paper: grasps of a floating hand. arm: a Panda does the best feasible grasp of each scene; of the other
    options it takes --weights, --placements, --samples, --seed, --json and --workers."""
    neighbours: int = 0
    """With the arm: other objects in each scene."""
    weights: Annotated[Path | None, absent("DIR", "the shipped weights")] = None
    """Folder of weights."""
    hand: HandOption = None
    """Name or TOML file of the hand."""
    placements: int = 3
    """Random views per object."""
    poses: Literal["standing", "all"] = "standing"
    """standing: every object as modelled. all: a third of its views in its other stable poses."""
    samples: int = 400
    """Grasps sampled and rated per view."""
    executed: Annotated[int | None, absent("N", "all of them")] = None
    """Random samples executed per view; the five best always are."""
    full_views: int = 1
    """Views per object on which all samples are executed, to count distinct stable grasps."""
    heuristic: int = 20
    """Grasps of the paper's sampler executed per view, for comparison."""
    stress: bool = False
    """Try the best grasps and some random ones under friction 0.5, twice the mass and a wrong pose, too."""
    strict: bool = False
    """Try the best 10 of 100 grasps by the strict protocol, too."""
    friction: float = 0.8
    """Sliding friction of every contact."""
    density: Annotated[float | None, absent("KG/M3", "500, mass clipped to 0.05 to 0.4 kg")] = None
    """Density of every object, its mass not clipped."""
    seed: int = 0
    """Seed of views and samples."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write all counts, intervals and the protocol to this file."""
    html: Annotated[Path | None, absent("FILE")] = None
    """Write a report with tables, charts and the paper's figures to this file, which needs nothing else."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes; the result does not depend on their number."""


def run(options: EvaluateOptions) -> None:
    """Evaluate and print the tables."""
    require_sim("evaluate")
    _check(options)
    if options.protocol == "arm":
        run_arm(options)
        return
    import dataclasses

    from ffhnet.apps.evaluation_tables import print_evaluation
    from ffhnet.apps.machine import describe_machine
    from ffhnet.dataset.executors import run_jobs
    from ffhnet.evaluation.figures import draw_figures
    from ffhnet.evaluation.outcomes import ViewOutcome
    from ffhnet.evaluation.protocol import evaluate_view, view_jobs
    from ffhnet.evaluation.report import report
    from ffhnet.evaluation.tables import make_table
    from ffhnet.files import check_output, write_atomically
    from ffhnet.objects.catalogue import resolve_objects

    for path, suffix in ((options.json, ".json"), (options.html, ".html")):
        if path is not None:
            check_output(path, (suffix,))
    protocol = _protocol(options)
    sources = resolve_objects(options.objects)
    jobs = view_jobs(sources, protocol)
    with progress_bar("views", len(jobs)) as step:
        found = run_jobs(evaluate_view, jobs, options.workers, step)
    outcomes = [view for view in found if isinstance(view, ViewOutcome)]
    unseen = [view for view in found if not isinstance(view, ViewOutcome)]
    if not outcomes:
        raise OptionError(f"none of the {len(unseen)} views shows an object that can be told from the table")
    table = make_table(outcomes, unseen)
    print_evaluation(table)
    described = {**dataclasses.asdict(protocol), "objects": options.objects}
    if options.json is not None:
        write_atomically(options.json, table.to_json(described).encode())
    if options.html is not None:
        with busy("drawing the report"):
            figures = draw_figures(outcomes, {source.name: source.load for source in sources}, protocol.hand)
            text = report(table, described, describe_machine(), figures)
        write_atomically(options.html, text.encode())


def _check(options: EvaluateOptions) -> None:
    if min(options.placements, options.samples, options.workers) < 1:
        raise OptionError("--placements, --samples and --workers must be at least 1")
    if options.executed is not None and options.executed < 1:
        raise OptionError(f"--executed must be at least 1, got {options.executed}")
    if min(options.heuristic, options.full_views, options.seed) < 0:
        raise OptionError("--heuristic, --full-views and --seed must be at least 0")
    if not options.friction > 0 or (options.density is not None and not options.density > 0):
        raise OptionError("--friction and --density must be above 0")


def _protocol(options: EvaluateOptions) -> Protocol:
    import dataclasses

    from ffhnet.evaluation.protocol import Protocol
    from ffhnet.simulation.physics import Physics

    same = {f.name for f in dataclasses.fields(Protocol)} & {f.name for f in dataclasses.fields(options)}
    physics = Physics()
    return Protocol(
        **{name: getattr(options, name) for name in same - {"weights", "hand"}},
        weights=weights_for(options.weights, options.hand),
        hand=None if options.hand is None else for_workers(options.hand),
        physics=dataclasses.replace(physics, friction=(options.friction, *physics.friction[1:])),
    )
