"""Measures of rates and of predicted probabilities, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.errors import OptionError


@dataclass(frozen=True)
class Interval:
    """A closed interval."""

    low: float
    high: float


def wilson_interval(successes: int, trials: int, z: float = 1.959964) -> Interval:
    """Wilson score interval of a success rate; 95 % with the default z, (0, 1) without trials.

    Raises:
        OptionError: successes outside 0 to trials.
    """
    if not 0 <= successes <= trials:
        raise OptionError(f"successes must lie between 0 and {trials} trials, got {successes}")
    if trials == 0:
        return Interval(0.0, 1.0)
    rate, shrink = successes / trials, 1 + z**2 / trials
    centre = (rate + z**2 / (2 * trials)) / shrink
    half = z / shrink * np.sqrt(rate * (1 - rate) / trials + z**2 / (4 * trials**2))
    return Interval(max(0.0, float(centre - half)), min(1.0, float(centre + half)))


def auroc(label: Float[np.ndarray, " N"], score: Float[np.ndarray, " N"]) -> float:
    """Probability that a positive scores above a negative, ties counting half; NaN if one kind is missing.

    Args:
        label: success (1) or failure (0); probabilities count as success from 0.5.
        score: higher means more likely a success.
    """
    label, score = _pair(label, score)
    positive = label >= 0.5
    num_positive = int(positive.sum())
    num_negative = len(label) - num_positive
    if num_positive == 0 or num_negative == 0:
        return float("nan")
    _, group, size = np.unique(score, return_inverse=True, return_counts=True)
    mean_rank = (np.cumsum(size) - (size - 1) / 2)[group]
    above = mean_rank[positive].sum() - num_positive * (num_positive + 1) / 2
    return float(above / (num_positive * num_negative))


@dataclass(frozen=True)
class ReliabilityBin:
    """Predictions between two probabilities.

    Attributes:
        low, high: of the bin.
        count: predictions in it.
        predicted: their mean; NaN of none.
        observed: share of successes among them; NaN of none.
    """

    low: float
    high: float
    count: int
    predicted: float
    observed: float


def reliability(
    label: Float[np.ndarray, " N"], probability: Float[np.ndarray, " N"], bins: int = 10
) -> tuple[ReliabilityBin, ...]:
    """The reliability diagram over equally wide bins, lowest first."""
    label, probability = _pair(label, probability)
    index = np.minimum((probability * bins).astype(int), bins - 1)
    count = np.bincount(index, minlength=bins)
    predicted, observed = (
        np.divide(np.bincount(index, values, bins), count, out=np.full(bins, np.nan), where=count > 0)
        for values in (probability, label)
    )
    return tuple(
        ReliabilityBin(k / bins, (k + 1) / bins, int(count[k]), float(predicted[k]), float(observed[k]))
        for k in range(bins)
    )


def expected_calibration_error(
    label: Float[np.ndarray, " N"], probability: Float[np.ndarray, " N"], bins: int = 10
) -> float:
    """Mean gap between predicted and observed rate over equally wide bins, weighted by their counts."""
    filled = [b for b in reliability(label, probability, bins) if b.count]
    return sum(b.count * abs(b.predicted - b.observed) for b in filled) / sum(b.count for b in filled)


def binary_cross_entropy(label: Float[np.ndarray, " N"], probability: Float[np.ndarray, " N"]) -> float:
    """Mean cross-entropy in nats; probabilities are kept 1e-7 away from 0 and 1."""
    label, probability = _pair(label, probability)
    p = np.clip(probability, 1e-7, 1 - 1e-7)
    return float(-np.mean(label * np.log(p) + (1 - label) * np.log(1 - p)))


def _pair(label: np.ndarray, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    label, score = np.asarray(label, dtype=np.float64), np.asarray(score, dtype=np.float64)
    if label.ndim != 1 or label.shape != score.shape or len(label) == 0:
        raise OptionError(
            f"labels and scores must be two equally long vectors, got {label.shape}, {score.shape}"
        )
    return label, score
