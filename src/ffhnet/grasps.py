"""`Grasps`: the one batch type that every room speaks."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ffhnet.errors import OptionError

SCORES = ("probability", "robustness")
"""Attributes of `Grasps` that are predicted, one number per grasp."""


@dataclass(frozen=True)
class Grasps:
    """A batch of N grasps of one hand, expressed in one frame.

    Attributes:
        rotation: palm axes as columns, in `frame`.
        position: palm origin in `frame`, metres.
        joints: joint angles in radians, in the order of `joint_names`: the shape to which the open hand
            closes once the palm is in place. From there all fingers close on until contact stops them.
        joint_names: names of the actuated joints.
        hand: name of the hand.
        frame: name of the frame, for example "world", "camera" or "view".
        probability: predicted probability that the grasp lifts the object, or None.
        robustness: predicted probability that it does so with another mass and friction than expected and the
            palm a little off; None where that is not known.
    """

    rotation: Float[np.ndarray, "N 3 3"]
    position: Float[np.ndarray, "N 3"]
    joints: Float[np.ndarray, "N J"]
    joint_names: tuple[str, ...]
    hand: str
    frame: str
    probability: Float[np.ndarray, " N"] | None = None
    robustness: Float[np.ndarray, " N"] | None = None

    def __post_init__(self) -> None:
        n = len(self.position)
        wanted = {"rotation": (n, 3, 3), "position": (n, 3), "joints": (n, len(self.joint_names))}
        wanted |= {name: (n,) for name in SCORES if getattr(self, name) is not None}
        for name, shape in wanted.items():
            came = np.shape(getattr(self, name))
            if came != shape:
                raise OptionError(f"Grasps.{name} must have shape {shape}, got {came}")

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, index: Any) -> Grasps:
        """A sub-batch; an integer gives a batch of one."""
        if isinstance(index, (int, np.integer)):
            index = [index]
        return self.replace(
            rotation=self.rotation[index],
            position=self.position[index],
            joints=self.joints[index],
            **{name: _at(getattr(self, name), index) for name in SCORES},
        )

    def replace(self, **changes: Any) -> Grasps:
        """A copy with some attributes changed."""
        return dataclasses.replace(self, **changes)

    @property
    def score(self) -> Float[np.ndarray, " N"]:
        """What grasps are ranked by: robustness where it is known, else probability.

        Raises:
            OptionError: neither is known.
        """
        score = self.probability if self.robustness is None else self.robustness
        if score is None:
            raise OptionError("grasps without probabilities cannot be ranked: evaluate them first")
        return score

    def ranked(self) -> Grasps:
        """Best first, by `score`."""
        return self[np.argsort(-self.score, kind="stable")]

    def to_frame(self, T_new_old: Float[np.ndarray, "4 4"], frame: str) -> Grasps:
        """The same grasps in another frame; `T_new_old` takes old coordinates to new ones."""
        return self.replace(
            rotation=T_new_old[:3, :3] @ self.rotation,
            position=self.position @ T_new_old[:3, :3].T + T_new_old[:3, 3],
            frame=frame,
        )

    @staticmethod
    def concatenate(parts: list[Grasps]) -> Grasps:
        """One batch from several of the same hand and frame."""
        first = parts[0]
        for part in parts:
            if (part.hand, part.frame, part.joint_names) != (first.hand, first.frame, first.joint_names):
                raise OptionError(
                    f"grasps of {part.hand} in {part.frame} cannot join {first.hand} in {first.frame}"
                )
        return first.replace(
            rotation=np.concatenate([p.rotation for p in parts]),
            position=np.concatenate([p.position for p in parts]),
            joints=np.concatenate([p.joints for p in parts]),
            **{name: _joined([getattr(p, name) for p in parts]) for name in SCORES},
        )


def _at(score: Float[np.ndarray, " N"] | None, index: Any) -> Float[np.ndarray, " M"] | None:
    return None if score is None else score[index]


def _joined(scores: list[Float[np.ndarray, " N"] | None]) -> Float[np.ndarray, " M"] | None:
    """All scores in a row, or None if one is not known."""
    known = [score for score in scores if score is not None]
    return np.concatenate(known) if len(known) == len(scores) else None
