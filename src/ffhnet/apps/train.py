"""`ffhnet train`: both networks from data sets."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.console import absent, print_table
from ffhnet.apps.extras import require_sim
from ffhnet.apps.hand_option import HandOption, for_workers
from ffhnet.apps.trained_flow import check_size

if TYPE_CHECKING:
    from ffhnet.hands.link_points import LinkPoints
    from ffhnet.training.config import Network, TrainingConfig
    from ffhnet.training.processes import Processes


@dataclass(frozen=True)
class TrainOptions:
    """Train the generator and the evaluator; a run that was stopped goes on from its last state.

    Several processes train together when torchrun starts them: `torchrun --nproc-per-node 2 -m ffhnet train`.
    """

    data: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets, as made by `ffhnet generate`."""
    out: Path
    """Folder of the weights."""
    val: Annotated[Path | None, absent("DIR")] = None
    """Data set of held-out objects to measure on."""
    hand: HandOption = None
    """Name or TOML file of the hand."""
    preset: Literal["default", "small", "paper"] = "default"
    """The project's own architecture and recipe; a small one for a hand with little data; or the paper's
    (section III-D; hours on a CPU)."""
    generator: Annotated[Literal["flow", "cvae"] | None, absent("flow|cvae", "the preset's")] = None
    """Flow matching, or the paper's conditional variational autoencoder."""
    networks: Literal["both", "generator", "evaluator"] = "both"
    """Which of them to train."""
    steps: Annotated[int | None, absent("N", "the preset's")] = None
    """Optimiser steps of each network."""
    seed: int = 0
    """Seed of initial weights, batches and noise."""
    threads: int = field(default_factory=lambda: _cores_per_process())
    """Processor threads of each process."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to compute; auto takes a GPU where there is one."""


def _cores_per_process() -> int:
    """This machine's cores among the processes that torchrun started on it."""
    return max(1, (os.cpu_count() or 1) // int(os.environ.get("LOCAL_WORLD_SIZE", 1)))


def run(options: TrainOptions) -> None:
    """Train, then print the held-out metrics."""
    require_sim("train")
    from ffhnet.training.processes import joined

    with joined(options.device) as processes:
        _train(options, processes)


def _config(options: TrainOptions, network: Network, links: LinkPoints) -> TrainingConfig:
    """The preset's run of a network, with what the options change."""
    import dataclasses

    from ffhnet.training.config import TrainingConfig

    num_joints = len(links.opened)
    if options.preset == "paper":
        config = TrainingConfig.paper(num_joints)
    elif options.preset == "small":
        config = TrainingConfig.small(network, num_joints)
    else:
        config = TrainingConfig.default(network, num_joints)
        config = dataclasses.replace(config, model=config.model.with_links(links))
    model = dataclasses.replace(config.model, generator=options.generator or config.model.generator)
    return dataclasses.replace(config, model=model, steps=options.steps or config.steps, seed=options.seed)


def _train(options: TrainOptions, processes: Processes) -> None:
    import torch

    from ffhnet.dataset.records import read_training_data
    from ffhnet.hands import load_hand
    from ffhnet.hands.link_points import link_points
    from ffhnet.hands.surface_points import surface_points
    from ffhnet.model.checkpoint import read_info
    from ffhnet.training import LookPoints, train_evaluator, train_generator

    check_size(options.threads, options.steps)
    torch.set_num_threads(options.threads)
    data = read_training_data(list(options.data))
    val = None if options.val is None else read_training_data([options.val])
    hand = load_hand(for_workers(options.hand or data.hand, data.hand))
    limits = (hand.lower.tolist(), hand.upper.tolist())
    links = link_points(hand)
    generator = _config(options, "generator", links)
    evaluator = _config(options, "evaluator", links)
    count = evaluator.model.palm_points
    look = LookPoints(surface_points(hand, count), links) if count else None
    if processes.first:
        print(f"{len(data.object_names)} objects, {data.num_views} views, {data.num_trials} trials")
    if options.networks != "evaluator":
        train_generator(data, val, generator, options.out, limits, look, processes=processes)
    if options.networks != "generator":
        train_evaluator(data, val, evaluator, options.out, limits, look, processes=processes)
    if processes.first and val is not None:
        summary = read_info(options.out).training
        rows = [
            (network, name, f"{value:.4f}")
            for network, run_summary in summary.items()
            for name, value in run_summary["held_out"].items()
        ]
        print_table(f"on {len(val.object_names)} held-out objects", ("network", "measure", "value"), rows)
