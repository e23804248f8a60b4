"""`Grasps` and `GraspPlan` as files; `docs/execution.md` describes every field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from ffhnet.errors import InputFileError, OptionError
from ffhnet.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasp_plan import ArmMotion, GraspPlan
from ffhnet.grasps import Grasps
from ffhnet.hands.closing import JointTrajectory
from ffhnet.table_file import SUFFIXES, Fields, read_tables, write_tables

__all__ = ["SCORE_NAMES", "SUFFIXES", "load_grasps", "load_plan", "save_grasps", "save_plan"]

SCORE_NAMES = {"probability": "success_probability", "robustness": "robust_probability"}
"""What the scores of `Grasps` are called in files."""

_GRASPS, _DROPPED = "grasps", "dropped"
_UNIT_TOLERANCE = 1e-3
_DECIMALS = 6
"""Of the closing motion: micrometres at the fingertips."""

Content = TypeVar("Content")


def save_grasps(grasps: Grasps, path: str | Path) -> None:
    """Write grasps in their order and frame.

    A `.json` holds one object: `hand`, `frame`, `joint_names`, and `grasps`, a list of objects with
    `palm_position` (m), `palm_quaternion_wxyz`, `joint_angles` (rad), `success_probability` and
    `robust_probability` (null where not known). An `.npz` holds the same names as arrays, the grasps'
    fields stacked, without those that are not known.

    Raises:
        OptionError: another suffix, or the file cannot be written.
    """
    write_tables(path, _header(grasps), {_GRASPS: _columns(grasps)})


def save_plan(plan: GraspPlan, path: str | Path) -> None:
    """Write what `save_grasps` writes of the feasible grasps, how they are done, and the dropped ones.

    In an `.npz` the fields of dropped grasps begin with `dropped_`.

    Raises:
        OptionError: another suffix, or the file cannot be written.
    """
    columns = _columns(plan.grasps) | {
        "pregrasp_palm_position": plan.pregrasp_position,
        "preshape_joint_angles": plan.preshape,
        "closing_times": plan.closing.times.round(_DECIMALS),
        "closing_joint_angles": plan.closing.joints.round(_DECIMALS),
    }
    header = _header(plan.grasps) | {
        "standoff": plan.standoff,
        "torque_limits": plan.torque_limit,
        "target_lead": plan.lead,
    }
    if plan.novelty is not None:
        header["novelty"] = plan.novelty
    if plan.arm is not None:
        T = plan.arm.T_frame_base
        columns |= {
            "arm_approach_joint_angles": plan.arm.approach,
            "arm_lift_joint_angles": plan.arm.lift,
        }
        header |= {
            "arm": plan.arm.robot,
            "arm_joint_names": list(plan.arm.joint_names),
            "arm_base_position": T[:3, 3],
            "arm_base_quaternion_wxyz": quaternion_from_matrix(T[:3, :3]),
        }
    dropped = _columns(plan.dropped) | {"reason": np.array(plan.reasons, dtype=str)}
    write_tables(path, header, {_GRASPS: columns, _DROPPED: dropped})


def load_grasps(path: str | Path) -> Grasps:
    """Read the grasps that `save_grasps` or `save_plan` wrote.

    Raises:
        InputFileError: the file is missing, damaged, or holds something else.
    """
    return _load(path, _grasps)


def load_plan(path: str | Path) -> GraspPlan:
    """Read what `save_plan` wrote.

    Raises:
        InputFileError: the file is missing, damaged, or holds something else, for example grasps without a
            plan.
    """
    return _load(path, _plan)


def _header(grasps: Grasps) -> Fields:
    return {"hand": grasps.hand, "frame": grasps.frame, "joint_names": list(grasps.joint_names)}


def _columns(grasps: Grasps) -> Fields:
    """What a file holds of each grasp, by the names it has there; None where it is not known."""
    return {
        "palm_position": grasps.position,
        "palm_quaternion_wxyz": quaternion_from_matrix(grasps.rotation),
        "joint_angles": grasps.joints,
        **{name: getattr(grasps, attribute) for attribute, name in SCORE_NAMES.items()},
    }


def _load(path: str | Path, make: Callable[[Fields], Content]) -> Content:
    fields = read_tables(path, (_GRASPS, _DROPPED))
    try:
        return make(fields)
    except (ValueError, KeyError, TypeError, OptionError) as error:
        raise InputFileError(f"{path}: not a grasp file ({type(error).__name__}: {error})") from error


def _grasps(fields: Fields, table: str = _GRASPS) -> Grasps:
    names = tuple(str(name) for name in fields["joint_names"])
    known = {attribute: name for attribute, name in SCORE_NAMES.items() if _has(fields, table, name)}
    return Grasps(
        rotation=_rotation(_column(fields, table, "palm_quaternion_wxyz", 4)),
        position=_column(fields, table, "palm_position", 3),
        joints=_column(fields, table, "joint_angles", len(names)),
        joint_names=names,
        hand=str(fields["hand"]),
        frame=str(fields["frame"]),
        **{attribute: _column(fields, table, name) for attribute, name in known.items()},
    )


def _plan(fields: Fields) -> GraspPlan:
    grasps, dropped = _grasps(fields), _grasps(fields, _DROPPED)
    count = grasps.joints.shape[1]
    limits = [np.inf if limit is None else limit for limit in fields["torque_limits"]]
    reasons = fields[f"{_DROPPED}_reason"] if len(dropped) else []
    return GraspPlan(
        grasps=grasps,
        standoff=float(fields["standoff"]),
        preshape=_column(fields, _GRASPS, "preshape_joint_angles", count),
        closing=JointTrajectory(
            times=_column(fields, _GRASPS, "closing_times", None),
            joints=_column(fields, _GRASPS, "closing_joint_angles", None, count),
        ),
        torque_limit=np.array(limits, dtype=float),
        lead=float(fields["target_lead"]),
        arm=_arm(fields) if "arm" in fields else None,
        dropped=dropped,
        reasons=tuple(str(reason) for reason in reasons),
        novelty=float(fields["novelty"]) if "novelty" in fields else None,
    )


def _arm(fields: Fields) -> ArmMotion:
    names = tuple(str(name) for name in fields["arm_joint_names"])
    rotation = _rotation(np.asarray(fields["arm_base_quaternion_wxyz"], dtype=float)[None])[0]
    return ArmMotion(
        robot=str(fields["arm"]),
        joint_names=names,
        T_frame_base=make_transform(rotation, np.asarray(fields["arm_base_position"], dtype=float)),
        approach=_column(fields, _GRASPS, "arm_approach_joint_angles", None, len(names)),
        lift=_column(fields, _GRASPS, "arm_lift_joint_angles", None, len(names)),
    )


_BEFORE = {_GRASPS: "", _DROPPED: f"{_DROPPED}_"}


def _has(fields: Fields, table: str, name: str) -> bool:
    """Whether a column is known; in an empty table every column is."""
    return fields.get(table) == 0 or _BEFORE[table] + name in fields


def _column(fields: Fields, table: str, name: str, *shape: int | None) -> np.ndarray:
    """A column whose entries have this shape, None being any length."""
    if fields.get(table) == 0:
        return np.zeros((0, *(size or 0 for size in shape)))
    column = np.asarray(fields[_BEFORE[table] + name], dtype=float)
    came = column.shape[1:]
    if len(came) != len(shape) or any(w not in (None, c) for w, c in zip(shape, came, strict=True)):
        raise ValueError(f"{name} must have entries of shape {shape}, got {came}")
    return column


def _rotation(quaternion: Float[np.ndarray, "N 4"]) -> Float[np.ndarray, "N 3 3"]:
    length = np.linalg.norm(quaternion, axis=1)
    if np.any(np.abs(length - 1) > _UNIT_TOLERANCE):
        raise ValueError(f"quaternions must have length 1, got {length[np.abs(length - 1).argmax()]:.4f}")
    return matrix_from_quaternion(quaternion) if len(quaternion) else np.zeros((0, 3, 3))
