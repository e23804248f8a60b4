"""Trials as GraspGen's grasp files, so that others can use them: one JSON and one mesh per object.

The format (GraspGen, docs/GRASP_DATASET_FORMAT.md) is `object.file`, `object.scale`, `grasps.transforms` and
`grasps.object_in_gripper`, plus text files with the mesh paths of each split. What it has no place for is
written into further fields, which its readers pass over. See `docs/exchange.md`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.dataset.columns import TrialColumns, read_trial_columns, split_of
from ffhnet.dataset.records import read_header
from ffhnet.errors import DatasetError
from ffhnet.files import write_atomically
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.hands import Hand, load_hand
from ffhnet.objects.grasp_object import GraspObject

POSE_DIGITS = 8
"""Decimals of poses in the file: a hundredth of a micrometre."""

_ANGLE_DIGITS = 5  # less than the 16 bits of a stored angle resolve from 0.01 rad on
_SPLIT_FILES = {"train": "train.txt", "val": "valid.txt", "test": "test.txt", "scans": "scans.txt"}


@dataclass(frozen=True)
class TrialFields:
    """What one of our files says beyond the format.

    Attributes:
        hand: name of the hand.
        joint_names: order of the joints.
        T_base_palm: pose of the palm frame in the base link.
        mass: of the object, kg.
        T_world_object: pose of the object for each placement, table top at z = 0.
        placement: index of the placement of each grasp.
        joints: joint angles to which the hand closes, rad.
        closed_joints: measured after closing, rad; NaN where nothing was executed.
        proposer: what proposed each grasp.
        outcome: name of an `Outcome` for each grasp.
        repeats, held: repeats under perturbation and how many of them succeeded.
    """

    hand: str
    joint_names: tuple[str, ...]
    T_base_palm: Float[np.ndarray, "4 4"]
    mass: float
    T_world_object: Float[np.ndarray, "P 4 4"]
    placement: Int[np.ndarray, " N"]
    joints: Float[np.ndarray, "N J"]
    closed_joints: Float[np.ndarray, "N J"]
    proposer: tuple[str, ...]
    outcome: tuple[str, ...]
    repeats: Int[np.ndarray, " N"]
    held: Int[np.ndarray, " N"]


@dataclass(frozen=True)
class ObjectGrasps:
    """One grasp file: N grasps of one object.

    Attributes:
        mesh: path of the mesh, relative to the folder of meshes.
        scale: factor from the mesh to metres.
        T_object_base: pose of the gripper's base link in the frame of the scaled mesh.
        success: whether each grasp held the object.
        extra: our further fields; None in files of others.
    """

    mesh: str
    scale: float
    T_object_base: Float[np.ndarray, "N 4 4"]
    success: Bool[np.ndarray, " N"]
    extra: TrialFields | None = None

    def T_world_palm(self) -> Float[np.ndarray, "N 4 4"]:
        """Palm poses in the world, as in a trials table. Raises DatasetError for files of others."""
        if self.extra is None:
            raise DatasetError(f"the grasps of {self.mesh} name no resting poses and no palm frame")
        return self.extra.T_world_object[self.extra.placement] @ self.T_object_base @ self.extra.T_base_palm


def export_grasps(folder: Path, out: Path, load_object: Callable[[str], GraspObject]) -> int:
    """Writes `out/grasps/NAME.json`, `out/meshes/NAME.obj` and `out/splits/*.txt` for a data set.

    Args:
        folder: the data set.
        out: folder of the export; made.
        load_object: builds an object from its name.

    Returns:
        Number of objects.

    Raises:
        DatasetError: the folder is no data set.
        ObjectError: an object cannot be built.
        OptionError: a file cannot be written.
    """
    hand = load_hand(read_header(folder)["hand"])
    trials = read_trial_columns([folder])
    names = sorted(set(trials.object_name.tolist()))
    for part in ("grasps", "meshes", "splits"):
        (out / part).mkdir(parents=True, exist_ok=True)
    for name in names:
        obj = load_object(name)
        grasps = object_grasps(trials[trials.object_name == name], obj, hand)
        write_atomically(out / "meshes" / grasps.mesh, obj.visual.export(file_type="obj").encode())
        write_grasps(grasps, out / "grasps" / f"{name}.json")
    for split, file in _SPLIT_FILES.items():
        lines = [f"{name}.obj\n" for name in names if split_of(name) == split]
        if lines:
            write_atomically(out / "splits" / file, "".join(lines).encode())
    return len(names)


def object_grasps(trials: TrialColumns, obj: GraspObject, hand: Hand) -> ObjectGrasps:
    """The trials of one object in the frames of the format."""
    T_world_palm = make_transform(matrix_from_quaternion(trials.quaternion_wxyz), trials.position)
    T_object_world = invert(obj.resting_poses)[trials.placement]
    return ObjectGrasps(
        mesh=f"{obj.name}.obj",
        scale=1.0,
        T_object_base=T_object_world @ T_world_palm @ invert(hand.T_root_palm),
        success=trials.success,
        extra=TrialFields(
            hand=hand.name,
            joint_names=hand.joint_names,
            T_base_palm=hand.T_root_palm,
            mass=obj.mass,
            T_world_object=obj.resting_poses,
            placement=trials.placement,
            joints=trials.joints,
            closed_joints=trials.closed_joints,
            proposer=tuple(trials.proposer.tolist()),
            outcome=tuple(trials.outcome.tolist()),
            repeats=trials.repeats,
            held=trials.held,
        ),
    )


def write_grasps(grasps: ObjectGrasps, path: Path) -> None:
    """Writes one grasp file. Raises OptionError where it cannot be written."""
    content: dict[str, Any] = {
        "object": {"file": grasps.mesh, "scale": grasps.scale},
        "grasps": {
            "transforms": grasps.T_object_base.round(POSE_DIGITS).tolist(),
            "object_in_gripper": grasps.success.tolist(),
        },
    }
    extra = grasps.extra
    if extra is not None:
        content["object"] |= {"mass": extra.mass, "T_world_object": extra.T_world_object.tolist()}
        content["gripper"] = {
            "name": extra.hand,
            "joint_names": list(extra.joint_names),
            "T_base_palm": extra.T_base_palm.tolist(),
        }
        closed = extra.closed_joints.round(_ANGLE_DIGITS)
        content["grasps"] |= {
            "placement": extra.placement.tolist(),
            "joints": extra.joints.round(_ANGLE_DIGITS).tolist(),
            "closed_joints": [None if np.isnan(row).any() else row.tolist() for row in closed],
            "proposer": list(extra.proposer),
            "outcome": list(extra.outcome),
            "repeats": extra.repeats.tolist(),
            "held": extra.held.tolist(),
        }
    write_atomically(path, (json.dumps(content, separators=(",", ":")) + "\n").encode())


def read_grasps(path: Path) -> ObjectGrasps:
    """Reads one grasp file, ours or GraspGen's own.

    Raises:
        DatasetError: the file cannot be read or is not of the format.
    """
    try:
        content = json.loads(path.read_text())
        grasps = content["grasps"]
        transforms = np.array(grasps["transforms"], dtype=float).reshape(-1, 4, 4)
        # The format's files hold booleans or 0 and 1, as a list or as a column.
        success = np.array(grasps["object_in_gripper"]).reshape(-1).astype(bool)
        found = ObjectGrasps(
            mesh=str(content["object"].get("file", path.stem)),
            scale=float(content["object"]["scale"]),
            T_object_base=transforms,
            success=success,
            extra=_read_extra(content) if "gripper" in content else None,
        )
    except (OSError, KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise DatasetError(f"{path} is no grasp file ({type(error).__name__}: {error})") from error
    _check(found, path)
    return found


def read_folder(folder: Path) -> list[ObjectGrasps]:
    """Every grasp file of a folder, by name. Raises DatasetError, also where there is none."""
    files = sorted(file for file in folder.glob("*.json") if file.name != "map_uuid_to_path.json")
    if not files:
        raise DatasetError(f"{folder} holds no grasp files (*.json)")
    return [read_grasps(file) for file in files]


def _read_extra(content: dict[str, Any]) -> TrialFields:
    grasps, gripper = content["grasps"], content["gripper"]
    names = tuple(gripper["joint_names"])
    closed = [[np.nan] * len(names) if row is None else row for row in grasps["closed_joints"]]
    return TrialFields(
        hand=str(gripper["name"]),
        joint_names=names,
        T_base_palm=np.array(gripper["T_base_palm"], dtype=float).reshape(4, 4),
        mass=float(content["object"]["mass"]),
        T_world_object=np.array(content["object"]["T_world_object"], dtype=float).reshape(-1, 4, 4),
        placement=np.array(grasps["placement"], dtype=int),
        joints=np.array(grasps["joints"], dtype=float).reshape(-1, len(names)),
        closed_joints=np.array(closed, dtype=float).reshape(-1, len(names)),
        proposer=tuple(grasps["proposer"]),
        outcome=tuple(grasps["outcome"]),
        repeats=np.array(grasps["repeats"], dtype=int),
        held=np.array(grasps["held"], dtype=int),
    )


def _check(grasps: ObjectGrasps, path: Path) -> None:
    """Raises DatasetError where lengths differ, a pose is no rigid transform, or a placement is unknown."""
    T, extra = grasps.T_object_base, grasps.extra
    columns: list[Sequence[Any] | np.ndarray] = [grasps.success]
    if extra is not None:
        columns += [extra.placement, extra.joints, extra.closed_joints, extra.proposer]
        columns += [extra.outcome, extra.repeats, extra.held]
        known = (extra.placement >= 0) & (extra.placement < len(extra.T_world_object))
        if not known.all():
            raise DatasetError(f"{path}: a placement is not among its {len(extra.T_world_object)} poses")
    lengths = sorted({len(T), *(len(column) for column in columns)})
    if len(lengths) > 1:
        raise DatasetError(f"{path}: wanted as many values as transforms everywhere, got {lengths}")
    square = np.swapaxes(T[:, :3, :3], 1, 2) @ T[:, :3, :3]
    if not np.isfinite(T).all():
        raise DatasetError(f"{path}: a transform is not finite")
    if not (np.allclose(square, np.eye(3), atol=1e-3) and np.allclose(T[:, 3], [0, 0, 0, 1], atol=1e-6)):
        raise DatasetError(f"{path}: a transform is not rigid")
