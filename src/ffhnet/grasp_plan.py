"""`GraspPlan`: grasps with all that a robot needs to do them, and those that it cannot do with the reason."""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.hands.closing import JointTrajectory, closing_trajectory


@dataclass(frozen=True)
class ArmMotion:
    """How an arm does N grasps.

    Attributes:
        robot: name of the arm.
        joint_names: names of its Q joints.
        T_frame_base: pose of its base in the grasps' frame.
        approach: joint angles from the pre-grasp pose straight to the grasp (last), rad.
        lift: joint angles on the way straight up, the grasp left out, rad.
    """

    robot: str
    joint_names: tuple[str, ...]
    T_frame_base: Float[np.ndarray, "4 4"]
    approach: Float[np.ndarray, "N A Q"]
    lift: Float[np.ndarray, "N L Q"]

    def __getitem__(self, index: Any) -> ArmMotion:
        """That of a sub-batch."""
        return dataclasses.replace(self, approach=self.approach[index], lift=self.lift[index])

    @staticmethod
    def concatenate(parts: list[ArmMotion]) -> ArmMotion:
        """One batch from several of the same arm."""
        return dataclasses.replace(
            parts[0],
            approach=np.concatenate([part.approach for part in parts]),
            lift=np.concatenate([part.lift for part in parts]),
        )


@dataclass(frozen=True)
class GraspPlan:
    """Feasible grasps, best first, and what became of the others.

    Attributes:
        grasps: the N grasps that can be done.
        standoff: m of straight approach, along the palm's x axis, from the pre-grasp pose to the grasp.
        preshape: joint angles of the open hand on the approach, rad.
        closing: targets of the hand's joints, from the moment the palm has arrived.
        torque_limit: Nm, of each joint of the hand.
        lead: rad that a target may be ahead of its joint (`ClosingMotion`).
        arm: how the arm does them, or None where none was asked for.
        dropped: the grasps that cannot be done, best first.
        reasons: why, one word for each.
        novelty: how unlike all that the networks know the object is (`FFHNet.novelty`), None if not known.
    """

    grasps: Grasps
    standoff: float
    preshape: Float[np.ndarray, "N J"]
    closing: JointTrajectory
    torque_limit: Float[np.ndarray, " J"]
    lead: float
    arm: ArmMotion | None
    dropped: Grasps
    reasons: tuple[str, ...]
    novelty: float | None = None

    @classmethod
    def of(
        cls,
        hand: Hand,
        grasps: Grasps,
        dropped: Grasps,
        reasons: tuple[str, ...],
        standoff: float,
        control_period: float,
        arm: ArmMotion | None = None,
    ) -> GraspPlan:
        """The plan of a hand's grasps; `control_period` (s) is that of the trials (`closing_trajectory`)."""
        return cls(
            grasps=grasps,
            standoff=standoff,
            preshape=hand.open(grasps.joints),
            closing=closing_trajectory(hand, grasps.joints, control_period),
            torque_limit=hand.torque_limit,
            lead=hand.closing.lead,
            arm=arm,
            dropped=dropped,
            reasons=reasons,
        )

    def refused(self, reason: str) -> GraspPlan:
        """The plan to do nothing, all grasps being dropped for one more reason."""
        return dataclasses.replace(
            self,
            grasps=self.grasps[:0],
            preshape=self.preshape[:0],
            closing=JointTrajectory(self.closing.times[:0], self.closing.joints[:0]),
            arm=None if self.arm is None else self.arm[:0],
            dropped=Grasps.concatenate([self.grasps, self.dropped]),
            reasons=len(self.grasps) * (reason,) + self.reasons,
        )

    @property
    def pregrasp_position(self) -> Float[np.ndarray, "N 3"]:
        """Where the palm is before the approach, m; its rotation is that of the grasp."""
        return self.grasps.position - self.standoff * self.grasps.rotation[:, :, 0]

    @property
    def counts(self) -> dict[str, int]:
        """How many grasps were dropped for each reason, the most frequent first."""
        return dict(Counter(self.reasons).most_common())
