"""A fixed linear projection of basis point set vectors, fitted once on the training views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from jaxtyping import Float

from ffhnet.errors import DatasetError

WHITENING = 0.7
"""A component of standard deviation s is scaled by 1/s^0.7. Full whitening (1) would blow up the noise."""

MAX_VIEWS = 3000
"""Views used for fitting, evenly spread; more would cost time and change nothing."""


@dataclass(frozen=True)
class Projection:
    """The affine map (bps - mean) @ matrix.

    Attributes:
        mean: metres.
        matrix: principal directions as columns, scaled; columns beyond the rank of the data are zero.
    """

    mean: Float[np.ndarray, " D"]
    matrix: Float[np.ndarray, "D K"]


def fit_projection(bps: Float[np.ndarray, "V D"], components: int) -> Projection:
    """Principal components of BPS vectors, partly whitened.

    Args:
        bps: one row per view, metres.
        components: number of columns wanted.

    Raises:
        DatasetError: fewer than two views.
    """
    if len(bps) < 2:
        raise DatasetError(f"fitting a projection of the BPS takes at least 2 views, got {len(bps)}")
    picked = np.linspace(0, len(bps) - 1, min(len(bps), MAX_VIEWS)).round().astype(int)
    rows = np.asarray(bps[picked], dtype=np.float64)
    mean = rows.mean(axis=0)
    rows = rows - mean
    # The eigenvectors of the smaller Gram matrix give those of the covariance.
    few_views = len(rows) < rows.shape[1]
    gram = rows @ rows.T if few_views else rows.T @ rows
    kept = min(components, len(gram))
    values, vectors = scipy.linalg.eigh(gram, subset_by_index=(len(gram) - kept, len(gram) - 1))
    values, vectors = values[::-1], vectors[:, ::-1]
    real = values > 1e-9 * values[0]
    values, vectors = values[real], vectors[:, real]
    directions = rows.T @ vectors / np.sqrt(values) if few_views else vectors
    deviation = np.sqrt(values / len(rows))
    matrix = np.zeros((rows.shape[1], components))
    matrix[:, : len(values)] = directions / deviation**WHITENING
    return Projection(mean.astype(np.float32), matrix.astype(np.float32))
