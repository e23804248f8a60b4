"""`ffhnet data`: what a data set holds, and joining its files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import print_table
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
class DataOptions:
    """Show or pack a data set made by `ffhnet generate`."""

    command: (
        Annotated[ShowOptions, tyro.conf.subcommand("show")]
        | Annotated[PackOptions, tyro.conf.subcommand("pack")]
    )


def run(options: DataOptions) -> None:
    """Show or pack."""
    require_sim("data")
    from ffhnet.dataset.records import pack
    from ffhnet.dataset.statistics import summarise

    folder = options.command.folder if isinstance(options.command, ShowOptions) else options.command.target
    if isinstance(options.command, PackOptions):
        pack(options.command.source, options.command.target)
    summary = summarise(folder)
    print_table(summary.title, summary.columns, summary.rows)
