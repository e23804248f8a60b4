"""The data card: what data sets hold and how they were made, in Markdown, all of it read from their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ffhnet.dataset.columns import TrialColumns, read_trial_columns, split_of
from ffhnet.dataset.records import read_header, read_tables
from ffhnet.dataset.statistics import OUTCOMES, outcome_rows, success_rate
from ffhnet.errors import DatasetError
from ffhnet.objects.procedural import seed_of

NOT_RECORDED = "not recorded"
_VERSIONS = ("ffhnet", "mujoco", "numpy")


@dataclass(frozen=True)
class _Part:
    """One data set."""

    name: str
    header: dict[str, Any]
    trials: TrialColumns
    num_views: int

    @property
    def objects(self) -> list[str]:
        return sorted(set(self.trials.object_name.tolist()))


def data_card(folders: Sequence[Path], commands: Sequence[str] = ()) -> str:
    """Markdown text about one or more data sets.

    Args:
        folders: the data sets; they are named by the last part of their paths.
        commands: the commands that made them, as text.

    Raises:
        DatasetError: no folders, or one of them is no data set.
    """
    if not folders:
        raise DatasetError("wanted at least one data set, got none")
    parts = [
        _Part(
            folder.resolve().name,
            read_header(folder),
            read_trial_columns([folder]),
            len(read_tables(folder, "views")),
        )
        for folder in folders
    ]
    sections = ["# Data card\n", _introduction(parts), _contents(parts)]
    for split in ("train", "val", "test", "scans"):
        trials = _of_split(parts, split)
        if len(trials):
            sections += [_success(split, trials), _robustness(trials)]
    sections += [_label(parts), _settings(parts), _regeneration(commands)]
    return "\n".join(sections)


def _introduction(parts: Sequence[_Part]) -> str:
    hands = ", ".join(sorted({part.header["hand"] for part in parts}))
    return (
        f"Simulated grasp trials of the hand `{hands}` on objects resting on a table, with views.\n"
        "Columns are described in [docs/data.md](../docs/data.md). Licence: Apache-2.0, like the code.\n\n"
        "`ffhnet data card` wrote this page; every number is counted in the files. Success is the share of\n"
        "executed trials, with the 95 % Wilson interval as if trials were independent; trials of one object\n"
        "are not, so the true uncertainty is larger. Start collisions are no executed trials.\n"
    )


def _contents(parts: Sequence[_Part]) -> str:
    rows = [
        (
            f"`{part.name}`",
            ", ".join(sorted({split_of(name) for name in part.objects})),
            str(len(part.objects)),
            _seeds(part.objects),
            str(len(np.unique(part.trials.placement_key))),
            str(part.num_views),
            str(int(part.trials.executed.sum())),
            str(int(part.trials.success.sum())),
            str(int((~part.trials.executed).sum())),
        )
        for part in parts
    ]
    counted = ("objects", "object seeds", "placements", "views", "executed", "successes", "start collisions")
    columns = ("folder", "split", *counted)
    return "## Contents\n\n" + _table(columns, rows)


def _seeds(objects: Sequence[str]) -> str:
    """First and last seed of the procedural objects."""
    seeds = [seed_of(name) for name in objects if split_of(name) != "scans"]
    return f"{min(seeds)} to {max(seeds)}" if seeds else "-"


def _success(split: str, trials: TrialColumns) -> str:
    family = np.array([name.rpartition("_")[0] or name for name in trials.object_name.tolist()])
    names = [*sorted(set(family.tolist())), "all"] if split != "scans" else ["all"]
    rows = []
    for name in names:
        part = trials if name == "all" else trials[family == name]
        objects = str(len(np.unique(part.object_name)))
        rows.append((name, objects, str(int(part.executed.sum())), str(success_rate(part))))
    return (
        f"## Split `{split}`\n\nBy proposer, with what became of the trials:\n\n"
        + _table(("proposer", "executed", "success (95 %)", *OUTCOMES), outcome_rows(trials))
        + "\nBy family of objects:\n\n"
        + _table(("family", "objects", "executed", "success (95 %)"), rows)
    )


def _robustness(trials: TrialColumns) -> str:
    """How many of the repeats held, after nominal successes and nominal failures."""
    repeated = trials[trials.repeats > 0]
    if len(repeated) == 0:
        return "Robustness: no trial was repeated under perturbation.\n"
    share = repeated.held / repeated.repeats
    ranges = (
        ("none", share == 0),
        ("less than half", (share > 0) & (share < 0.5)),
        ("half or more", (share >= 0.5) & (share < 1)),
        ("all", share == 1),
    )
    rows = []
    for name, chosen in (("success", repeated.success), ("failure", ~repeated.success)):
        n = int(chosen.sum())
        cells = [f"{(chosen & inside).sum() / n:.1%}" if n else "-" for _, inside in ranges]
        mean = f"{share[chosen].mean():.3f}" if n else "-"
        rows.append((name, str(n), mean, *cells))
    columns = ("nominal outcome", "repeated trials", "mean share held", *(name for name, _ in ranges))
    return "Robustness: share of the perturbed repeats of a trial that held:\n\n" + _table(columns, rows)


def _label(parts: Sequence[_Part]) -> str:
    physics = [part.header["generation"]["physics"] for part in parts]
    if any(settings != physics[0] for settings in physics):
        return "## Label\n\nThe data sets differ in their physics: see the settings below.\n"
    p = physics[0]
    return (
        "## Label\n\n"
        f"The hand closes, lifts {100 * p['lift_height']:g} cm in {p['lift_duration']:g} s and holds for "
        f"{p['hold_duration']:g} s. `success`: at the end the object has risen at least "
        f"{100 * p['min_rise']:g} cm, touches the hand and not the table, and it moved at most "
        f"{1000 * p['max_hold_slip']:g} mm in the hand during the hold. Every other outcome is a failure; "
        "`collision` means that the hand could not take up its pose and nothing was executed.\n"
    )


def _settings(parts: Sequence[_Part]) -> str:
    flat = [
        {
            **_flatten(part.header["generation"]),
            **{f"version of {name}": _version(part.header, name) for name in _VERSIONS},
        }
        for part in parts
    ]
    keys = list(dict.fromkeys(key for settings in flat for key in settings))
    rows = [(key, *(str(settings.get(key, NOT_RECORDED)) for settings in flat)) for key in keys]
    columns = ("setting", *(f"`{part.name}`" for part in parts))
    return "## Settings (SI units)\n\n" + _table(columns, rows)


def _version(header: dict[str, Any], package: str) -> str:
    return str(header.get("versions", {}).get(package, NOT_RECORDED))


def _regeneration(commands: Sequence[str]) -> str:
    if not commands:
        return "## How to make it again\n\nThe commands were not given to `ffhnet data card`.\n"
    return "## How to make it again\n\n```\n" + "\n".join(commands) + "\n```\n"


def _of_split(parts: Sequence[_Part], split: str) -> TrialColumns:
    chosen = [part.trials[_in_split(part.trials, split)] for part in parts]
    return TrialColumns.concatenate(chosen)


def _in_split(trials: TrialColumns, split: str) -> np.ndarray:
    names, number = np.unique(trials.object_name, return_inverse=True)
    return np.array([split_of(name) == split for name in names.tolist()])[number]


def _flatten(settings: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings as one level with dotted names."""
    flat: dict[str, Any] = {}
    for key, value in settings.items():
        flat |= _flatten(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
    return flat


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [columns, ["---", *["---:"] * (len(columns) - 1)], *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
