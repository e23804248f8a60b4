"""How a hand moves to its grasp, as frames to be played: the approach and the closing, without physics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand

FRAMES_PER_SECOND = 25.0

APPROACH = 0.10
"""m of straight approach along the palm's x axis, as in the grasp trial."""

_APPROACH_TIME = 1.0  # s
_REST = 0.3  # s between two parts of the motion


@dataclass(frozen=True)
class Frame:
    """One moment of a motion, in the world frame.

    Attributes:
        T_world_palm: pose of the palm.
        joints: joint angles, rad.
        T_world_object: pose of the object, or None while it stands where it stood.
    """

    T_world_palm: Float[np.ndarray, "4 4"]
    joints: Float[np.ndarray, " J"]
    T_world_object: Float[np.ndarray, "4 4"] | None = None


def palm_pose(grasp: Grasps) -> Float[np.ndarray, "4 4"]:
    """T_frame_palm of a batch of one grasp."""
    return make_transform(grasp.rotation[0], grasp.position[0])


def grasp_frame(grasp: Grasps) -> Frame:
    """The hand at the grasp itself; `grasp` is a batch of one in the world frame."""
    return Frame(palm_pose(grasp), grasp.joints[0])


def approach(hand: Hand, grasp: Grasps) -> list[Frame]:
    """The open hand comes along its approach axis (section IV-B, "closing primitive")."""
    pose, opened = palm_pose(grasp), hand.open(grasp.joints[0])
    back = APPROACH * (1 - _smooth(_APPROACH_TIME))
    frames = [Frame(pose @ make_transform(position=np.array([-b, 0.0, 0.0])), opened) for b in back]
    return frames + [frames[-1]] * _count(_REST)


def closing(hand: Hand, grasp: Grasps, joints: Float[np.ndarray, " J"] | None = None) -> list[Frame]:
    """From the open hand to joint angles (rad), the grasp's if none; all fingers arrive together."""
    pose, opened = palm_pose(grasp), hand.open(grasp.joints[0])
    way = (grasp.joints[0] if joints is None else joints) - opened
    duration = float(np.abs(way).max()) / hand.closing.speed
    return [Frame(pose, opened + share * way) for share in np.linspace(0, 1, _count(duration) + 1)]


def _smooth(duration: float) -> Float[np.ndarray, " K"]:
    """From 0 to 1, at rest at both ends, one value per frame."""
    s = np.linspace(0, 1, _count(duration) + 1)
    return s * s * (3 - 2 * s)


def _count(duration: float) -> int:
    """Frames that fill a duration (s), at least one."""
    return max(round(duration * FRAMES_PER_SECOND), 1)
