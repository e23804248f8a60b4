"""Calibration finds maps that are known, keeps the order, and refuses what it cannot use."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffhnet.errors import OptionError, WeightsError
from ffhnet.inference.calibration import Calibration, fit_calibration


def logit(p: np.ndarray) -> np.ndarray:
    return np.log(p / (1 - p))


def samples(truth: Calibration, seed: int = 0, objects: int = 100, each: int = 200):
    """Object, prediction and success of samples whose true probability is a map of what is predicted."""
    rng = np.random.default_rng(seed)
    probability = rng.beta(1.5, 0.8, size=objects * each).clip(1e-4, 1 - 1e-4)
    success = (rng.random(len(probability)) < truth.apply(probability)).astype(float)
    return np.repeat(np.arange(objects), each), probability, success


@pytest.mark.parametrize(
    "truth", [Calibration(0.5, 0.5, 0.0), Calibration(0.7, 0.7, -0.8), Calibration(0.5, 1.5, 0.4)]
)
def test_known_maps_are_found(truth: Calibration):
    fit = fit_calibration(*samples(truth))
    p = np.linspace(0.05, 0.95, 19)
    np.testing.assert_allclose(fit.calibration.apply(p), truth.apply(p), atol=0.02)
    assert fit.cross_entropy[fit.kind] < fit.cross_entropy["identity"]
    assert fit.ece[fit.kind] < 0.015 < fit.ece["identity"]
    assert fit.kind == min(fit.cross_entropy, key=fit.cross_entropy.__getitem__)


def test_identity_changes_nothing():
    p = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(Calibration().apply(p), p, atol=1e-12)
    np.testing.assert_allclose(Calibration(2, 2, 1).apply(p), 1 / (1 + np.exp(-(2 * logit(p) + 1))))


@given(
    st.floats(0.05, 5),
    st.floats(0.05, 5),
    st.floats(-3, 3),
    st.lists(st.floats(0.001, 0.999), min_size=2, max_size=30),
)
def test_the_order_stays(low: float, high: float, shift: float, values: list[float]):
    p = np.unique(np.round(values, 4))
    mapped = Calibration(low, high, shift).apply(p)
    assert (np.diff(mapped) > 0).all()
    assert ((mapped > 0) & (mapped < 1)).all()


def test_the_ends_stay_finite():
    assert np.isfinite(Calibration(0.3, 4, -2).apply(np.array([0.0, 1.0]))).all()


def test_one_kind_of_outcome_gives_a_finite_increasing_map():
    object_id, probability, success = samples(Calibration())
    for outcome in (0.0, 1.0):
        fit = fit_calibration(object_id, probability, np.full_like(success, outcome))
        mapped = fit.calibration.apply(np.array([0.1, 0.5, 0.9]))
        assert np.isfinite(mapped).all()
        assert (np.diff(mapped) >= 0).all()
        assert abs(mapped - outcome).max() < 0.2


def test_kinds_are_compared_on_objects_that_were_not_fitted():
    # Each object goes its own way: a map fitted to some says nothing of others, and more freedom is worse.
    object_id, probability, _ = samples(Calibration(), objects=6, each=500)
    success = (object_id % 2).astype(float)
    fit = fit_calibration(object_id, probability, success)
    assert fit.cross_entropy[fit.kind] > 0.6


def test_json_round_trip():
    calibration = Calibration(0.7, 1.2, -0.31)
    assert Calibration.from_json(json.loads(json.dumps(calibration.to_json()))) == calibration
    for content in (None, 3, {"low": "x"}, {"slope": 1.0}, {"low": -1.0}, {"shift": float("nan")}):
        with pytest.raises(WeightsError, match="not a calibration"):
            Calibration.from_json(content)


def test_bad_samples_are_errors():
    good = samples(Calibration(), objects=2, each=5)
    with pytest.raises(OptionError, match="equally long"):
        fit_calibration(np.empty(0), np.empty(0), np.empty(0))
    with pytest.raises(OptionError, match="2 objects, got 1"):
        fit_calibration(np.zeros(10), good[1], good[2])
    for value in (np.nan, -0.1, np.inf):
        with pytest.raises(OptionError, match="predictions must lie between 0 and 1"):
            fit_calibration(good[0], np.where(np.arange(10) == 3, value, good[1]), good[2])
    with pytest.raises(OptionError, match="positive slopes"):
        Calibration(low=0.0)
