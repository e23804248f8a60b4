"""How unlike all that the networks were trained on an object looks, and where that is worth a warning.

The networks see an object through the principal components of the training views' basis point sets
(`model/pca.py`). There the training views have a mean and standard deviations, which travel with the
weights: novelty is the Mahalanobis distance from them, as a root mean square over the components, so that
training views are at 1 on the whole. A wall, a car or an empty room is far off: what the networks say of it
means nothing. Whatever looks like an object at a hand's scale, such as a wire, is not told from one.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from ffhnet.errors import OptionError, WeightsError
from ffhnet.model.condition import ObjectCondition
from ffhnet.model.pca import WHITENING

FALSE_ALARMS = 0.01
"""Share of views of objects as they are wanted that may be taken for something else."""


def novelty(condition: ObjectCondition, bps: Float[np.ndarray, " D"]) -> float | None:
    """Mahalanobis distance of a view from the training views, 1 being usual; None where no PCA was fitted.

    Args:
        condition: what a network makes of an observation; holds the projection.
        bps: basis point set encoding, metres.
    """
    if condition.config.pca_components is None:
        return None
    with torch.no_grad():
        matrix = condition.projection
        # A component of standard deviation s is a column of length s^-w, and so has s^(1-w) after projection.
        length = matrix.norm(dim=0)
        if not length.any():
            return None
        standardise = length ** ((1 - WHITENING) / WHITENING)
        seen = torch.as_tensor(bps, dtype=matrix.dtype, device=matrix.device) - condition.bps_mean
        standard = (seen @ matrix * standardise)[length > 0].double()
        return float(standard.square().mean().sqrt())


@dataclass(frozen=True)
class NoveltyLimit:
    """From where on a view is called novel.

    Attributes:
        limit: novelty that few familiar views exceed.
        false_alarms: how few: the expected share of further views like those it was measured on.
        views: how many it was measured on, of objects that trained nothing.
    """

    limit: float
    false_alarms: float
    views: int

    def __post_init__(self) -> None:
        if not (0 < self.limit < np.inf and 0 < self.false_alarms < 1 and self.views >= 1):
            raise OptionError(f"a limit of novelty is positive and of some views, got {self}")

    @classmethod
    def of(cls, scores: Float[np.ndarray, " V"], false_alarms: float = FALSE_ALARMS) -> NoveltyLimit:
        """The limit that a further view of the same kind exceeds with at most this probability.

        Split conformal prediction: of V + 1 exchangeable views the rank of each is uniform. Where V is too
        small for the rate, the limit is the largest score, and the rate is what that gives.
        """
        rank = int(np.ceil((1 - false_alarms) * (len(scores) + 1)))
        if rank > len(scores):
            return cls(float(np.max(scores)), 1 / (len(scores) + 1), len(scores))
        return cls(float(np.sort(scores)[rank - 1]), false_alarms, len(scores))

    def warning(self, relative: float) -> str | None:
        """One line about a view of that novelty, in units of the limit; None if it is familiar."""
        if relative <= 1:
            return None
        return (
            f"unlike anything the networks know: do not trust the probabilities. Novelty is {relative:.2g} "
            f"times the limit that {self.false_alarms:.1%} of {self.views} views of unseen objects pass"
        )

    def to_json(self) -> dict[str, float]:
        """Plain values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, content: Any) -> NoveltyLimit:
        """What `to_json` gave. Raises WeightsError for anything else."""
        try:
            return cls(float(content["limit"]), float(content["false_alarms"]), int(content["views"]))
        except (KeyError, TypeError, ValueError, OverflowError, OptionError) as error:
            raise WeightsError(f"not a limit of novelty: {error}") from error
