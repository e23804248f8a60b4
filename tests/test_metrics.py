"""Metrics against brute force and their defining properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffhnet.errors import OptionError
from ffhnet.metrics import (
    auroc,
    binary_cross_entropy,
    expected_calibration_error,
    reliability,
    wilson_interval,
)

pairs = st.lists(st.tuples(st.booleans(), st.integers(0, 5)), min_size=2, max_size=40)


@given(pairs)
def test_auroc_counts_pairs_and_ties_half(values: list[tuple[bool, int]]):
    label = np.array([v[0] for v in values], dtype=float)
    score = np.array([v[1] for v in values], dtype=float)
    positive, negative = score[label == 1], score[label == 0]
    if len(positive) == 0 or len(negative) == 0:
        assert np.isnan(auroc(label, score))
        return
    difference = positive[:, None] - negative[None, :]
    brute = np.mean((difference > 0) + 0.5 * (difference == 0))
    assert auroc(label, score) == pytest.approx(brute)
    assert auroc(label, -score) == pytest.approx(1 - brute)
    assert auroc(label, np.exp(score)) == pytest.approx(brute)


@given(trials=st.integers(1, 2000), share=st.floats(0, 1))
def test_wilson_bounds_solve_the_score_equation(trials: int, share: float):
    successes = round(share * trials)
    interval = wilson_interval(successes, trials)
    rate = successes / trials
    assert 0 <= interval.low <= rate + 1e-12
    assert rate - 1e-12 <= interval.high <= 1
    for bound in (interval.low, interval.high):
        if 1e-9 < bound < 1 - 1e-9:
            z = abs(rate - bound) / np.sqrt(bound * (1 - bound) / trials)
            assert z == pytest.approx(1.959964, rel=1e-6)
    mirrored = wilson_interval(trials - successes, trials)
    assert mirrored.low == pytest.approx(1 - interval.high, abs=1e-12)


def test_wilson_known_values():
    interval = wilson_interval(450, 450)
    assert (interval.low, interval.high) == (pytest.approx(0.99154, abs=1e-5), pytest.approx(1))
    interval = wilson_interval(35, 36)
    assert (interval.low, interval.high) == (pytest.approx(0.858, abs=1e-3), pytest.approx(0.995, abs=1e-3))
    assert wilson_interval(0, 0).low == 0
    assert wilson_interval(0, 0).high == 1


def test_wilson_refuses_impossible_counts():
    with pytest.raises(OptionError, match="between 0 and 3"):
        wilson_interval(4, 3)


def test_calibration_error_is_the_weighted_gap_per_bin():
    rng = np.random.default_rng(0)
    probability = rng.random(500)
    label = (rng.random(500) < probability**2).astype(float)
    wanted = 0.0
    for k in range(10):
        inside = (probability >= k / 10) & (probability < (k + 1) / 10)
        wanted += inside.mean() * abs(probability[inside].mean() - label[inside].mean())
    assert expected_calibration_error(label, probability) == pytest.approx(wanted)


def test_reliability_counts_every_prediction_once():
    rng = np.random.default_rng(0)
    probability = np.append(rng.random(300), [0.0, 0.1, 0.9999, 1.0])
    label = (rng.random(304) < probability).astype(float)
    bins = reliability(label, probability, 5)
    assert sum(b.count for b in bins) == 304
    for b in bins:
        inside = (probability >= b.low) & ((probability < b.high) | (b.high == 1))
        assert b.count == inside.sum()
        assert b.predicted == pytest.approx(probability[inside].mean())
        assert b.observed == pytest.approx(label[inside].mean())
    assert np.isnan(reliability(np.array([1.0]), np.array([0.05]))[5].observed)


def test_calibration_error_extremes():
    label = np.array([1.0, 0.0, 1.0])
    assert expected_calibration_error(label, label) == 0
    assert expected_calibration_error(label, 1 - label) == 1
    rng = np.random.default_rng(1)
    probability = rng.random(200_000)
    assert expected_calibration_error(rng.random(200_000) < probability, probability) < 0.01


def test_cross_entropy():
    assert binary_cross_entropy(np.array([1.0, 0.0]), np.array([0.5, 0.5])) == pytest.approx(np.log(2))
    assert binary_cross_entropy(np.array([0.3]), np.array([0.3])) == pytest.approx(0.6108643)
    assert np.isfinite(binary_cross_entropy(np.array([1.0]), np.array([0.0])))


@pytest.mark.parametrize(("label", "score"), [([], []), ([1.0], [0.1, 0.2]), ([[1.0]], [[0.1]])])
def test_bad_shapes_are_refused(label: list, score: list):
    for metric in (auroc, expected_calibration_error, binary_cross_entropy):
        with pytest.raises(OptionError, match="equally long vectors"):
            metric(np.array(label), np.array(score))
