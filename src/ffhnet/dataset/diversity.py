"""How varied the successes of each proposer are: a sampler that finds one grasp only teaches little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ffhnet.dataset.columns import TrialColumns, read_trial_columns
from ffhnet.dataset.records import read_header
from ffhnet.dataset.statistics import Rate, Summary
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.hands import Hand, load_hand
from ffhnet.simulation.distinct import is_distinct
from ffhnet.simulation.grasp_types import KINDS, entropy_bits, grasp_types

TRIALS = (5, 10, 20, 30, 50)
"""Executed trials per placement at which distinct grasps are counted."""


@dataclass(frozen=True)
class DistinctCount:
    """Distinct grasps found in the first trials of a placement, on average over placements.

    Attributes:
        trials: executed trials per placement.
        placements: placements at which all the proposers that are compared made so many.
        mean: distinct successful grasps per placement; NaN without placements.
    """

    trials: int
    placements: int
    mean: float


@dataclass(frozen=True)
class ProposerDiversity:
    """Success and diversity of one proposer.

    Attributes:
        proposer: its name.
        success: of its executed trials.
        type_entropy: of the grasp types of its successes, bits; NaN if contacts were not recorded.
        types: number of different types among them.
        power_share: share of power grasps among them; NaN likewise.
        closed_spread: mean over joints of the standard deviation of the closed joints, rad.
        grasp_spread: the same of the joints that were proposed, rad.
        distinct: a count for each of `TRIALS`.
    """

    proposer: str
    success: Rate
    type_entropy: float
    types: int
    power_share: float
    closed_spread: float
    grasp_spread: float
    distinct: tuple[DistinctCount, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values for a JSON file; what is not known is null."""

        def known(value: float) -> float | None:
            return None if np.isnan(value) else value

        return {
            "proposer": self.proposer,
            **self.success.to_json(),
            "type_entropy_bits": known(self.type_entropy),
            "types": self.types,
            "power_share": known(self.power_share),
            "closed_joint_spread_rad": known(self.closed_spread),
            "grasp_joint_spread_rad": known(self.grasp_spread),
            "distinct_per_placement": [
                {"executed_trials": d.trials, "placements": d.placements, "mean": known(d.mean)}
                for d in self.distinct
            ],
        }


def measure_diversity(folders: Sequence[Path], seed: int = 0) -> list[ProposerDiversity]:
    """Diversity by proposer over one or more data sets of one hand.

    Args:
        folders: the data sets.
        seed: of the order in which trials are counted.

    Raises:
        DatasetError: a folder is no data set.
        HandError: the hand of the first is unknown.
    """
    hand = load_hand(read_header(folders[0])["hand"])
    return diversity(read_trial_columns(folders), hand, np.random.default_rng(seed))


def diversity(trials: TrialColumns, hand: Hand, rng: np.random.Generator) -> list[ProposerDiversity]:
    """Diversity by proposer, in the order in which proposers first appear."""
    executed = trials[trials.executed]
    distinct = _distinct_counts(executed, rng)
    return [
        _describe(name, executed[executed.proposer == name], hand, distinct[name])
        for name in executed.proposers
    ]


def diversity_table(measured: Sequence[ProposerDiversity], title: str) -> Summary:
    """One row per proposer."""
    counted = [d.trials for d in measured[0].distinct] if measured else []
    return Summary(
        title=title,
        columns=(
            "proposer",
            "success (95 %)",
            "type entropy, bit",
            "types",
            "power",
            "spread closed, rad",
            "spread grasp, rad",
            *(f"distinct @{n}" for n in counted),
        ),
        rows=tuple(
            (
                m.proposer,
                str(m.success),
                _text(m.type_entropy, ".2f"),
                "-" if np.isnan(m.type_entropy) else str(m.types),
                _text(m.power_share, ".0%"),
                _text(m.closed_spread, ".3f"),
                _text(m.grasp_spread, ".3f"),
                *(_text(d.mean, ".2f") for d in m.distinct),
            )
            for m in measured
        ),
    )


def _describe(
    name: str, executed: TrialColumns, hand: Hand, distinct: tuple[DistinctCount, ...]
) -> ProposerDiversity:
    good = executed[executed.success]
    known = good[~np.isnan(good.contact_links)]
    types = grasp_types(known.closed_joints, known.contact_links, hand)
    return ProposerDiversity(
        proposer=name,
        success=Rate(len(good), len(executed)),
        type_entropy=entropy_bits(types.code),
        types=len(np.unique(types.code)),
        power_share=float((types.kind == KINDS.index("power")).mean()) if len(known) else float("nan"),
        closed_spread=_spread(good.closed_joints),
        grasp_spread=_spread(good.joints),
        distinct=distinct,
    )


def _spread(joints: Float[np.ndarray, "N J"]) -> float:
    return float(joints.std(axis=0).mean()) if len(joints) else float("nan")


def _distinct_counts(
    executed: TrialColumns, rng: np.random.Generator
) -> dict[str, tuple[DistinctCount, ...]]:
    """For each proposer, the counts at the placements where every proposer made enough trials.

    A proposer that nowhere made so many is left out of the comparison at that number.
    """
    placement = executed.placement_key
    num_placements = int(placement.max()) + 1 if len(placement) else 0
    found = {
        name: _found(executed, np.flatnonzero(executed.proposer == name), placement, num_placements, rng)
        for name in executed.proposers
    }
    enough = {name: ~np.isnan(counts) for name, counts in found.items()}
    result = {}
    for name, counts in found.items():
        rows = []
        for column, trials in enumerate(TRIALS):
            compared = [e[:, column] for e in enough.values() if e[:, column].any()]
            common = (
                np.all(compared, axis=0) & enough[name][:, column] if compared else enough[name][:, column]
            )
            mean = float(counts[common, column].mean()) if common.any() else float("nan")
            rows.append(DistinctCount(trials, int(common.sum()), mean))
        result[name] = tuple(rows)
    return result


def _found(
    executed: TrialColumns,
    rows: Int[np.ndarray, " N"],
    placement: Int[np.ndarray, " T"],
    num_placements: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "P C"]:
    """Distinct grasps among the first trials of each placement, in random order; NaN where too few."""
    found = np.full((num_placements, len(TRIALS)), np.nan)
    shuffled = rng.permutation(rows)
    by_placement = shuffled[np.argsort(placement[shuffled], kind="stable")]
    numbers, starts = np.unique(placement[by_placement], return_index=True)
    for number, group in zip(numbers, np.split(by_placement, starts[1:]), strict=True):
        tried = executed[group[: max(TRIALS)]]
        good = tried.success
        new = np.zeros(len(tried), dtype=int)
        new[good] = is_distinct(
            tried.position[good],
            matrix_from_quaternion(tried.quaternion_wxyz[good]),
            tried.closed_joints[good],
        )
        for column, trials in enumerate(TRIALS):
            if len(tried) >= trials:
                found[number, column] = new[:trials].sum()
    return found


def _text(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)
