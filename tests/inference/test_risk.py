"""The promised risk on simulated objects, where the true failure rate of each threshold is known."""

import json
import math
from dataclasses import dataclass

import numpy as np
import pytest

from ffhnet.errors import OptionError, WeightsError
from ffhnet.inference.risk import THRESHOLDS, RiskTable, log_evidence

ALPHA, CONFIDENCE = 0.1, 0.9


@dataclass(frozen=True)
class World:
    """Objects whose views share a difficulty; the score knows the success of a view only in part."""

    clustered: float  # how much of the difficulty is the object's own
    offset: float  # logit of a typical success

    def draw(self, rng: np.random.Generator, objects: int, views: int) -> RiskTable:
        own, each = rng.normal(size=(objects, 1)), rng.normal(size=(objects, views))
        hidden = self.offset + 2.5 * (math.sqrt(self.clustered) * own + math.sqrt(1 - self.clustered) * each)
        score = 1 / (1 + np.exp(-(hidden + rng.normal(scale=1.5, size=hidden.shape))))
        success = rng.random(hidden.shape) < 1 / (1 + np.exp(-hidden))
        return RiskTable(np.repeat(np.arange(objects), views), score.ravel(), success.ravel())

    def true_risk(self) -> dict[float, float]:
        crowd = self.draw(np.random.default_rng(1), 200_000, 1)
        return {t: float(1 - crowd.success[crowd.score >= t].mean()) for t in THRESHOLDS}


def empirical_threshold(table: RiskTable) -> float | None:
    """What one would choose without any correction: the observed failure rate is at most ALPHA."""
    good = [
        t
        for t in THRESHOLDS
        if (1 - table.success[table.score >= t]).sum() <= ALPHA * (table.score >= t).sum()
    ]
    return min(good, default=None)


def by_views(table: RiskTable) -> RiskTable:
    """The mistake of taking each view for an object of its own."""
    return RiskTable(np.arange(len(table.score)), table.score, table.success)


@pytest.mark.parametrize("world", [World(0.9, 3.5), World(0.2, 3.5), World(0.9, 9.0)], ids=str)
def test_the_promise_holds_over_repeats_and_only_with_the_correction(world: World):
    risk = world.true_risk()
    rng = np.random.default_rng(0)
    broken = {"promised": 0, "empirical": 0}
    risks, given, repeats = [], 0, 100
    for _ in range(repeats):
        table = world.draw(rng, 150, 8)
        chosen = {
            "promised": table.control(ALPHA, CONFIDENCE).threshold,
            "empirical": empirical_threshold(table),
        }
        given += chosen["promised"] is not None
        risks.append(0.0 if chosen["promised"] is None else risk[chosen["promised"]])
        for name, threshold in chosen.items():
            broken[name] += threshold is not None and risk[threshold] > ALPHA
    assert broken["promised"] <= (1 - CONFIDENCE) * repeats
    assert np.mean(risks) < ALPHA
    assert given > 0.8 * repeats  # always to abstain would be no use
    if risk[0.0] > ALPHA:
        assert broken["empirical"] > 2 * (1 - CONFIDENCE) * repeats


def test_objects_are_the_unit_not_views():
    world, rng = World(1.0, 3.5), np.random.default_rng(0)
    risk, repeats, broken = world.true_risk(), 20, {"objects": 0, "views": 0}
    for _ in range(repeats):
        table = world.draw(rng, 25, 60)
        for name, points in (("objects", table), ("views", by_views(table))):
            threshold = points.control(0.12, CONFIDENCE).threshold
            broken[name] += threshold is not None and risk[threshold] > 0.12
    assert broken["objects"] <= (1 - CONFIDENCE) * repeats
    assert broken["views"] > 2 * (1 - CONFIDENCE) * repeats


def test_evidence_is_an_e_value_at_the_edge_of_the_hypothesis():
    rng = np.random.default_rng(0)
    evidence = [log_evidence((rng.random(40) < ALPHA) - ALPHA, 1 - ALPHA) for _ in range(2000)]
    assert np.mean(np.exp(evidence)) == pytest.approx(1, abs=0.2)
    assert np.mean(np.array(evidence) >= np.log(10)) <= 0.1


def test_objects_without_failure_count_nearly_as_in_the_exact_binomial_test():
    # (1 - 0.1)^n <= 0.05 / starts takes 36 objects; the mean over stakes costs a few more.
    for count, threshold in ((35, None), (60, 0.0)):
        assert RiskTable(np.arange(count), np.ones(count), np.ones(count)).control(0.1).threshold == threshold


def test_more_risk_never_makes_the_threshold_stricter():
    table = World(0.5, 3.5).draw(np.random.default_rng(3), 200, 5)
    thresholds = [table.control(risk).threshold for risk in (0.02, 0.05, 0.08, 0.1, 0.15, 0.2, 0.3, 0.5)]
    numbers = [2.0 if t is None else t for t in thresholds]
    assert numbers == sorted(numbers, reverse=True)
    assert numbers[-1] < numbers[2] < 2


def test_control_reports_what_happened_at_its_threshold():
    table = World(0.5, 3.5).draw(np.random.default_rng(3), 200, 5)
    control = table.control(0.1)
    executed = table.score >= control.threshold
    assert control.executed == executed.mean()
    assert control.failures == pytest.approx(1 - table.success[executed].mean())
    assert (control.objects, control.possible) == (200, 0.1)


def test_weak_calibration_abstains_and_says_what_is_possible():
    table = World(0.5, 3.5).draw(np.random.default_rng(3), 40, 5)
    control = table.control(0.02)
    assert control.threshold is None
    assert control.executed == control.failures == 0
    message = control.refusal(np.array([0.999]))
    assert message is not None
    assert f"{control.possible:.1%} at best" in message
    assert "40 known objects" in message
    assert table.control(control.possible).threshold is not None
    assert table.control(control.possible - 0.01).threshold is None


def test_all_failures_promise_nothing():
    control = RiskTable(np.arange(300), np.linspace(0, 1, 300), np.zeros(300)).control(0.3)
    assert (control.threshold, control.possible) == (None, None)
    assert "nothing up to 50.0%" in control.refusal(np.ones(1))


def test_candidates_pass_or_are_refused_in_one_line():
    control = World(0.5, 3.5).draw(np.random.default_rng(3), 200, 5).control(0.1)
    threshold = control.threshold
    assert control.refusal(np.array([0.0, threshold])) is None
    refusal = control.refusal(np.array([0.1, threshold - 1e-3]))
    assert "none of 2 candidates" in refusal
    assert f"{threshold - 1e-3:.3f}" in refusal
    assert "at most 10.0% failures with 95% confidence" in refusal
    assert "\n" not in refusal
    assert "no candidates" in control.refusal(np.empty(0))
    with pytest.raises(OptionError, match="1 of 2 candidates have no score"):
        control.refusal(np.array([0.5, np.nan]))


def test_json_gives_the_same_control():
    table = World(0.5, 3.5).draw(np.random.default_rng(3), 100, 5)
    again = RiskTable.from_json(json.loads(json.dumps(table.to_json())))
    assert again.control(0.15) == table.control(0.15)
    for content in (None, [], {}, {"object_id": [1]}, {**table.to_json(), "score": ["a"] * 500}):
        with pytest.raises(WeightsError, match="calibration points"):
            RiskTable.from_json(content)


@pytest.mark.parametrize("value", [np.nan, -0.1, 1.1, np.inf])
def test_bad_points_are_errors(value: float):
    good = np.full(3, 0.5)
    with pytest.raises(OptionError, match="between 0 and 1"):
        RiskTable(np.arange(3), np.array([0.5, value, 0.5]), good)
    with pytest.raises(OptionError, match="between 0 and 1"):
        RiskTable(np.arange(3), good, np.array([0.5, value, 0.5]))
    with pytest.raises(OptionError, match="between 0 and 1"):
        RiskTable(np.arange(3), good, good).control(value if value != 0.5 else 2)


def test_shapes_must_fit():
    for arrays in ((np.empty(0),) * 3, (np.arange(2), np.ones(3), np.ones(3)), (np.ones((2, 1)),) * 3):
        with pytest.raises(OptionError, match="equally long"):
            RiskTable(*arrays)
