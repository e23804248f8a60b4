"""Trials made up for tests, in memory and as a data set on disk: no physics."""

import dataclasses

import numpy as np
import pyarrow as pa

from ffhnet.dataset.columns import TrialColumns
from ffhnet.dataset.records import write_header, write_table
from ffhnet.hands import load_hand
from ffhnet.simulation.physics import Physics

HAND = load_hand()


def make_trials(outcomes, **changes):
    """One trial per outcome, all of one grasp by one proposer on one placement, unless told otherwise."""
    n = len(outcomes)
    given = {
        "object_name": np.array(["tube_000008"] * n),
        "placement": np.zeros(n, dtype=int),
        "proposer": np.array(["power"] * n),
        "outcome": np.array(outcomes),
        "position": np.zeros((n, 3)),
        "quaternion_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "joints": np.zeros((n, HAND.num_joints)),
        "closed_joints": np.zeros((n, HAND.num_joints)),
        "contact_links": np.full(n, 5.0),
        "pushed": np.zeros(n),
        "repeats": np.zeros(n, dtype=int),
        "held": np.zeros(n, dtype=int),
    }
    return TrialColumns(**{**given, **changes})


def write_data_set(folder, trials, repeated=True, versions=None):
    """A data set with these trials and three views per placement; without repeats it is of the older form."""
    vectors = {"position": pa.float32(), "quaternion_wxyz": pa.float32()}
    vectors |= {"joints": pa.float16(), "closed_joints": pa.float16()}
    plain = {"placement": pa.int8(), "contact_links": pa.int8(), "pushed": pa.float32()}
    if repeated:
        plain |= {"repeats": pa.int8(), "held": pa.int8()}
    columns = {
        name: pa.array(getattr(trials, name).tolist()).dictionary_encode() for name in ("proposer", "outcome")
    }
    columns["object"] = pa.array(trials.object_name.tolist()).dictionary_encode()
    for name, kind in vectors.items():
        array = getattr(trials, name)
        rows = [None if np.isnan(row).any() else row.astype(kind.to_pandas_dtype()) for row in array]
        columns[name] = pa.array(rows, type=pa.list_(kind, array.shape[1]))
    for name, kind in plain.items():
        array = getattr(trials, name)
        columns[name] = pa.array([None if np.isnan(value) else value.item() for value in array]).cast(kind)
    write_table(pa.table(columns), folder / "trials" / "trials.parquet")
    num_views = 3 * len(np.unique(trials.placement_key))
    write_table(pa.table({"table_height": pa.array([0.0] * num_views)}), folder / "views" / "views.parquet")
    header = {
        "hand": HAND.name,
        "joint_names": list(HAND.joint_names),
        "closes": [bool(moves) for moves in HAND.closing.moves],
        "generation": {"seed": 7, "physics": dataclasses.asdict(Physics())},
    }
    write_header(folder, header if versions is None else {**header, "versions": versions})
    return folder
