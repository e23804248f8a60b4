"""Kinematics of the Franka Emika Panda: forward in plain NumPy, inverse in closed form and verified.

Frames: `base` is link 0, z up, x to the front; `flange` is the plate that carries the hand (link 8).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

from ffhnet.errors import MissingExtraError

LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
"""Lower joint limits, rad."""
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
"""Upper joint limits, rad."""
MAX_SPEED = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
"""Joint speed limits, rad/s."""

_A = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])
_D = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])
_TWIST = np.array([0, -1, 1, 1, -1, 1, 1])
_FLANGE = 0.107

POSITION_TOLERANCE = 5e-4
"""m by which an accepted solution may miss the wanted pose."""
ROTATION_TOLERANCE = 5e-3
"""rad by which an accepted solution may miss the wanted pose."""

_LENGTH = 0.87
"""m: the flange is never further from the shoulder, where the first two axes meet."""

_ANY_Q7 = np.linspace(LOWER[6], UPPER[6], 26)[1:-1]
_DAMPING = 1e-4


def joint_frames(q: Float[np.ndarray, "*batch 7"]) -> Float[np.ndarray, "*batch 8 4 4"]:
    """T_base_link of links 1 to 7 and the flange, from modified Denavit-Hartenberg parameters (Craig).

    Args:
        q: joint angles, rad.
    """
    frames = np.zeros((*q.shape[:-1], 8, 4, 4))
    frames[..., 3, 3] = 1.0
    cos, sin = np.cos(q)[..., None], np.sin(q)[..., None]
    x, y, z = (np.broadcast_to(axis, (*q.shape[:-1], 3)) for axis in np.eye(3))
    origin = np.zeros_like(x)
    for i in range(7):
        origin = origin + _A[i] * x
        # All twists between the axes are right angles.
        y, z = (y, z) if _TWIST[i] == 0 else (_TWIST[i] * z, -_TWIST[i] * y)
        origin = origin + _D[i] * z
        x, y = cos[..., i, :] * x + sin[..., i, :] * y, cos[..., i, :] * y - sin[..., i, :] * x
        for column, vector in enumerate((x, y, z, origin)):
            frames[..., i, :3, column] = vector
    frames[..., 7, :, :] = frames[..., 6, :, :]
    frames[..., 7, :3, 3] += _FLANGE * z
    return frames


def forward(q: Float[np.ndarray, "*batch 7"]) -> Float[np.ndarray, "*batch 4 4"]:
    """T_base_flange of joint angles (rad)."""
    return joint_frames(q)[..., 7, :, :]


def within_limits(q: Float[np.ndarray, "*batch 7"]) -> Bool[np.ndarray, "*batch"]:
    """Whether all joints are within their limits; False for NaN."""
    return np.asarray(((q >= LOWER) & (q <= UPPER)).all(axis=-1))


def pose_error(
    q: Float[np.ndarray, "*batch 7"], T_base_flange: Float[np.ndarray, "*batch 4 4"]
) -> Float[np.ndarray, "*batch 6"]:
    """From the flange to where it should be: position (m), small rotation vector (rad), base frame."""
    return _pose_error(forward(q), T_base_flange)


def _pose_error(
    T_base_now: Float[np.ndarray, "*batch 4 4"], T_base_flange: Float[np.ndarray, "*batch 4 4"]
) -> Float[np.ndarray, "*batch 6"]:
    # Half the sum of the crossed axes is the rotation vector times sin(angle) / angle.
    now, wanted = T_base_now[..., :3, :3].swapaxes(-1, -2), T_base_flange[..., :3, :3].swapaxes(-1, -2)
    turn = _cross(now, wanted).sum(axis=-2) / 2
    return np.concatenate([T_base_flange[..., :3, 3] - T_base_now[..., :3, 3], turn], axis=-1)


def reaches(
    q: Float[np.ndarray, "*batch 7"], T_base_flange: Float[np.ndarray, "*batch 4 4"]
) -> Bool[np.ndarray, "*batch"]:
    """Whether joint angles are within limits and put the flange at the pose, within the tolerances above."""
    error = pose_error(q, T_base_flange)
    position, rotation = np.linalg.norm(error[..., :3], axis=-1), np.linalg.norm(error[..., 3:], axis=-1)
    return within_limits(q) & (position <= POSITION_TOLERANCE) & (rotation <= ROTATION_TOLERANCE)


def least_motion(
    q: Float[np.ndarray, "*batch 7"], twist: Float[np.ndarray, "*batch 6"]
) -> Float[np.ndarray, "*batch 7"]:
    """The smallest joint motion (rad) that moves the flange by a small twist.

    Args:
        q: joint angles, rad.
        twist: position (m) and rotation vector (rad) in the base frame.
    """
    return _least_motion(joint_frames(q), twist)


def _least_motion(
    frames: Float[np.ndarray, "*batch 8 4 4"], twist: Float[np.ndarray, "*batch 6"]
) -> Float[np.ndarray, "*batch 7"]:
    axes = frames[..., :7, :3, 2]
    arm = frames[..., 7, None, :3, 3] - frames[..., :7, :3, 3]
    transposed = np.concatenate([_cross(axes, arm), axes], axis=-1)
    square = transposed.swapaxes(-1, -2) @ transposed + _DAMPING**2 * np.eye(6)
    return np.asarray((transposed @ np.linalg.solve(square, twist[..., None]))[..., 0])


def refine(
    q: Float[np.ndarray, "*batch 7"], T_base_flange: Float[np.ndarray, "*batch 4 4"], steps: int = 3
) -> Float[np.ndarray, "*batch 7"]:
    """Joint angles moved to the pose by damped Newton steps, which stay on the branch of a start near by."""
    for _ in range(steps):
        frames = joint_frames(q)
        q = q + _least_motion(frames, _pose_error(frames[..., 7, :, :], T_base_flange))
    return q


def inverse(
    T_base_flange: Float[np.ndarray, "N 4 4"], q7: Float[np.ndarray, " R"] = _ANY_Q7
) -> Float[np.ndarray, "N R 4 7"]:
    """All closed-form solutions for each pose and each value of the redundant last joint; NaN where none is.

    The geometric solution is that of He and Liu (2021), as the package `frankik` has it; what it returns is
    only believed after our own forward kinematics.

    Args:
        T_base_flange: wanted poses of the flange.
        q7: values of joint 7 to try, rad.

    Raises:
        MissingExtraError: `frankik` is not installed.
    """
    ik_full = _closed_form()
    home = np.zeros(7)
    found = np.full((len(T_base_flange), len(q7), 4, 7), np.nan)
    shoulder = np.array([0.0, 0.0, _D[0]])
    for i in np.flatnonzero(np.linalg.norm(T_base_flange[:, :3, 3] - shoulder, axis=1) < _LENGTH):
        found[i] = [np.reshape(ik_full(T_base_flange[i], home, value), (4, 7)) for value in q7]
    ok = ~np.isnan(found).any(axis=-1)
    wanted = np.broadcast_to(T_base_flange[:, None, None], (*found.shape[:-1], 4, 4))[ok]
    solutions = found[ok]
    solutions[~reaches(solutions, wanted)] = np.nan
    found[ok] = solutions
    found[~ok] = np.nan
    return found


def _closed_form() -> Callable[..., np.ndarray]:
    try:
        from frankik import ik_full
    except ImportError as error:
        raise MissingExtraError(
            "inverse kinematics of the arm need frankik: pip install 'ffhnet[arm]'"
        ) from error
    return ik_full


def _cross(
    a: Float[np.ndarray, "*batch 3"], b: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "*batch 3"]:
    """As `np.cross`, which is several times slower on small batches."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]
