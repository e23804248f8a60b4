"""`TrialColumns`: the rows of a trials table as plain arrays, for counting, describing and exporting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int

from ffhnet.dataset.records import complaining, read_tables, vectors
from ffhnet.errors import ObjectError
from ffhnet.objects.procedural import FIRST_SEED, SPLIT_SIZE, seed_of
from ffhnet.simulation.trial import Outcome

_COLLISION = Outcome.COLLISION.name.lower()
_SUCCESS = Outcome.SUCCESS.name.lower()


@dataclass(frozen=True)
class TrialColumns:
    """T trials in the order of their files; what a data set did not record is NaN, or 0 repeats.

    Attributes:
        object_name: name of the object.
        placement: index of its resting pose.
        proposer: what proposed the grasp.
        outcome: name of an `Outcome`, lower case.
        position: palm origin in the world, m.
        quaternion_wxyz: palm orientation in the world.
        joints: joint angles to which the hand closes, rad.
        closed_joints: measured after closing, rad; NaN where nothing was executed.
        contact_links: links touching the object after closing; NaN where not recorded.
        pushed: m that the object moved while the hand closed.
        repeats: repeats of the trial under perturbation, 0 if there were none.
        held: how many of the repeats succeeded.
    """

    object_name: np.ndarray
    placement: Int[np.ndarray, " T"]
    proposer: np.ndarray
    outcome: np.ndarray
    position: Float[np.ndarray, "T 3"]
    quaternion_wxyz: Float[np.ndarray, "T 4"]
    joints: Float[np.ndarray, "T J"]
    closed_joints: Float[np.ndarray, "T J"]
    contact_links: Float[np.ndarray, " T"]
    pushed: Float[np.ndarray, " T"]
    repeats: Int[np.ndarray, " T"]
    held: Int[np.ndarray, " T"]

    def __len__(self) -> int:
        return len(self.outcome)

    def __getitem__(self, rows: np.ndarray | slice) -> TrialColumns:
        """Some of the trials, by mask, indices or slice."""
        return TrialColumns(*(getattr(self, field.name)[rows] for field in fields(self)))

    @property
    def executed(self) -> Bool[np.ndarray, " T"]:
        """Trials whose hand could take up its pose."""
        return self.outcome != _COLLISION

    @property
    def success(self) -> Bool[np.ndarray, " T"]:
        """Trials that lifted and held the object."""
        return self.outcome == _SUCCESS

    @property
    def proposers(self) -> tuple[str, ...]:
        """Names of the proposers, in the order in which they first appear."""
        return tuple(dict.fromkeys(self.proposer.tolist()))

    @property
    def placement_key(self) -> Int[np.ndarray, " T"]:
        """A number for each trial that is the same for trials of one object in one resting pose."""
        _, number = np.unique(self.object_name, return_inverse=True)
        _, key = np.unique(np.stack([number, self.placement]), axis=1, return_inverse=True)
        return key.reshape(-1)

    @staticmethod
    def concatenate(parts: Sequence[TrialColumns]) -> TrialColumns:
        """One table from several of the same hand."""
        return TrialColumns(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(TrialColumns))
        )


def read_trial_columns(folders: Sequence[Path]) -> TrialColumns:
    """The trials of one or more data sets, one after the other. Raises DatasetError."""
    with complaining(folders):
        return TrialColumns.concatenate([_columns(read_tables(folder, "trials")) for folder in folders])


def split_of(object_name: str) -> str:
    """Split of a procedural object by its seed; "scans" for every other object."""
    try:
        seed = seed_of(object_name)
    except ObjectError:
        return "scans"
    inside = (
        name.rpartition("-")[2] for name, first in FIRST_SEED.items() if first <= seed < first + SPLIT_SIZE
    )
    return next(inside, "scans")


def _columns(table: pa.Table) -> TrialColumns:
    return TrialColumns(
        object_name=np.array(table["object"].to_pylist()),
        placement=_integers(table, "placement"),
        proposer=np.array(table["proposer"].to_pylist()),
        outcome=np.array(table["outcome"].to_pylist()),
        position=vectors(table["position"]).astype(float),
        quaternion_wxyz=vectors(table["quaternion_wxyz"]).astype(float),
        joints=vectors(table["joints"]).astype(float),
        closed_joints=vectors(table["closed_joints"]).astype(float),
        contact_links=_numbers(table, "contact_links"),
        pushed=_numbers(table, "pushed"),
        repeats=_integers(table, "repeats"),
        held=_integers(table, "held"),
    )


def _numbers(table: pa.Table, name: str) -> np.ndarray:
    """A column of numbers, NaN where it is null or not there at all."""
    if name not in table.column_names:
        return np.full(len(table), np.nan)
    return table[name].cast(pa.float64()).to_numpy()


def _integers(table: pa.Table, name: str) -> np.ndarray:
    """A column of integers, 0 where it is null or not there at all."""
    return np.nan_to_num(_numbers(table, name)).astype(int)
