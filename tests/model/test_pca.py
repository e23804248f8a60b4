"""The BPS projection: whitening, rank, and that it loses nothing that is there."""

import numpy as np
import pytest

from ffhnet.errors import DatasetError
from ffhnet.model import pca
from ffhnet.model.pca import fit_projection


def low_rank(rng: np.random.Generator, views: int, size: int, rank: int) -> np.ndarray:
    deviations = 2.0 ** -np.arange(rank)
    return 0.1 + (rng.normal(size=(views, rank)) * deviations) @ rng.normal(size=(rank, size))


@pytest.mark.parametrize(("views", "size"), [(400, 60), (60, 400)])
def test_components_are_uncorrelated_with_deviation_to_the_power_of_three_tenths(views: int, size: int):
    bps = low_rank(np.random.default_rng(0), views, size, rank=12)
    projection = fit_projection(bps, components=5)
    out = (bps - projection.mean) @ projection.matrix
    covariance = out.T @ out / views
    deviation = np.linalg.svd(bps - bps.mean(0), compute_uv=False)[:5] / np.sqrt(views)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), deviation**0.3, rtol=1e-4)
    assert np.abs(covariance - np.diag(np.diag(covariance))).max() < 1e-4


def test_columns_beyond_the_rank_are_zero_and_the_rest_reconstructs():
    bps = low_rank(np.random.default_rng(1), 50, 30, rank=4)
    projection = fit_projection(bps, components=10)
    assert np.isfinite(projection.matrix).all()
    assert (projection.matrix[:, 4:] == 0).all()
    code = (bps - projection.mean) @ projection.matrix[:, :4]
    coefficients, *_ = np.linalg.lstsq(code, bps - projection.mean, rcond=None)
    np.testing.assert_allclose(code @ coefficients, bps - projection.mean, atol=1e-4)


def test_more_components_than_views():
    projection = fit_projection(np.random.default_rng(2).random((5, 40)), components=16)
    assert projection.matrix.shape == (40, 16)
    assert (projection.matrix[:, 4:] == 0).all()


def test_thinning_of_views_keeps_the_shape_and_half_precision_is_read(monkeypatch: pytest.MonkeyPatch):
    bps = low_rank(np.random.default_rng(3), 400, 30, rank=3)
    whole = fit_projection(bps, components=3)
    monkeypatch.setattr(pca, "MAX_VIEWS", 200)
    thinned = fit_projection(bps.astype(np.float16), components=3)
    cosine = np.abs(np.sum(whole.matrix * thinned.matrix, axis=0))
    cosine /= np.linalg.norm(whole.matrix, axis=0) * np.linalg.norm(thinned.matrix, axis=0)
    assert cosine.min() > 0.98


def test_one_view_is_too_few():
    with pytest.raises(DatasetError, match="at least 2 views, got 1"):
        fit_projection(np.ones((1, 8)), components=2)
