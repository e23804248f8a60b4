"""`ffhnet generate`: make training data, resumable."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.apps.extras import require_sim
from ffhnet.apps.hand_option import for_workers
from ffhnet.errors import DatasetError, OptionError

if TYPE_CHECKING:
    from ffhnet.dataset.executors import Executor
    from ffhnet.objects.catalogue import ObjectSource

DEFAULT_COUNT = 400


@dataclass(frozen=True)
class GenerateOptions:
    """Try grasps on objects in physics and store them as Parquet files.

    A job that was stopped goes on where it was when the same command is given again.
    """

    out: Annotated[Path, tyro.conf.Positional]
    """Folder of the data set."""
    objects: Annotated[str | None, absent("SPEC")] = None
    """A folder of meshes, a mesh file, varied-train:N, or the name of one object."""
    split: Annotated[Literal["train", "val", "test"] | None, absent("{train,val,test}", "train")] = None
    """Split of procedural objects, without --objects."""
    count: Annotated[int | None, absent("N", f"{DEFAULT_COUNT} of a split, all of --objects")] = None
    """Number of objects, at most."""
    first: int = 0
    """Leave out this many objects before; for fresh objects in later rounds."""
    hand: Annotated[str | None, absent("HAND", "dlr_hit_ii")] = None
    """Name or TOML file of the hand."""
    seed: int = 0
    """Seed of all randomness, together with the object's own."""
    placements: int = 2
    """Resting poses per object, at most."""
    views: int = 4
    """Simulated views per placement."""
    heuristic: int = 20
    """Executed trials per placement of the paper's sampler."""
    power: int = 35
    """Executed trials per placement of the power-grasp sampler."""
    perturb: int = 40
    """Trials per placement in each of two rounds around successes."""
    weights: Annotated[Path | None, absent("DIR")] = None
    """Weights whose generator proposes grasps too."""
    learned: int = 0
    """Executed trials per placement of that generator."""
    rounds: int = 1
    """How often all of these are asked, at most; again only at placements where fewer than 20 trials held."""
    repeated_share: float = 0.05
    """Share of the trials with contact that are repeated under varied pose, mass and friction."""
    repeats: int = 5
    """How often."""
    executor: Literal["local", "ray"] = "local"
    """Where to work: processes of this machine, or a Ray cluster."""
    address: Annotated[str | None, absent("ADDR", "this machine's cluster, else a new one")] = None
    """Ray cluster: auto, HOST:PORT or ray://HOST:PORT."""
    workers: Annotated[int | None, absent("N", "all cores")] = None
    """Processes; with ray, objects in work at a time."""


def run(options: GenerateOptions) -> None:
    """Generate, then print what the data set holds and which objects failed."""
    require_sim("generate")
    if not 0 <= options.repeated_share <= 1 or not 1 <= options.repeats <= 100:
        raise OptionError("--repeated-share must lie between 0 and 1, --repeats between 1 and 100")
    if options.rounds < 1:
        raise OptionError(f"--rounds must be at least 1, got {options.rounds}")
    executor = _executor(options)
    sources = _sources(options)
    hand = _checked_hand(options)
    weights = _checked_weights(options, hand)
    # After the options are checked: these load MuJoCo and torch.
    from ffhnet.dataset.generate import generate, unfinished
    from ffhnet.dataset.object_trials import GenerateConfig
    from ffhnet.dataset.statistics import summarise

    config = GenerateConfig(
        hand=hand,
        seed=options.seed,
        placements=options.placements,
        views=options.views,
        heuristic=options.heuristic,
        power=options.power,
        perturb=options.perturb,
        learned=options.learned,
        rounds=options.rounds,
        weights=weights,
        repeated_share=options.repeated_share,
        repeats=options.repeats,
    )
    with progress_bar("objects", len(unfinished(sources, options.out))) as step:

        def failed(name: str, reason: str) -> None:
            print(f"failed: {name}: {reason}", file=sys.stderr)
            step()

        failures = generate(sources, options.out, config, executor, lambda _: step(), failed)
    if failures:
        print(f"Objects that failed, also in {options.out / 'failed.json'}: {len(failures)}", file=sys.stderr)
        for name, reason in failures.items():
            print(f"  {name}: {reason}", file=sys.stderr)
    if len(unfinished(sources, options.out)) == len(sources):
        raise DatasetError(f"none of the {len(sources)} objects could be used")
    summary = summarise(options.out)
    print_table(summary.title, summary.columns, summary.rows)


def _executor(options: GenerateOptions) -> Executor:
    from ffhnet.dataset.executors import LocalExecutor, RayExecutor

    if options.workers is not None and options.workers < 1:
        raise OptionError(f"--workers must be at least 1, got {options.workers}")
    if options.executor == "ray":
        return RayExecutor(options.address, options.workers)
    if options.address is not None:
        raise OptionError("--address is the address of a Ray cluster: it goes with --executor ray")
    return LocalExecutor(options.workers or os.cpu_count() or 1)


def _sources(options: GenerateOptions) -> list[ObjectSource]:
    from ffhnet.objects.catalogue import resolve_objects

    first, count = options.first, options.count
    if first < 0 or (count is not None and count < 1):
        raise OptionError("--count must be at least 1, --first at least 0")
    if options.objects is None:
        count = DEFAULT_COUNT if count is None else count
        return resolve_objects(f"procedural-{options.split or 'train'}:{first + count}")[first:]
    if options.split is not None:
        raise OptionError("--objects and --split both name objects: give one of them")
    # Workers of a cluster have other working folders.
    is_file = options.objects and Path(options.objects).exists()
    found = resolve_objects(str(Path(options.objects).absolute()) if is_file else options.objects)
    sources = found[first:] if count is None else found[first : first + count]
    if not sources:
        raise OptionError(f"--first {first} leaves out all {len(found)} objects of {options.objects}")
    return sources


def _checked_hand(options: GenerateOptions) -> str:
    """The hand as workers find it, read here once rather than by every object."""
    from ffhnet.hands import DEFAULT_HAND

    return for_workers(DEFAULT_HAND if options.hand is None else options.hand)


def _checked_weights(options: GenerateOptions, hand: str) -> str | None:
    """The folder of weights, tried here once rather than by every object."""
    if (options.weights is None) != (options.learned == 0):
        raise OptionError("--weights and --learned go together: give both, or neither")
    if options.weights is None:
        return None
    from ffhnet.hands import load_hand
    from ffhnet.inference.ffhnet import FFHNet, find_weights

    folder = find_weights(options.weights)
    FFHNet.from_pretrained(folder, hand=load_hand(hand).name, device="cpu")
    return str(folder)
