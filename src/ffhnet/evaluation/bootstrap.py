"""Intervals by resampling objects: grasps of one object are alike, so objects are the unit."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from ffhnet.metrics import Interval

DRAWS = 2000
_SEED = 0
_PERCENTILES = (2.5, 97.5)


@lru_cache
def object_draws(objects: int) -> Int[np.ndarray, "D O"]:
    """How often each object occurs in each draw of as many with replacement; always the same draws."""
    rng = np.random.default_rng(_SEED)
    return rng.multinomial(objects, np.full(objects, 1 / objects), size=DRAWS)


def interval(values: Float[np.ndarray, " D"], objects: int) -> Interval | None:
    """The middle 95 % of what the draws gave; None of a single object, which says nothing about others."""
    known = values[np.isfinite(values)]
    if objects < 2 or len(known) == 0:
        return None
    low, high = np.percentile(known, _PERCENTILES)
    return Interval(float(low), float(high))


def ratio(
    numerator: Float[np.ndarray, " O"], denominator: Float[np.ndarray, " O"]
) -> Float[np.ndarray, " D"]:
    """Sum over objects of one count by that of another, in each draw; NaN where the latter is zero."""
    draws = object_draws(len(numerator))
    above, below = draws @ np.asarray(numerator, float), draws @ np.asarray(denominator, float)
    return np.divide(above, below, out=np.full(len(draws), np.nan), where=below > 0)
