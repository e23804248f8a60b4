"""What an evaluation measured, view by view: the raw counts behind every table and the report.

Which grasps of a view were executed, and what each set is for:

- the *drawn* samples, a random subset of all that the generator sampled, so that rates, thresholds, kept
  shares, AUROC and calibration are unbiased (`Samples.drawn`);
- the *top* grasps, the first five in the order of the network (`Samples.rank`), always;
- on a *full* view, all of them: stable grasps and their types are counted there (`Coverage`).

All sets are rows of one `Samples`, executed once each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.grasps import Grasps
from ffhnet.simulation.trial import TrialResults
from ffhnet.simulation.views import View

STANDING = "standing"
"""Name of the resting pose in which an object stands as modelled."""


@dataclass(frozen=True)
class Tries:
    """Grasps that were executed once each.

    Attributes:
        success: whether the grasp lifted and held the object.
        executed: False where the hand collided before it could close, which is a failure, too.
    """

    success: Bool[np.ndarray, " N"]
    executed: Bool[np.ndarray, " N"]

    @classmethod
    def of(cls, results: TrialResults) -> Tries:
        """Of a table of trials."""
        return cls(results.success, results.executed)

    @staticmethod
    def join(parts: Sequence[Tries]) -> Tries:
        """All in one."""
        return Tries(np.concatenate([p.success for p in parts]), np.concatenate([p.executed for p in parts]))

    def __len__(self) -> int:
        return len(self.success)

    def __getitem__(self, index: slice | np.ndarray) -> Tries:
        return Tries(self.success[index], self.executed[index])


@dataclass(frozen=True)
class Samples:
    """The executed samples of one view, best rank first.

    Attributes:
        rank: place in the network's order of all samples, 0 is the best.
        score: what the network ranks by, comparable between views: higher is better.
        drawn: whether the sample belongs to the random subset that rates are counted on.
        grasps: the grasps in the world frame; `probability` is the predicted success probability.
        tries: what became of them.
    """

    rank: Int[np.ndarray, " N"]
    score: Float[np.ndarray, " N"]
    drawn: Bool[np.ndarray, " N"]
    grasps: Grasps
    tries: Tries

    @property
    def probability(self) -> Float[np.ndarray, " N"]:
        """Predicted success probability."""
        assert self.grasps.probability is not None
        return self.grasps.probability

    def __len__(self) -> int:
        return len(self.rank)


@dataclass(frozen=True)
class Condition:
    """The same groups of grasps of one view in one kind of world: nominal, stressed, or strict.

    Attributes:
        name: "nominal", the name of a stress, "strict", or "strict, held".
        top: the first grasps of the network, best first: five, or ten of a hundred in the strict protocol.
        random: some drawn samples that did not collide in the nominal world.
        blind_random_yaw: the blind control with random yaw.
        blind_short_side: the blind control that closes across the cloud's shorter side.
    """

    name: str
    top: Tries
    random: Tries
    blind_random_yaw: Tries
    blind_short_side: Tries


@dataclass(frozen=True)
class Coverage:
    """How varied the stable grasps among all samples of a full view are.

    Attributes:
        stable: samples that held.
        distinct: of these, those further from each other than 2 cm, 20 degrees, or 0.3 rad rms of the joints
            after closing.
        types: number of different grasp types among the stable ones.
        type_entropy: of these types, bits; NaN without stable grasps.
    """

    stable: int
    distinct: int
    types: int
    type_entropy: float


@dataclass(frozen=True)
class ViewOutcome:
    """What became of the grasps of one view.

    Attributes:
        object_name, pose_name: what was looked at.
        height: m, of the object as it lies on the table.
        samples: the executed samples of the generator.
        heuristic: the paper's sampler after its collision filter.
        conditions: nominal first, then each stress; only nominal where no stress was asked for.
        strict: the strict protocol's two counts, "strict" and "strict, held"; empty where it was not asked
            for.
        coverage: None but on full views.
        T_world_object: where the object stood.
        view: what the camera saw; None but on full views.
    """

    object_name: str
    pose_name: str
    height: float
    samples: Samples
    heuristic: Tries
    conditions: tuple[Condition, ...]
    strict: tuple[Condition, ...]
    coverage: Coverage | None
    T_world_object: Float[np.ndarray, "4 4"]
    view: View | None

    @property
    def standing(self) -> bool:
        """Whether the object stands as modelled."""
        return self.pose_name == STANDING


@dataclass(frozen=True)
class UnseenView:
    """A view on which the object could not be told from the table from any of several camera poses.

    Attributes:
        object_name, pose_name: what was looked at.
    """

    object_name: str
    pose_name: str
