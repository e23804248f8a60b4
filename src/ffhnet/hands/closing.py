"""The closing motion as joint targets over time: what a trial does, and what a controller is to follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ffhnet.hands.hand import Hand

_SAME_TIME = 1e-6
"""s between waypoints that are one."""


@dataclass(frozen=True)
class JointTrajectory:
    """For each of N grasps joint targets at rising times, to be joined by straight lines.

    Attributes:
        times: s from the moment the hand has taken up its pose; NaN behind the end of a shorter one.
        joints: targets, rad; NaN likewise.
    """

    times: Float[np.ndarray, "N W"]
    joints: Float[np.ndarray, "N W J"]

    def __len__(self) -> int:
        return len(self.times)

    def at(self, index: int, times: Float[np.ndarray, " K"]) -> Float[np.ndarray, "K J"]:
        """Targets (rad) of one grasp at some times (s); the first and the last ones before and after."""
        known = ~np.isnan(self.times[index])
        when, targets = self.times[index][known], self.joints[index][known]
        return np.stack([np.interp(times, when, column) for column in targets.T], axis=1)


def closing_advances(hand: Hand, joints: Float[np.ndarray, " J"], period: float) -> Float[np.ndarray, "K J"]:
    """How far the targets advance in each control period, rad, where nothing holds them up.

    On the way to the grasp's joints all fingers arrive together; from there on they close at one speed.

    Args:
        hand: the hand, with its closing motion.
        joints: the grasp's joint angles, rad.
        period: s between updates of the targets.
    """
    closing = hand.closing
    way = joints - hand.open(joints)
    step = closing.speed * period
    periods = np.arange(round(closing.duration / period))[:, None]
    arriving = _arrival(hand, way, period)
    return np.where(periods < arriving, way / arriving, step * closing.moves)


def closing_trajectory(hand: Hand, joints: Float[np.ndarray, "N J"], period: float) -> JointTrajectory:
    """The closing motion of grasps: from the open hand to their joints, on to the limits, and the squeeze.

    These are the targets where no joint is held up. A controller keeps each target at most `closing.lead`
    ahead of its joint, and the torque within `Hand.torque_limit`, so that contact decides where fingers stop.

    Args:
        hand: the hand, with its closing motion.
        joints: the grasps' joint angles, rad.
        period: s between updates of the targets in the trials, in which the arrival is counted.
    """
    closing, opened = hand.closing, hand.open(joints)
    arrival = _arrival(hand, joints - opened, period)[:, None] * period
    times = _waypoints(hand, joints, arrival)
    moving = np.minimum(times, closing.duration)[:, :, None]
    beyond = np.maximum(moving - arrival[:, None], 0) * closing.speed * closing.moves
    way = (joints - opened)[:, None] * np.minimum(moving / arrival[:, None], 1)
    return JointTrajectory(times, np.minimum(opened[:, None] + way + beyond, hand.upper))


def _arrival(hand: Hand, way: Float[np.ndarray, "*batch J"], period: float) -> Int[np.ndarray, "*batch"]:
    """Control periods until the fingers are at the grasp's joints."""
    return np.maximum(np.rint(way.max(axis=-1) / (hand.closing.speed * period)).astype(int), 1)


def _waypoints(
    hand: Hand, joints: Float[np.ndarray, "N J"], arrival: Float[np.ndarray, "N 1"]
) -> Float[np.ndarray, "N W"]:
    """Times (s) at which the speed of a target changes, the beginning and the end among them; NaN at last."""
    closing = hand.closing
    closes = closing.moves > 0
    at_limit = arrival + (hand.upper - joints)[:, closes] / closing.speed
    at_limit[at_limit >= closing.duration] = np.nan
    always = np.array([0.0, closing.duration, closing.duration + closing.squeeze])
    ends = np.broadcast_to(always, (len(joints), 3))
    times = np.sort(np.hstack([ends, np.minimum(arrival, closing.duration), at_limit]), axis=1)
    times[:, 1:][np.diff(times, axis=1) < _SAME_TIME] = np.nan
    times = np.sort(times, axis=1)
    return times[:, : np.isfinite(times).sum(axis=1).max(initial=0)]
