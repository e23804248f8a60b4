"""The closing motion as joint targets over time: what a trial does, and what a controller is to follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.hands.hand import Hand


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
    closing = hand.closing
    rows = [_waypoints(hand, grasp, period) for grasp in joints]
    width = max((len(row) for row in rows), default=0)
    times = np.full((len(rows), width), np.nan)
    targets = np.full((len(rows), width, hand.num_joints), np.nan)
    for i, (grasp, when) in enumerate(zip(joints, rows, strict=True)):
        opened = hand.open(grasp)
        arrival = _arrival(hand, grasp - opened, period) * period
        moving = np.minimum(when, closing.duration)[:, None]
        beyond = np.maximum(moving - arrival, 0) * closing.speed * closing.moves
        path = opened + (grasp - opened) * np.minimum(moving / arrival, 1) + beyond
        times[i, : len(when)], targets[i, : len(when)] = when, np.minimum(path, hand.upper)
    return JointTrajectory(times, targets)


def _arrival(hand: Hand, way: Float[np.ndarray, " J"], period: float) -> int:
    """Control periods until the fingers are at the grasp's joints."""
    return max(round(way.max() / (hand.closing.speed * period)), 1)


def _waypoints(hand: Hand, joints: Float[np.ndarray, " J"], period: float) -> Float[np.ndarray, " W"]:
    """Times (s) at which the speed of a target changes, the beginning and the end among them."""
    closing = hand.closing
    arrival = _arrival(hand, joints - hand.open(joints), period) * period
    at_limit = arrival + ((hand.upper - joints) / closing.speed)[closing.moves > 0]
    within = at_limit[at_limit < closing.duration]
    ends = np.array(
        [0.0, min(arrival, closing.duration), closing.duration, closing.duration + closing.squeeze]
    )
    times = np.sort(np.concatenate([ends, within]))
    return times[np.diff(times, prepend=-1.0) > 1e-6]
