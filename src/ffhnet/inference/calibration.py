"""Probabilities that tell the truth: a monotone map from what a network says to how often it is right."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.special import expit

from ffhnet.errors import OptionError, WeightsError
from ffhnet.metrics import binary_cross_entropy, expected_calibration_error

FOLDS = 5
"""Parts into which the objects are divided to choose a kind of map."""

MIN_SLOPE = 1e-3
"""Slopes stay above this, so that the map is strictly increasing and a ranking stays as it is."""

EDGE = 1e-7
"""Probabilities are kept this far from 0 and 1."""

_KINDS = {
    "identity": np.empty((0, 3)),
    "temperature": np.array([[1.0, 1.0, 0.0]]),
    "platt": np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "beta": np.eye(3),
}
"""Which of `low`, `high` and `shift` a kind fits, as rows of a basis, simplest kind first."""


@dataclass(frozen=True)
class Calibration:
    """p becomes sigmoid(low · log p - high · log(1 - p) + shift): beta calibration (Kull et al. 2017).

    With low = high it is Platt's map of the logit, without shift also temperature scaling.

    Attributes:
        low: slope for small probabilities, positive.
        high: slope for large ones, positive.
        shift: in logits.
    """

    low: float = 1.0
    high: float = 1.0
    shift: float = 0.0

    def __post_init__(self) -> None:
        if not (self.low > 0 and self.high > 0 and np.isfinite([self.low, self.high, self.shift]).all()):
            raise OptionError(
                f"a calibration needs two positive slopes and a shift, got {dataclasses.astuple(self)}"
            )

    def apply(self, probability: Float[np.ndarray, "*N"]) -> Float[np.ndarray, "*N"]:
        """Calibrated probabilities, in the same order as those that came."""
        p = np.clip(np.asarray(probability, dtype=np.float64), EDGE, 1 - EDGE)
        return expit(self.low * np.log(p) - self.high * np.log1p(-p) + self.shift)

    def to_json(self) -> dict[str, float]:
        """Plain values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, content: Any) -> Calibration:
        """What `to_json` gave. Raises WeightsError for anything else."""
        try:
            return cls(**{name: float(value) for name, value in content.items()})
        except (AttributeError, TypeError, ValueError, OptionError) as error:
            raise WeightsError(f"not a calibration: {error}") from error


@dataclass(frozen=True)
class CalibrationFit:
    """A fitted map and how well maps of its kind did on objects that they were not fitted to.

    Attributes:
        calibration: fitted to all samples.
        kind: "identity", "temperature", "platt" or "beta".
        cross_entropy: nats, over the held-out parts, by kind.
        ece: expected calibration error likewise.
    """

    calibration: Calibration
    kind: str
    cross_entropy: dict[str, float]
    ece: dict[str, float]


def fit_calibration(
    object_id: Int[np.ndarray, " N"],
    probability: Float[np.ndarray, " N"],
    success: Float[np.ndarray, " N"],
) -> CalibrationFit:
    """The kind of map with the smallest held-out cross-entropy, fitted to all samples.

    Whole objects are held out: samples of one object are alike, and a new object is what is to come.

    Args:
        object_id: object of each sample; samples should be the generator's own on objects that trained
            nothing.
        probability: what the network said.
        success: what happened, 0 to 1.

    Raises:
        OptionError: no samples, fewer than two objects, values that are not finite or outside 0 to 1.
    """
    object_id, probability, success = check_samples(object_id, probability, success)
    objects = np.unique(object_id)
    if len(objects) < 2:
        raise OptionError(f"a calibration takes samples of at least 2 objects, got {len(objects)}")
    fold = np.searchsorted(objects, object_id) % FOLDS
    cross_entropy, ece = {}, {}
    for kind in _KINDS:
        mapped = np.empty_like(probability)
        for part in np.unique(fold):
            inside = fold == part
            mapped[inside] = _fit(kind, probability[~inside], success[~inside]).apply(probability[inside])
        cross_entropy[kind] = binary_cross_entropy(success, mapped)
        ece[kind] = expected_calibration_error(success, mapped)
    best = min(cross_entropy, key=lambda kind: cross_entropy[kind])
    return CalibrationFit(_fit(best, probability, success), best, cross_entropy, ece)


def check_samples(
    object_id: np.ndarray, value: np.ndarray, success: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three equally long vectors, the last two between 0 and 1; else OptionError."""
    object_id = np.asarray(object_id)
    value, success = np.asarray(value, dtype=np.float64), np.asarray(success, dtype=np.float64)
    if object_id.ndim != 1 or not object_id.shape == value.shape == success.shape or len(object_id) == 0:
        raise OptionError(
            f"samples are three equally long vectors, got {object_id.shape}, {value.shape}, {success.shape}"
        )
    for name, numbers in (("predictions", value), ("successes", success)):
        if not ((numbers >= 0) & (numbers <= 1)).all():
            raise OptionError(f"{name} must lie between 0 and 1, got {numbers.min():g} to {numbers.max():g}")
    return object_id, value, success


def _fit(kind: str, probability: np.ndarray, success: np.ndarray) -> Calibration:
    """Maximum likelihood over what the kind leaves free, from the identity on."""
    basis = _KINDS[kind]
    if len(basis) == 0:
        return Calibration()
    p = np.clip(probability, EDGE, 1 - EDGE)
    features = np.stack([np.log(p), -np.log1p(-p), np.ones_like(p)], axis=1) @ basis.T

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        logit = features @ weights
        gradient = features.T @ (expit(logit) - success) / len(success)
        return float(np.mean(np.logaddexp(0, logit) - success * logit)), gradient

    # Bounds keep samples of one class only, which no finite map fits best, from leading to infinity.
    slopes = basis[:, 0] + basis[:, 1] > 0
    bounds = [(MIN_SLOPE, 100.0) if slope else (-20.0, 20.0) for slope in slopes]
    from scipy.optimize import minimize  # here, because only fitting needs it

    solution = minimize(loss, slopes.astype(float), jac=True, method="L-BFGS-B", bounds=bounds)
    low, high, shift = solution.x @ basis
    return Calibration(float(low), float(high), float(shift))
