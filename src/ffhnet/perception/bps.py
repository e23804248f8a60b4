"""The basis point set: a partial cloud as a vector of fixed length (section III-A)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ffhnet.geometry.basis import basis_points
from ffhnet.perception.cloud import search_tree


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
