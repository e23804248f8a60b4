"""From an observation to grasps that can be done: sample, check, and sample again where too few are left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int

from ffhnet.feasibility.hand_check import HandCheck, Margins
from ffhnet.feasibility.reasons import Reason
from ffhnet.grasp_plan import ArmMotion, GraspPlan
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.inference.ffhnet import FFHNet
from ffhnet.model.config import MAX_TEMPERATURE
from ffhnet.perception.observation import Observation
from ffhnet.simulation.physics import Physics

if TYPE_CHECKING:
    from ffhnet.feasibility.arm import ArmCheck

ENOUGH = 10
"""Feasible grasps after which no more are sampled, and with an arm no more ways are planned."""

VARIETY = (1.0, 4 / 3, 4 / 3, 1.6)
"""Factors on the weights' own temperature, one for each batch of samples after which a scene is given up:
later ones are more varied, as the grasps that the generator is sure of all hit something."""

_BLOCK = 16
"""Grasps for which the arm's ways are planned together."""

_NEXT_SEED = 1_000_003
"""Added to the seed from batch to batch."""


class Planner:
    """Grasps of one hand, with or without an arm, that can be done in observed scenes."""

    def __init__(
        self,
        network: FFHNet,
        hand: Hand,
        arm: ArmCheck | None = None,
        margins: Margins | None = None,
        physics: Physics | None = None,
    ) -> None:
        self._network = network
        self._hand = hand
        self._arm = arm
        self._check = HandCheck(hand, margins, physics)

    def plan(
        self, observation: Observation, num: int = 400, seed: int = 0, threshold: float = 0.0
    ) -> GraspPlan:
        """Feasible grasps in the observation's input frame, best first.

        Args:
            observation: what the camera sees.
            num: grasps to sample at a time, once per entry of `VARIETY` until `ENOUGH` are feasible.
            seed: of the samples; the same seed gives the same grasps.
            threshold: grasps below this success probability are left out.
        """
        scene = self._check.look(observation)
        ways = None if self._arm is None else _Ways(self._arm, observation)
        batches, reasons = [], []
        own = self._network.info.model.temperature
        for batch, factor in enumerate(VARIETY):
            temperature = min(factor * own, MAX_TEMPERATURE)
            grasps = self._network.grasp(observation, num, seed + batch * _NEXT_SEED, threshold, temperature)
            reason = self._check(grasps, scene)
            if ways is not None:
                reason = ways.extend(grasps, reason)
            batches.append(grasps)
            reasons.append(reason)
            if sum(np.count_nonzero(reason == Reason.FEASIBLE) for reason in reasons) >= ENOUGH:
                break
        return self._sorted(Grasps.concatenate(batches), np.concatenate(reasons), ways)

    def _sorted(self, grasps: Grasps, reason: Int[np.ndarray, " N"], ways: _Ways | None) -> GraspPlan:
        """Kept and dropped grasps, each best first."""
        order = np.argsort(-grasps.score, kind="stable")
        kept = order[reason[order] == Reason.FEASIBLE]
        dropped = order[reason[order] != Reason.FEASIBLE]
        physics = self._check.physics
        return GraspPlan.of(
            self._hand,
            grasps[kept],
            grasps[dropped],
            tuple(Reason(value).word for value in reason[dropped]),
            physics.approach_distance,
            physics.control_period,
            None if ways is None else ways.motion(kept),
        )


def plan_unchecked(grasps: Grasps, hand: Hand, physics: Physics | None = None) -> GraspPlan:
    """How grasps are done, best first, whatever is in their way."""
    physics = physics or Physics()
    return GraspPlan.of(hand, grasps, grasps[:0], (), physics.approach_distance, physics.control_period)


class _Ways:
    """The arm's ways to the best grasps of several batches, as far as they were asked for."""

    def __init__(self, arm: ArmCheck, observation: Observation) -> None:
        self._arm, self._observation = arm, observation
        self._scene = arm.look(observation)
        self._motions: list[ArmMotion] = []
        self._rows: list[int] = []
        self._first = 0

    def extend(self, grasps: Grasps, reason: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
        """The reasons with those of the arm for the next batch, best grasps first, until enough are found."""
        reason = reason.copy()
        left = np.flatnonzero(reason == Reason.FEASIBLE)
        # At least one block, if an empty one, so that there always is a motion.
        for begin in range(0, max(len(left), 1), _BLOCK):
            block = left[begin : begin + _BLOCK]
            if len(self._rows) >= ENOUGH:
                reason[left[begin:]] = Reason.NOT_TRIED
                break
            reason[block], motion = self._arm.plan(grasps[block], self._observation, self._scene)
            reached = np.flatnonzero(reason[block] == Reason.FEASIBLE)
            self._motions.append(motion[reached])
            self._rows += (self._first + block[reached]).tolist()
        self._first += len(grasps)
        return reason

    def motion(self, rows: Int[np.ndarray, " K"]) -> ArmMotion:
        """The ways to the grasps of these rows of all batches."""
        place = {row: i for i, row in enumerate(self._rows)}
        return ArmMotion.concatenate(self._motions)[[place[row] for row in rows.tolist()]]
