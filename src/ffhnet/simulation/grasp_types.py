"""Coarse grasp types from what a trial measured: which fingers take part, and power or precision.

The terms are those of the GRASP taxonomy (Feix et al. 2016): type (power, intermediate, precision) and which
fingers oppose the thumb. Trials store joint angles and the number of touching links, not the contacts, so
both are approximations; `docs/exchange.md` says how often they agree with the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.hands import Hand

KINDS = ("precision", "intermediate", "power")

CLOSED_WITHIN = 0.05
"""rad: a finger whose last joint comes this close to its limit met no object on its way."""


@dataclass(frozen=True)
class GraspTypes:
    """The types of N grasps.

    Attributes:
        fingers: names of the hand's fingers.
        takes_part: whether each finger was stopped by something before it was fully closed.
        kind: index into `KINDS`.
    """

    fingers: tuple[str, ...]
    takes_part: Bool[np.ndarray, "N F"]
    kind: Int[np.ndarray, " N"]

    @property
    def code(self) -> Int[np.ndarray, " N"]:
        """One number per type: kind and set of fingers."""
        bits = 1 << np.arange(len(self.fingers))
        return self.kind << len(self.fingers) | self.takes_part @ bits

    def label(self, index: int) -> str:
        """For example "power, 4 fingers"."""
        return f"{KINDS[self.kind[index]]}, {self.takes_part[index].sum()} fingers"


def grasp_types(
    closed_joints: Float[np.ndarray, "N J"], contact_links: Float[np.ndarray, " N"], hand: Hand
) -> GraspTypes:
    """The types of executed grasps.

    A finger takes part unless the last of its closing joints reached its upper limit (within
    `CLOSED_WITHIN`). With no more touching links than such fingers, a finger touches with one link at most:
    precision. With one link more: intermediate. With two or more, fingers wrap or the palm touches: power.

    Args:
        closed_joints: joint angles after closing, rad.
        contact_links: number of links that touch the object then.
        hand: the hand; joints are named FINGER_JOINT.
    """
    closing = np.flatnonzero(hand.closing.moves)
    last = {hand.joint_names[joint].partition("_")[0]: joint for joint in closing}
    fingers = list(last.values())
    takes_part = closed_joints[:, fingers] < hand.upper[fingers] - CLOSED_WITHIN
    surplus = contact_links - takes_part.sum(axis=1)
    return GraspTypes(tuple(last), takes_part, np.clip(surplus, 0, len(KINDS) - 1).astype(int))


def entropy_bits(codes: Int[np.ndarray, " N"]) -> float:
    """Shannon entropy of the codes' frequencies, bits; NaN of nothing.

    It is the plug-in estimate, low by about (types - 1) / (1.4 N) bits.
    """
    if len(codes) == 0:
        return float("nan")
    _, counts = np.unique(codes, return_counts=True)
    share = counts / counts.sum()
    return float(-(share * np.log2(share)).sum())
