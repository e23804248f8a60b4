"""What a data set holds, by proposer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ffhnet.dataset.columns import TrialColumns, read_trial_columns
from ffhnet.dataset.records import read_tables
from ffhnet.metrics import wilson_interval
from ffhnet.simulation.trial import Outcome

OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome)


@dataclass(frozen=True)
class Rate:
    """Successes among trials, with the 95 % Wilson interval as if all trials were independent."""

    successes: int
    trials: int

    @property
    def value(self) -> float:
        """NaN without trials."""
        return self.successes / self.trials if self.trials else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Low and high end."""
        wilson = wilson_interval(self.successes, self.trials)
        return wilson.low, wilson.high

    def to_json(self) -> dict[str, Any]:
        """Counts and interval."""
        return {"executed": self.trials, "successes": self.successes, "interval95": list(self.interval)}

    def __str__(self) -> str:
        if self.trials == 0:
            return "-"
        low, high = self.interval
        return f"{self.value:.1%} ({low:.1%} to {high:.1%})"


@dataclass(frozen=True)
class Summary:
    """A table of text, ready to print."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def success_rate(trials: TrialColumns) -> Rate:
    """Share of executed trials that succeeded.

    Start collisions are left out: of the samplers' only some are kept, as negatives.
    """
    return Rate(int(trials.success.sum()), int(trials.executed.sum()))


def summarise(folder: Path) -> Summary:
    """Trials by proposer and outcome; "success" is the share of executed trials, with its 95 % interval.

    Raises:
        DatasetError: the folder is no data set.
    """
    trials, views = read_trial_columns([folder]), read_tables(folder, "views")
    return Summary(
        title=f"{folder}: {len(np.unique(trials.object_name))} objects, {len(views)} views",
        columns=("proposer", "executed", "success", *OUTCOMES),
        rows=outcome_rows(trials),
    )


def outcome_rows(trials: TrialColumns) -> tuple[tuple[str, ...], ...]:
    """One row per proposer and one for all: name, executed, success, and a count for each outcome."""
    parts: Sequence[tuple[str, TrialColumns]] = [
        *((name, trials[trials.proposer == name]) for name in trials.proposers),
        ("all", trials),
    ]
    return tuple(
        (
            name,
            str(int(part.executed.sum())),
            str(success_rate(part)),
            *(str(int((part.outcome == outcome).sum())) for outcome in OUTCOMES),
        )
        for name, part in parts
    )
