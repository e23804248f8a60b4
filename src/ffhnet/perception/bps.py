"""The basis point set: a partial cloud as a vector of fixed length (section III-A)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ffhnet.errors import MissingExtraError
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
    return _encode(cloud_in_frame) if basis is None else _search_tree(cloud_in_frame, basis)


def compile_encoder() -> None:
    """Let `encode` use compiled code from now on, which is about ten times faster.

    It takes a second or two, and is for what runs for long. Distances to `basis_points()` are then
    computed in float32 and may differ by 1e-7 m.

    Raises:
        MissingExtraError: numba is not installed.
    """
    global _encode
    try:
        from ffhnet.perception.nearest_kernel import nearest_distances
    except ImportError as error:
        raise MissingExtraError("the compiled encoder needs numba: pip install 'ffhnet[fast]'") from error
    nearest_distances(basis_points())
    _encode = nearest_distances


def encode_cloud_centroid(cloud: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " n"]:
    """The encoding of the published models: the cloud keeps its axes and is centred on its mean."""
    return encode(cloud - cloud.mean(axis=0))


def _search_tree(
    cloud: Float[np.ndarray, "M 3"], basis: Float[np.ndarray, "n 3"] | None = None
) -> Float[np.ndarray, " n"]:
    distances, _ = search_tree(cloud).query(basis_points() if basis is None else basis)
    return distances.astype(np.float32)


_encode: Callable[[np.ndarray], np.ndarray] = _search_tree
