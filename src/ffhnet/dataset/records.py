"""Parquet files of a data set: one row per trial, one row per view.

A data set is a folder with `trials/*.parquet`, `views/*.parquet` and `dataset.json` (hand, joint order and
the settings it was made with). Any number of files may lie in the two folders: generation writes one pair per
object, `pack` joins them. See `docs/data.md` for every column.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int

from ffhnet.dataset.parquet import read_table, table_bytes
from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError
from ffhnet.files import write_atomically
from ffhnet.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from ffhnet.grasps import Grasps
from ffhnet.simulation.trial import Outcome, TrialResults

FORMAT = 2
PROPOSERS = ("heuristic", "power", "perturb", "learned")


@dataclass(frozen=True)
class ViewRow:
    """One view of one placement: what the networks are given.

    Attributes:
        bps: BPS encoding in the view frame, m.
        table_height: z of the table in the view frame, m.
        T_world_view: pose of the view frame in the world.
    """

    bps: Float[np.ndarray, " 4096"]
    table_height: float
    T_world_view: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class ViewBlock:
    """Views of one placement."""

    placement: int
    rows: list[ViewRow]


@dataclass(frozen=True)
class TrialBlock:
    """Trials of one proposer on one placement.

    Attributes:
        placement: index of the resting pose.
        proposer: one of `PROPOSERS`.
        grasps: world frame, as accurate as the files are (`as_stored`).
        results: what became of them.
        repeats: how often each trial was repeated under perturbation.
        held: how many of the repeats succeeded.
    """

    placement: int
    proposer: str
    grasps: Grasps
    results: TrialResults
    repeats: Int[np.ndarray, " N"]
    held: Int[np.ndarray, " N"]


def as_stored(grasps: Grasps) -> Grasps:
    """The grasps as they are read back from a file: rounded to 16 bit (0.1 mm, 0.05°, 0.5 mrad).

    What is tried is rounded before, so that a label belongs to exactly the grasp that stands beside it.
    """
    quaternion = quaternion_from_matrix(grasps.rotation).astype(np.float16)
    return grasps.replace(
        rotation=matrix_from_quaternion(quaternion),
        position=grasps.position.astype(np.float16).astype(float),
        joints=grasps.joints.astype(np.float16).astype(float),
    )


def trials_table(object_name: str, blocks: list[TrialBlock]) -> pa.Table:
    """Arrow table of trials."""
    tables = []
    for block in blocks:
        grasps, results = block.grasps, block.results
        outcomes = [Outcome(o).name.lower() for o in results.outcome]
        n = len(grasps)
        tables.append(
            pa.table(
                {
                    "object": pa.array([object_name] * n).dictionary_encode(),
                    "placement": pa.array(np.full(n, block.placement, np.int8)),
                    "proposer": pa.array([block.proposer] * n).dictionary_encode(),
                    "position": _lists(grasps.position, np.float16),
                    "quaternion_wxyz": _lists(quaternion_from_matrix(grasps.rotation), np.float16),
                    "joints": _lists(grasps.joints, np.float16),
                    "outcome": pa.array(outcomes).dictionary_encode(),
                    "margin": pa.array(results.margin.astype(np.float32)),
                    "closed_joints": _lists(results.closed_joints, np.float16, missing=~results.executed),
                    "contact_links": pa.array(results.contact_links.astype(np.int8)),
                    "pushed": pa.array(results.pushed.astype(np.float16)),
                    "rise": pa.array(results.rise.astype(np.float16)),
                    "hold_slip": pa.array(results.hold_slip.astype(np.float16)),
                    "repeats": pa.array(block.repeats.astype(np.int8)),
                    "held": pa.array(block.held.astype(np.int8)),
                }
            )
        )
    return pa.concat_tables(tables).unify_dictionaries()


def views_table(object_name: str, blocks: list[ViewBlock]) -> pa.Table:
    """Arrow table of views."""
    rows = [row for block in blocks for row in block.rows]
    placement = [block.placement for block in blocks for _ in block.rows]
    bps_mm = np.clip(np.round(np.stack([row.bps for row in rows]) * 1000), 0, 255)
    return pa.table(
        {
            "object": pa.array([object_name] * len(rows)).dictionary_encode(),
            "placement": pa.array(np.array(placement, np.int8)),
            "bps_mm": _lists(bps_mm, np.uint8),
            "table_height": pa.array(np.array([row.table_height for row in rows], np.float32)),
            "T_world_view": _lists(np.stack([row.T_world_view.ravel() for row in rows]), np.float32),
        }
    )


def write_table(table: pa.Table, path: Path) -> None:
    """Writes a Parquet file so that it is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, table_bytes(table))


def write_header(folder: Path, header: dict[str, Any]) -> None:
    """Writes `dataset.json`, or checks that the existing one agrees.

    Raises:
        DatasetError: the folder holds a data set made with other settings.
    """
    path = folder / "dataset.json"
    header = {"format": FORMAT, **json.loads(json.dumps(header))}
    if path.exists():
        existing = read_header(folder)
        different = sorted(k for k in header.keys() | existing.keys() if header.get(k) != existing.get(k))
        if different:
            raise DatasetError(
                f"{folder} holds a data set with other settings ({', '.join(different)}): "
                "choose another folder, or the settings it was started with"
            )
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(path, (json.dumps(header, indent=2) + "\n").encode())


def read_header(folder: Path) -> dict[str, Any]:
    """The content of `dataset.json`. Raises DatasetError."""
    path = folder / "dataset.json"
    try:
        header = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise DatasetError(f"{folder} is no data set: cannot read dataset.json ({error})") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DatasetError(f"{path} is not of format {FORMAT}")
    missing = sorted({"hand", "joint_names", "closes"} - header.keys())
    if missing:
        raise DatasetError(f"{path} does not say {' and '.join(missing)}")
    return header


def read_tables(folder: Path, kind: str) -> pa.Table:
    """All rows of `kind` ("trials" or "views"). Raises DatasetError."""
    files = sorted((folder / kind).glob("[!.]*.parquet"))
    if not files:
        raise DatasetError(f"{folder} holds no {kind}")
    try:
        return pa.concat_tables([read_table(file) for file in files]).unify_dictionaries()
    except pa.ArrowException as error:
        raise DatasetError(f"{folder}: the files of {kind} do not go together ({error})") from error


@contextlib.contextmanager
def complaining(folders: Sequence[Path]) -> Iterator[None]:
    """Says of whatever goes wrong inside that the data sets do not hold what they should."""
    try:
        yield
    except (KeyError, ValueError, TypeError, AttributeError, pa.ArrowException) as error:
        names = ", ".join(map(str, folders))
        raise DatasetError(
            f"{names}: a column is missing or malformed ({type(error).__name__}: {error})"
        ) from error


def pack(source: Path, target: Path) -> None:
    """Joins the files of a data set into one file of trials and one of views."""
    header = read_header(source)
    for kind in ("trials", "views"):
        write_table(read_tables(source, kind), target / kind / f"{kind}.parquet")
    write_header(target, {k: v for k, v in header.items() if k != "format"})


def read_training_data(folders: list[Path]) -> TrainingData:
    """The training arrays of one or more data sets of the same hand.

    Placements are matched across the folders by object name and placement number, so that grasps that
    were tried later are trained with all views of the placement. Raises DatasetError.
    """
    headers = [read_header(folder) for folder in folders]
    if not headers:
        raise DatasetError("wanted at least one data set, got none")
    if any((h["hand"], h["joint_names"]) != (headers[0]["hand"], headers[0]["joint_names"]) for h in headers):
        raise DatasetError("the data sets are of different hands or joint orders")
    with complaining(folders):
        return _training_data(headers[0], folders)


def _training_data(header: dict[str, Any], folders: list[Path]) -> TrainingData:
    tables = [_plain(read_tables(folder, "trials")) for folder in folders]
    robust = np.concatenate([_robust(table, k) for k, table in enumerate(tables)])
    trials = pa.concat_tables(tables)
    views = pa.concat_tables([_plain(read_tables(f, "views")) for f in folders])

    view_keys, trial_keys = _placement_keys(views), _placement_keys(trials)
    placements, view_placement = np.unique(view_keys, return_inverse=True)
    known = np.isin(trial_keys, placements)
    trials = trials.filter(pa.array(known))
    object_of_placement = np.array([key.rpartition("/")[0] for key in placements])
    objects, placement_object = np.unique(object_of_placement, return_inverse=True)

    outcome = np.array(trials["outcome"].to_pylist())
    return TrainingData(
        hand=header["hand"],
        joint_names=tuple(header["joint_names"]),
        closes=np.array(header["closes"], dtype=bool),
        object_names=tuple(objects.tolist()),
        placement_object=placement_object,
        view_placement=view_placement,
        bps=vectors(views["bps_mm"]).astype(np.float16) * np.float16(0.001),
        table_height=views["table_height"].to_numpy(),
        T_world_view=vectors(views["T_world_view"]).reshape(-1, 4, 4).astype(float),
        trial_placement=np.searchsorted(placements, trial_keys[known]),
        rotation=matrix_from_quaternion(vectors(trials["quaternion_wxyz"])),
        position=vectors(trials["position"]).astype(float),
        joints=vectors(trials["joints"]).astype(float),
        closed_joints=vectors(trials["closed_joints"]).astype(float),
        margin=trials["margin"].to_numpy().astype(float),
        label=(outcome == "success").astype(float),
        robust=robust[known],
        executed=outcome != "collision",
        proposer=np.array([PROPOSERS.index(p) for p in trials["proposer"].to_pylist()]),
    )


def _robust(trials: pa.Table, seed: int) -> Float[np.ndarray, " T"]:
    """`TrainingData.robust` of the trials of one data set."""
    repeats = trials["repeats"].to_numpy().astype(float)
    held = trials["held"].to_numpy()
    share = np.divide(held, repeats, out=np.full(len(repeats), np.nan), where=repeats > 0)
    hopeless = np.isin(np.array(trials["outcome"].to_pylist()), ("collision", "missed"))
    if (~hopeless).any():
        rate = (repeats[~hopeless] > 0).mean()
        share[hopeless & (np.random.default_rng(seed).random(len(share)) < rate)] = 0.0
    return share


def _lists(
    array: np.ndarray, dtype: type, missing: Bool[np.ndarray, " N"] | None = None
) -> pa.FixedSizeListArray:
    flat = pa.array(np.ascontiguousarray(array, dtype=dtype).ravel())
    mask = None if missing is None else pa.array(missing)
    return pa.FixedSizeListArray.from_arrays(flat, array.shape[1], mask=mask)


def vectors(column: pa.ChunkedArray) -> np.ndarray:
    """A column of lists of one length as an N × length array, NaN where it is null."""
    # `flatten` leaves the null rows out.
    filled = np.concatenate([chunk.flatten().to_numpy() for chunk in column.chunks])
    filled = filled.reshape(-1, column.type.list_size)
    if column.null_count == 0:
        return filled
    array = np.full((len(column), column.type.list_size), np.nan, filled.dtype)
    array[column.is_valid().to_numpy()] = filled
    return array


def _plain(table: pa.Table) -> pa.Table:
    """Dictionary columns as plain strings, so that tables of different folders join."""
    for i, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            table = table.set_column(i, field.name, table[field.name].cast(pa.string()))
    return table


def _placement_keys(table: pa.Table) -> np.ndarray:
    return np.array(
        [
            f"{name}/{number}"
            for name, number in zip(table["object"].to_pylist(), table["placement"].to_pylist(), strict=True)
        ]
    )
