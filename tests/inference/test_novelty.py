"""Novelty is the Mahalanobis distance in the networks' components, and its limit keeps the promised rate."""

import numpy as np
import pytest
import torch

from ffhnet.errors import WeightsError
from ffhnet.inference.novelty import NoveltyLimit, novelty
from ffhnet.model import ModelConfig
from ffhnet.model.condition import ObjectCondition
from ffhnet.model.pca import fit_projection


@pytest.fixture(scope="module")
def views():
    """Rows of different deviations in directions that are no axes, in metres."""
    rng = np.random.default_rng(0)
    turn, _ = np.linalg.qr(rng.normal(size=(64, 64)))
    return 0.1 + (rng.normal(size=(500, 64)) * np.geomspace(0.05, 0.001, 64)) @ turn.T


@pytest.fixture(scope="module")
def condition(views):
    known = ObjectCondition(ModelConfig(num_joints=2, bps_size=64, pca_components=6))
    known.set_projection(fit_projection(views, 6))
    return known


def test_it_is_the_distance_in_standard_deviations_of_the_principal_components(views, condition):
    centred = views - views.mean(axis=0)
    _, singular, directions = np.linalg.svd(centred, full_matrices=False)
    standard = centred @ directions[:6].T / (singular[:6] / np.sqrt(len(views)))
    wanted = np.sqrt((standard**2).mean(axis=1))
    found = [novelty(condition, view.astype(np.float32)) for view in views[:50]]
    np.testing.assert_allclose(found, wanted[:50], rtol=1e-3)
    assert np.sqrt((wanted**2).mean()) == pytest.approx(1.0)


def test_columns_beyond_the_rank_of_the_data_do_not_count(views):
    few = views[:4]
    known = ObjectCondition(ModelConfig(num_joints=2, bps_size=64, pca_components=20))
    known.set_projection(fit_projection(few, 20))
    scores = np.array([novelty(known, view.astype(np.float32)) for view in few])
    assert np.sqrt((scores**2).mean()) == pytest.approx(1.0, rel=1e-3)


def test_networks_without_a_fitted_projection_know_nothing():
    for components in (None, 8):
        model = ModelConfig(num_joints=2, pca_components=components)
        assert novelty(ObjectCondition(model), np.zeros(4096)) is None


def test_the_limit_keeps_its_rate_of_false_alarms():
    rng = np.random.default_rng(1)
    alarms = [
        (rng.gamma(3.0, size=200) > NoveltyLimit.of(rng.gamma(3.0, size=300), 0.05).limit).mean()
        for _ in range(200)
    ]
    assert 0.04 < np.mean(alarms) < 0.055


def test_few_views_promise_no_more_than_they_can():
    limit = NoveltyLimit.of(np.array([1.0, 3.0, 2.0]))
    assert (limit.limit, limit.false_alarms, limit.views) == (3.0, 0.25, 3)


def test_round_trip_and_warning():
    limit = NoveltyLimit.of(np.linspace(0, 2, 1000))
    assert NoveltyLimit.from_json(limit.to_json()) == limit
    assert limit.warning(1.0) is None
    assert "novelty is 3 times the limit" in str(limit.warning(3.0)).lower()


@pytest.mark.parametrize(
    "content", [None, [], {}, {"limit": "x"}, {"limit": -1, "false_alarms": 0.1, "views": 9}]
)
def test_anything_else_is_no_limit(content):
    with pytest.raises(WeightsError, match="limit of novelty"):
        NoveltyLimit.from_json(content)


def test_it_does_not_depend_on_threads(condition, views):
    one = novelty(condition, views[0].astype(np.float32))
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    assert novelty(condition, views[0].astype(np.float32)) == pytest.approx(one, rel=1e-5)
    torch.set_num_threads(threads)
