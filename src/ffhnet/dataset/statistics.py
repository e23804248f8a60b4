"""What a data set holds, by proposer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ffhnet.dataset.records import read_tables
from ffhnet.metrics import wilson_interval
from ffhnet.simulation.trial import Outcome

OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome)


@dataclass(frozen=True)
class Summary:
    """A table of text, ready to print."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def summarise(folder: Path) -> Summary:
    """Trials by proposer and outcome; "success" is the share of executed trials, with its 95 % interval.

    Start collisions are left out of that share: of the samplers' only some are kept, as negatives.

    Raises:
        DatasetError: the folder is no data set.
    """
    trials, views = read_tables(folder, "trials"), read_tables(folder, "views")
    proposer = np.array(trials["proposer"].to_pylist())
    outcome = np.array(trials["outcome"].to_pylist())
    objects = trials["object"].combine_chunks().unique()
    rows = [_row(name, outcome[proposer == name]) for name in dict.fromkeys(proposer.tolist())]
    rows.append(_row("all", outcome))
    return Summary(
        title=f"{folder}: {len(objects)} objects, {len(views)} views",
        columns=("proposer", "executed", "success", *OUTCOMES),
        rows=tuple(rows),
    )


def _row(name: str, outcome: np.ndarray) -> tuple[str, ...]:
    counts = [int((outcome == kind).sum()) for kind in OUTCOMES]
    executed = len(outcome) - counts[Outcome.COLLISION]
    rate = counts[Outcome.SUCCESS] / executed if executed else float("nan")
    interval = wilson_interval(counts[Outcome.SUCCESS], executed)
    success = f"{rate:.1%} ({interval.low:.1%} to {interval.high:.1%})"
    return (name, str(executed), success, *(str(count) for count in counts))
