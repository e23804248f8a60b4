"""The basis point set: a partial cloud as a vector of fixed length (section III-A)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ffhnet.perception.cloud import search_tree

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


def encode(
    cloud_in_frame: Float[np.ndarray, "M 3"], basis: Float[np.ndarray, "n 3"] | None = None
) -> Float[np.ndarray, " n"]:
    """Distance (m, float32) from each basis point to the nearest point of the cloud.

    Args:
        cloud_in_frame: points (m) in the frame whose origin is the middle of the basis.
        basis: `basis_points()` if none.
    """
    points = basis_points() if basis is None else basis
    distances, _ = search_tree(cloud_in_frame).query(points)
    return distances.astype(np.float32)


def encode_cloud_centroid(cloud: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " n"]:
    """The encoding of the published models: the cloud keeps its axes and is centred on its mean."""
    return encode(cloud - cloud.mean(axis=0))
