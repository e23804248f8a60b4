"""What all subcommands show in the same way: help, tables on standard output, progress on standard error."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

_WIDTH = 200
"""Columns of a table that goes to a file or a pipe."""


def absent(metavar: str, meaning: str | None = None) -> Any:
    """How the help shows an option that is None where it is not given, and what that means."""
    hint = "(optional)" if meaning is None else f"(default: {meaning})"
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=hint)


@contextlib.contextmanager
def busy(text: str) -> Iterator[None]:
    """A spinner while something takes more than a moment; silent where standard error is no terminal."""
    if not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(text):
        yield


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table with a title; the first column is left-aligned, the others right."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    # Without a terminal rich would assume 80 columns and cut cells.
    Console(highlight=False, width=None if sys.stdout.isatty() else _WIDTH).print(table)


@contextlib.contextmanager
def progress_bar(text: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar on standard error; gives a function to call after each of `total` steps."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task(text, total=total)
        yield lambda: progress.advance(task)
