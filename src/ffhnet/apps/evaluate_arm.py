"""`ffhnet evaluate --protocol arm`: from depth images to lifted objects with the arm."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from ffhnet.apps.console import print_table, progress_bar
from ffhnet.apps.extras import require_arm
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    from ffhnet.apps.evaluate import EvaluateOptions


def run_arm(options: EvaluateOptions) -> None:
    """Evaluate scenes with the arm and print what became of them."""
    require_arm("evaluate --protocol arm")
    from ffhnet.dataset.executors import run_jobs
    from ffhnet.evaluation.arm import ArmProtocol, arm_jobs, evaluate_scene
    from ffhnet.evaluation.arm_table import results, shares, to_json
    from ffhnet.files import check_output, write_atomically
    from ffhnet.objects.catalogue import resolve_objects

    if options.json is not None:
        check_output(options.json, (".json",))
    sources = resolve_objects(options.objects)
    if not 0 <= options.neighbours < len(sources):
        most = len(sources) - 1
        raise OptionError(f"--neighbours must be from 0 to {most}, got {options.neighbours}")
    protocol = ArmProtocol(
        weights=None if options.weights is None else str(options.weights),
        placements=options.placements,
        neighbours=options.neighbours,
        samples=options.samples,
        seed=options.seed,
    )
    jobs = arm_jobs(sources, protocol)
    with progress_bar("scenes", len(jobs)) as step:
        outcomes = run_jobs(evaluate_scene, jobs, options.workers, step)
    if options.json is not None:
        described = {**dataclasses.asdict(protocol), "objects": options.objects}
        write_atomically(options.json, to_json(outcomes, described).encode())
    print_table(
        "With the arm", ["", "share (95 %)"], [[share.name, share.text] for share in shares(outcomes)]
    )
    print_table("Scenes", ["result", "scenes"], [[name, str(n)] for name, n in results(outcomes).items()])
