"""The basis points: a fixed set of points in a ball, around which clouds are described (section III-A)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

BASIS_SIZE = 4096
BASIS_RADIUS = 0.2
"""m"""
BASIS_SEED = 13


@lru_cache(maxsize=8)
def basis_points(
    n: int = BASIS_SIZE, radius: float = BASIS_RADIUS, seed: int = BASIS_SEED
) -> Float[np.ndarray, "n 3"]:
    """Points uniform in a ball (m), the same for ever for the same arguments; read-only.

    The defaults are the basis of the published models: networks only understand vectors made with the
    basis that they were trained with. The legacy `RandomState` is meant, its stream is frozen.
    """
    # The one exception to "randomness is passed in": this is a constant written as its recipe.
    random = np.random.RandomState(seed)
    directions = random.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = directions * random.uniform(size=(n, 1)) ** (1 / 3) * radius
    points.flags.writeable = False
    return points
