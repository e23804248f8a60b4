"""`ffhnet data`: what a data set holds, joining its files, and rating its trials."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import absent, busy, print_table
from ffhnet.apps.extras import require_sim


@dataclass(frozen=True)
class ShowOptions:
    """Trials by proposer and outcome."""

    folder: Annotated[Path, tyro.conf.Positional]
    """A data set."""


@dataclass(frozen=True)
class PackOptions:
    """Join the files of a data set into one of trials and one of views."""

    source: Annotated[Path, tyro.conf.Positional]
    """A data set."""
    target: Annotated[Path, tyro.conf.Positional]
    """Folder of the joined data set."""


@dataclass(frozen=True)
class ScoreOptions:
    """How well an evaluator predicts the trials of a data set."""

    folder: Annotated[Path, tyro.conf.Positional]
    """A data set of objects that the evaluator has not seen."""
    weights: Annotated[Path | None, absent("DIR", "the shipped weights")] = None
    """Folder of weights."""


@dataclass(frozen=True)
class DataOptions:
    """Show, pack or score a data set made by `ffhnet generate`."""

    command: (
        Annotated[ShowOptions, tyro.conf.subcommand("show")]
        | Annotated[PackOptions, tyro.conf.subcommand("pack")]
        | Annotated[ScoreOptions, tyro.conf.subcommand("score")]
    )


def run(options: DataOptions) -> None:
    """Show, pack or score."""
    require_sim("data")
    if isinstance(options.command, ScoreOptions):
        _score(options.command)
        return
    from ffhnet.dataset.records import pack
    from ffhnet.dataset.statistics import summarise

    folder = options.command.folder if isinstance(options.command, ShowOptions) else options.command.target
    if isinstance(options.command, PackOptions):
        pack(options.command.source, options.command.target)
    summary = summarise(folder)
    print_table(summary.title, summary.columns, summary.rows)


def _score(options: ScoreOptions) -> None:
    from ffhnet.dataset.records import read_training_data
    from ffhnet.dataset.scoring import score
    from ffhnet.inference.ffhnet import FFHNet

    data = read_training_data([options.folder])
    network = FFHNet.from_pretrained(options.weights, hand=data.hand, device="cpu")
    with busy("rating the trials"):
        scores = score(data, network.evaluator)
    print(
        f"{len(data.object_names)} objects, {data.num_views} views, {scores.executed} executed trials "
        f"({scores.successes} successes), {scores.collisions} start collisions\n"
        f"AUROC {scores.auroc_executed:.3f} on executed trials, {scores.auroc_all:.3f} with collisions; "
        f"ECE {scores.ece_executed:.3f} on executed trials"
    )
