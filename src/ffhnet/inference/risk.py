"""Chosen risk: a threshold that keeps failures of executed grasps rare, promised from a finite sample.

What is executed: the best grasp of a view if its score reaches the threshold, else nothing. What is promised:
with probability `confidence` over the draw of the calibration objects,

    P(failure | executed) <= max_failure

for a random view of a random new object, if calibration objects and new object are drawn independently from
the same source, in the same physics, with the same networks. It is not a promise for each single object, nor
for objects of another kind. Objects are the unit: views of one object succeed and fail together, so that
counting them as independent would promise too much.

Method: Learn then Test (Angelopoulos et al. 2021) with several starting points, in which the test of each
threshold bets against the hypothesis that it fails too often (Waudby-Smith and Ramdas 2024). A ratio such as
P(failure | executed) is not monotone in the threshold, for which reason conformal risk control, which needs
no confidence, does not apply to it; it would bound P(executed and failed), which is less.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

from ffhnet.errors import OptionError, WeightsError
from ffhnet.inference.calibration import check_samples

THRESHOLDS = (0.995, 0.99, 0.985, 0.98, 0.97, 0.96, 0.95, 0.94, 0.92, *(k / 20 for k in range(18, -1, -1)))
"""The thresholds that can be chosen, from strict to lenient; fixed before any data is seen."""

STARTS = (1.0, 0.25)
"""Where the search sets out: at the scores 1 - start · risk. If scores are true probabilities, evidence is
strongest at 1 - risk, since all that lies above is below the risk; the second start is for scores that
promise too much. From the strictest threshold the search would end at once: hardly anything reaches it."""

BETS = 20
"""Stakes over which each test averages, from 1/20 to all that can be staked."""

RISKS = tuple(k / 100 for k in range(1, 51))
"""Risks that are tried to say which could be promised."""


@dataclass(frozen=True)
class RiskControl:
    """The threshold for a risk.

    Attributes:
        max_failure: wanted bound of P(failure | executed).
        confidence: probability that the bound holds.
        threshold: scores from which on the best grasp is executed; None if no threshold can be promised.
        objects: objects that the calibration saw.
        executed: share of their views in which a grasp was executed at this threshold (0 without one).
        failures: share of those executions that failed (0 without any).
        possible: smallest multiple of 1 % that could be promised, or None.
    """

    max_failure: float
    confidence: float
    threshold: float | None
    objects: int
    executed: float
    failures: float
    possible: float | None

    def refusal(self, score: Float[np.ndarray, " N"]) -> str | None:
        """One line that says why none of these candidates is executed; None if the best one may be.

        Args:
            score: of each candidate in one view, of the kind that the calibration saw.

        Raises:
            OptionError: a score is not a number.
        """
        score = np.asarray(score, dtype=np.float64)
        if np.isnan(score).any():
            raise OptionError(f"{int(np.isnan(score).sum())} of {len(score)} candidates have no score")
        wanted = f"at most {self.max_failure:.1%} failures with {self.confidence:.0%} confidence"
        if self.threshold is None:
            known = "nothing up to 50.0%" if self.possible is None else f"{self.possible:.1%} at best"
            return f"abstained: no threshold promises {wanted}; {self.objects} known objects allow {known}"
        if len(score) == 0:
            return f"abstained: there are no candidates ({wanted} was asked for)"
        if score.max() < self.threshold:
            return (
                f"abstained: none of {len(score)} candidates reaches the {self.threshold:.3g} that promises "
                f"{wanted}; the best has {score.max():.3f}"
            )
        return None


@dataclass(frozen=True)
class RiskTable:
    """Calibration points: the best grasp of each view, of objects that trained or calibrated nothing else.

    Attributes:
        object_id: object of each view.
        score: of the view's best grasp, by which grasps are ranked, 0 to 1.
        success: whether it held, 0 to 1 where it was tried more than once.
    """

    object_id: Int[np.ndarray, " V"]
    score: Float[np.ndarray, " V"]
    success: Float[np.ndarray, " V"]

    def __post_init__(self) -> None:
        for name, array in zip(
            ("object_id", "score", "success"),
            check_samples(self.object_id, self.score, self.success),
            strict=True,
        ):
            object.__setattr__(self, name, array)

    def control(self, max_failure: float, confidence: float = 0.95) -> RiskControl:
        """The most lenient threshold that keeps the promise at the head of this file.

        Raises:
            OptionError: a bound or a confidence that is not inside (0, 1).
        """
        for name, value in (("risk", max_failure), ("confidence", confidence)):
            if not 0 < value < 1:
                raise OptionError(f"the {name} must lie between 0 and 1, got {value}")
        threshold = self._threshold(max_failure, confidence)
        possible: float | None = max_failure
        if threshold is None:
            higher = (risk for risk in RISKS if risk > max_failure)
            possible = next((r for r in higher if self._threshold(r, confidence) is not None), None)
        executed = self.score >= (2.0 if threshold is None else threshold)
        failures = float((1 - self.success[executed]).mean()) if executed.any() else 0.0
        objects = len(np.unique(self.object_id))
        return RiskControl(
            max_failure, confidence, threshold, objects, float(executed.mean()), failures, possible
        )

    def _threshold(self, max_failure: float, confidence: float) -> float | None:
        # Each walk from its start stops at the first threshold without enough evidence, so that all walks
        # together go wrong with probability 1 - confidence, however many thresholds they pass.
        enough = np.log(len(STARTS) / (1 - confidence))
        proven = [log_evidence(self._excess(t, max_failure), 1 - max_failure) >= enough for t in THRESHOLDS]
        passed = [
            threshold
            for start in STARTS
            for threshold, _ in takewhile(lambda step: step[1], _walk(proven, 1 - start * max_failure))
        ]
        return min(passed, default=None)

    def _excess(self, threshold: float, max_failure: float) -> Float[np.ndarray, " O"]:
        """By object, the mean over its views of (failure - max_failure) where executed, else 0.

        Its expectation is positive exactly where P(failure | executed) is above `max_failure`.
        """
        excess = np.where(self.score >= threshold, (1 - self.success) - max_failure, 0.0)
        _, index, count = np.unique(self.object_id, return_inverse=True, return_counts=True)
        return np.bincount(index, weights=excess) / count

    def to_json(self) -> dict[str, list[float]]:
        """Plain values; scores are kept to six digits."""
        return {
            "object_id": np.unique(self.object_id, return_inverse=True)[1].tolist(),
            "score": self.score.round(6).tolist(),
            "success": self.success.round(6).tolist(),
        }

    @classmethod
    def from_json(cls, content: Any) -> RiskTable:
        """What `to_json` gave. Raises WeightsError for anything else."""
        try:
            return cls(**{name: np.asarray(values) for name, values in content.items()})
        except (AttributeError, TypeError, ValueError, OptionError) as error:
            raise WeightsError(f"not calibration points of a risk: {error}") from error


def _walk(proven: list[bool], start: float) -> list[tuple[float, bool]]:
    """The thresholds from a start on, and whether each is proven."""
    return [step for step in zip(THRESHOLDS, proven, strict=True) if step[0] <= start]


def log_evidence(sample: Float[np.ndarray, " O"], largest: float) -> float:
    """Logarithm of an e-value against "the expectation is not below zero".

    Args:
        sample: independent values.
        largest: none of them can be larger.

    Returns:
        Log of the capital of a gambler who stakes a fixed share of it on each value being negative, mean
        over several shares. If the expectation is not below zero the mean capital is at most 1, so that it
        reaches k with probability at most 1/k.
    """
    stakes = np.arange(1, BETS + 1) / BETS / largest
    with np.errstate(divide="ignore"):
        capital = np.log(np.maximum(1 - stakes[:, None] * sample, 0.0)).sum(axis=1)
    return float(logsumexp(capital) - np.log(BETS))
