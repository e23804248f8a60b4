"""Bootstrap over objects: against brute force, its coverage, and that it is always the same."""

import numpy as np
import pytest
from outcome_makers import tries, view

from ffhnet.evaluation import bootstrap
from ffhnet.evaluation.calibration import measure_calibration
from ffhnet.evaluation.cells import Drawn, best_of_all, count, pool
from ffhnet.evaluation.tables import make_table
from ffhnet.metrics import auroc, expected_calibration_error


def some_objects(objects, seed=0, samples=40):
    """Samples whose rate differs between objects; probabilities are rounded, so that there are ties."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(objects):
        probability = np.round(rng.beta(2 + k % 3, 2, samples), 1)
        success = rng.random(samples) < probability
        executed = success | (rng.random(samples) < 0.7)
        found.append(Drawn.of([view(f"object_{k}", probability, success, executed)]))
    return found


def resampled(objects, draw):
    """The objects of one draw, written out."""
    return [o for o, times in zip(objects, draw, strict=True) for _ in range(times)]


def joined(objects):
    success = np.concatenate([o.tries.success for o in objects])
    executed = np.concatenate([o.tries.executed for o in objects])
    return success.astype(float), np.concatenate([o.probability for o in objects]), executed


def test_intervals_agree_with_resampling_written_out():
    """Rates, AUROC and ECE are computed without making the resampled tables: here they are made."""
    objects = some_objects(5)
    draws = bootstrap.object_draws(5)
    success, kept = (np.array([f(o) for o in objects]) for f in (lambda o: o.tries.success.sum(), len))
    rates = bootstrap.ratio(success, kept)
    brute = {"auroc": [], "executed": [], "ece": []}
    for i, draw in enumerate(draws):
        label, probability, executed = joined(resampled(objects, draw))
        assert rates[i] == pytest.approx(label.mean())
        if i >= 300:
            continue
        brute["auroc"].append(auroc(label, probability))
        brute["executed"].append(auroc(label[executed], probability[executed]))
        brute["ece"].append(expected_calibration_error(label, probability))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bootstrap, "object_draws", lambda _: draws[:300])
        measured = measure_calibration([[o] for o in objects])
    estimates = {"auroc": measured.auroc, "executed": measured.auroc_executed, "ece": measured.ece}
    label, probability, executed = joined(objects)
    assert measured.auroc.value == pytest.approx(auroc(label, probability))
    assert measured.auroc_executed.value == pytest.approx(auroc(label[executed], probability[executed]))
    assert measured.ece.value == pytest.approx(expected_calibration_error(label, probability))
    for name, estimate in estimates.items():
        low, high = np.percentile(brute[name], [2.5, 97.5])
        assert (estimate.interval.low, estimate.interval.high) == (pytest.approx(low), pytest.approx(high))


def test_global_best_is_chosen_anew_in_each_draw():
    objects = some_objects(4, seed=3)
    for o in objects:
        o.score[:] += np.linspace(0, 0.05, len(o))  # no ties: their order is not the same when written out
    draws = bootstrap.object_draws(4)
    rates = []
    for draw in draws:
        chosen = resampled(objects, draw)
        score = np.concatenate([o.score for o in chosen])
        best = np.argsort(-score, kind="stable")[: round(0.28 * len(score))]
        rates.append(np.concatenate([o.tries.success for o in chosen])[best].mean())
    interval = best_of_all(objects, [0.28, 0.5])[0].interval
    low, high = np.percentile(rates, [2.5, 97.5])
    assert (interval.low, interval.high) == (pytest.approx(low, abs=0.01), pytest.approx(high, abs=0.01))


def test_same_draws_every_time():
    texts = []
    for _ in range(2):
        bootstrap.object_draws.cache_clear()
        texts.append(make_table([view("a", [0.9, 0.1], [1, 0]), view("b", [0.8, 0.7], [1, 1])]).to_json({}))
    assert texts[0] == texts[1]


def test_a_single_object_has_no_bootstrap_interval():
    assert pool([count(tries([1, 0, 1]))]).interval is None


def test_coverage_on_synthetic_objects():
    """With 30 objects of varied rates the interval holds the true mean about 95 times in 100, where the
    Wilson interval over grasps, which takes them for independent, holds it much more rarely."""
    rng = np.random.default_rng(5)
    held = wilson_held = 0
    for _ in range(200):
        rate = rng.beta(4, 1, 30)
        cell = pool([count(tries(rng.random(50) < r)) for r in rate])
        held += cell.interval.low <= 0.8 <= cell.interval.high
        wilson_held += cell.wilson.low <= 0.8 <= cell.wilson.high
    assert 176 <= held <= 198
    assert wilson_held < 150


def test_within_view_auroc_leaves_out_what_tells_views_apart():
    """All grasps of one view are better and rated higher, but within a view the rating says nothing."""
    views = [view("a", [0.9] * 4, [1, 1, 1, 0]), view("b", [0.1] * 4, [0, 0, 0, 1])]
    measured = measure_calibration([[Drawn.of([v])] for v in views])
    assert measured.auroc_within_view.value == pytest.approx(0.5)
    assert measured.auroc.value > 0.7
