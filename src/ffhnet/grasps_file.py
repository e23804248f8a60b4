"""`Grasps` as files: JSON for people and robots, NPZ for arrays."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ffhnet.errors import InputFileError, OptionError
from ffhnet.files import check_output, write_atomically
from ffhnet.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from ffhnet.grasps import Grasps

SUFFIXES = (".json", ".npz")

SCORE_NAMES = {"probability": "success_probability", "robustness": "robust_probability"}
"""What the scores of `Grasps` are called in files."""

_UNIT_TOLERANCE = 1e-3


def save_grasps(grasps: Grasps, path: str | Path) -> None:
    """Write grasps in their order and frame.

    A `.json` holds one object: `hand`, `frame`, `joint_names`, and `grasps`, a list of objects with
    `palm_position` (m), `palm_quaternion_wxyz`, `joint_angles` (rad), `success_probability` and
    `robust_probability` (null where not known). An `.npz` holds the same names as arrays, the grasps'
    fields stacked, without those that are not known.

    Raises:
        OptionError: another suffix, or the file cannot be written.
    """
    path = Path(path)
    check_output(path, SUFFIXES)
    data = _to_json(grasps) if path.suffix.lower() == ".json" else _to_npz(grasps)
    write_atomically(path, data)


def load_grasps(path: str | Path) -> Grasps:
    """Read what `save_grasps` wrote.

    Raises:
        InputFileError: the file is missing, damaged, or holds something else.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputFileError(f"{path}: a grasp file must end in {' or '.join(SUFFIXES)}, got '{path.suffix}'")
    try:
        fields = _read_json(path) if path.suffix.lower() == ".json" else _read_npz(path)
        return _from_fields(fields)
    except FileNotFoundError:
        raise InputFileError(f"{path}: no such file") from None
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, OptionError) as error:
        raise InputFileError(f"{path}: not a grasp file ({type(error).__name__}: {error})") from error


def _columns(grasps: Grasps) -> dict[str, np.ndarray | None]:
    """What a file holds of each grasp, by the names it has there; None where it is not known."""
    return {
        "palm_position": grasps.position,
        "palm_quaternion_wxyz": quaternion_from_matrix(grasps.rotation),
        "joint_angles": grasps.joints,
        **{name: getattr(grasps, attribute) for attribute, name in SCORE_NAMES.items()},
    }


def _to_json(grasps: Grasps) -> bytes:
    columns = {
        name: [None] * len(grasps) if column is None else column.tolist()
        for name, column in _columns(grasps).items()
    }
    rows = zip(*columns.values(), strict=True)
    lines = [json.dumps(dict(zip(columns, row, strict=True))) for row in rows]
    header = json.dumps({"hand": grasps.hand, "frame": grasps.frame, "joint_names": list(grasps.joint_names)})
    # One grasp per line: indented JSON would take a line for each number.
    return (header[:-1] + ', "grasps": [\n' + ",\n".join(lines) + "\n]}\n").encode()


def _to_npz(grasps: Grasps) -> bytes:
    fields: dict[str, Any] = {
        "hand": np.array(grasps.hand),
        "frame": np.array(grasps.frame),
        "joint_names": np.array(grasps.joint_names),
        **{name: column for name, column in _columns(grasps).items() if column is not None},
    }
    buffer = io.BytesIO()
    np.savez(buffer, **fields)
    return buffer.getvalue()


def _read_json(path: Path) -> dict[str, Any]:
    content = json.loads(path.read_text(encoding="utf-8"))
    rows = content["grasps"]
    names = ("palm_position", "palm_quaternion_wxyz", "joint_angles")
    fields = {name: [row[name] for row in rows] for name in names}
    for name in SCORE_NAMES.values():
        values = [row.get(name) for row in rows]
        if None not in values:
            fields[name] = values
    return {**{name: content[name] for name in ("hand", "frame", "joint_names")}, **fields}


def _read_npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _from_fields(fields: dict[str, Any]) -> Grasps:
    joint_names = tuple(str(name) for name in fields["joint_names"])
    quaternion = np.asarray(fields["palm_quaternion_wxyz"], dtype=float).reshape(-1, 4)
    length = np.linalg.norm(quaternion, axis=1)
    if np.any(np.abs(length - 1) > _UNIT_TOLERANCE):
        raise ValueError(f"quaternions must have length 1, got {length[np.abs(length - 1).argmax()]:.4f}")
    scores = {
        attribute: np.asarray(fields[name], dtype=float)
        for attribute, name in SCORE_NAMES.items()
        if name in fields
    }
    return Grasps(
        rotation=matrix_from_quaternion(quaternion) if len(quaternion) else np.zeros((0, 3, 3)),
        position=np.asarray(fields["palm_position"], dtype=float).reshape(-1, 3),
        joints=np.asarray(fields["joint_angles"], dtype=float).reshape(-1, len(joint_names)),
        joint_names=joint_names,
        hand=str(fields["hand"]),
        frame=str(fields["frame"]),
        **scores,
    )
