"""`ffhnet calibrate`: make the probabilities of trained weights tell the truth."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ffhnet.apps.console import print_table, progress_bar
from ffhnet.apps.extras import require_sim
from ffhnet.apps.hand_option import HandOption, for_workers
from ffhnet.errors import OptionError, SceneError

if TYPE_CHECKING:
    import numpy as np

    from ffhnet.evaluation.own_samples import OwnSamples


@dataclass(frozen=True)
class CalibrateOptions:
    """Try the generator's own grasps on unseen objects, and write what was learned beside the weights.

    All views also say how unlike the training views an object may look before `ffhnet grasp` warns.

    Random ones of the objects fit the maps of the probabilities; the others, unseen by the maps, are
    the record from which `ffhnet grasp --max-failure` picks its threshold.
    """

    weights: Annotated[Path, tyro.conf.Positional]
    """Folder of weights; gets calibration.json."""
    hand: HandOption = None
    """Name or TOML file of the hand."""
    objects: str = "procedural-val:184,varied-val:100"
    """Objects that trained nothing."""
    first: int = 24
    """Leave out this many of them, which development looked at."""
    fit: int = 100
    """How many of the others fit the maps."""
    views: int = 4
    """Views per object, its resting poses in turn."""
    samples: int = 400
    """Grasps sampled and rated per view."""
    executed: int = 16
    """Random ones of them executed per view."""
    seed: int = 0
    """Seed of all randomness."""
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes; the result does not depend on their number."""


def run(options: CalibrateOptions) -> None:
    """Try, fit, write, and print how far the probabilities were off."""
    require_sim("calibrate")
    import numpy as np

    from ffhnet.dataset.executors import run_jobs
    from ffhnet.evaluation.own_samples import OwnSamplesJob, try_own_samples
    from ffhnet.inference.calibration import fit_calibration
    from ffhnet.inference.novelty import NoveltyLimit
    from ffhnet.inference.risk import RiskTable
    from ffhnet.inference.weights_calibration import WeightsCalibration, save_calibration
    from ffhnet.model.checkpoint import load_checkpoint
    from ffhnet.objects.catalogue import resolve_objects

    if min(options.views, options.samples, options.executed, options.workers) < 1 or options.first < 0:
        raise OptionError("--views, --samples, --executed, --workers must be at least 1, --first at least 0")
    named = resolve_objects(options.objects)[options.first :]
    sources = [named[i] for i in np.random.default_rng(options.seed).permutation(len(named))]
    if not 2 <= options.fit <= len(sources) - 2:
        raise OptionError(
            f"--fit must leave 2 of the {len(sources)} objects on either side, got {options.fit}"
        )
    info = load_checkpoint(options.weights).info
    robust, hand = info.model.judge_robustness, for_workers(options.hand or info.hand, info.hand)
    drawn = (options.views, options.samples, options.executed, options.seed)
    jobs = [OwnSamplesJob(source, str(options.weights), hand, *drawn) for source in sources]
    with progress_bar("objects", len(jobs)) as step:
        found = run_jobs(try_own_samples, jobs, options.workers, step)
    fitting = [view for views in found[: options.fit] for view in views]
    record = [view for views in found[options.fit :] for view in views]
    if not fitting or not record:
        raise SceneError("no view of the objects on one side of --fit could be told from the table")
    ids = np.repeat([view.object_name for view in fitting], [len(view.success) for view in fitting])
    success, held = _joined(fitting, "success"), _joined(fitting, "held")
    nominal = fit_calibration(ids, _joined(fitting, "probability"), success)
    varied = fit_calibration(ids, _joined(fitting, "robustness"), held) if robust else None
    ranked_by = nominal if varied is None else varied
    table = RiskTable(
        np.array([view.object_name for view in record]),
        ranked_by.calibration.apply(np.array([view.top_score for view in record])),
        np.array([view.top_held for view in record]),
    )
    source = (
        f"{options.objects} without the first {options.first}: {options.fit} objects for the maps, "
        f"{len(found) - options.fit} for the risk; {options.views} views, seed {options.seed}"
    )
    strange = np.array([view.novelty for view in fitting + record])
    limit = None if np.isnan(strange).any() else NoveltyLimit.of(strange)
    calibration = WeightsCalibration(
        nominal.calibration, None if varied is None else varied.calibration, table, source, limit
    )
    save_calibration(options.weights, calibration)
    rows = []
    for name, fitted, label in (("success", nominal, success), ("robust", varied, held)):
        if fitted is not None:
            before, after = fitted.ece["identity"], fitted.ece[fitted.kind]
            rows.append(
                (name, str(len(label)), f"{label.mean():.1%}", fitted.kind, f"{before:.3f}", f"{after:.3f}")
            )
    print_table(
        f"own samples of {options.fit} objects; ECE on objects held out",
        ("probability of", "tried", "held", "map", "ECE before", "after"),
        rows,
    )
    if limit is not None:
        rate = f"{limit.false_alarms:.1%} of views of unseen objects, by {limit.views} of them"
        print(f"novelty above {limit.limit:.3g} is called novel: {rate}")
    for risk in (0.2, 0.1, 0.05, 0.02):
        control = table.control(risk)
        if control.threshold is None:
            print(f"at most {risk:.0%} failures: cannot be promised from {control.objects} objects")
        else:
            print(
                f"at most {risk:.0%} failures: from {control.threshold:g}; of {len(table.score)} views of "
                f"{control.objects} objects {control.executed:.0%} executed, {control.failures:.1%} failed"
            )


def _joined(views: list[OwnSamples], name: str) -> np.ndarray:
    import numpy as np

    return np.concatenate([getattr(view, name) for view in views])
