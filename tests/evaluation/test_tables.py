"""Counting on outcomes made by hand: thresholds, own shares, groups, poses, and the JSON of the contract."""

import json

import numpy as np
import pytest
from outcome_makers import condition, view

from ffhnet.evaluation.outcomes import UnseenView
from ffhnet.evaluation.tables import KEPT_SHARES, SURE, make_row, make_table


@pytest.fixture
def table():
    return make_table(
        [
            view("can", [0.96, 0.8, 0.6, 0.1], [1, 1, 0, 0], [1, 1, 1, 0], heuristic=[1, 0, 0], distinct=7),
            view("can", [0.97, 0.2], [1, 1], pose="lying_0"),
            view("box", [0.4, 0.3], [0, 1], height=0.03, distinct=2),
        ],
        [UnseenView("box", "lying_0")],
    )


def counts(cell):
    return cell.successes, cell.kept


def test_thresholds_count_collisions_as_failures(table):
    can = table.rows[0]
    assert [counts(cell) for cell in can.thresholds] == [(4, 6), (3, 4), (3, 3), (2, 2), (2, 2)]
    assert can.raw.collisions == 1
    assert can.raw.rate == pytest.approx(4 / 6)
    assert can.raw.rate_executed == pytest.approx(4 / 5)
    assert can.thresholds[1].retained == pytest.approx(4 / 6)
    assert table.total.raw.kept == 8


def test_empty_cells_do_not_enter_the_mean(table):
    assert np.isnan(table.rows[1].thresholds[1].rate)
    assert table.mean_rate(0) == pytest.approx((4 / 6 + 1 / 2) / 2)
    assert table.mean_rate(1) == pytest.approx(3 / 4)


def test_parts_by_pose_and_height(table):
    assert [(row.name, row.views) for row in table.parts] == [
        ("total", 3),
        ("standing", 2),
        ("other", 1),
        ("small", 1),
    ]
    assert counts(table.small.raw) == (1, 2)
    assert counts(table.total.nominal.top1) == (2, 3)
    assert counts(table.total.heuristic) == (1, 3)
    assert counts(table.standing.raw) == (3, 6)


def test_only_drawn_samples_enter_rates():
    """Executing all samples of a view, or its best ones, must not shift the rates."""
    drawn = view("can", [0.9, 0.7, 0.5, 0.1], [1, 1, 1, 0], drawn=[0, 1, 0, 1])
    row = make_row("can", [drawn])
    assert counts(row.raw) == (1, 2)
    assert counts(row.thresholds[3]) == (0, 0)
    assert counts(row.nominal.top1) == (1, 1)


def test_own_share_takes_the_same_part_of_every_object():
    """One object is rated above the other throughout: globally it fills the best half alone."""
    sure = view("sure", np.linspace(0.99, 0.9, 10), [1] * 10)
    doubtful = view("doubtful", np.linspace(0.5, 0.1, 10), [1, 0, 1, 0, 0, 1, 1, 1, 1, 1])
    half = make_table([sure, doubtful]).total.best(0.5)
    assert counts(half.everywhere) == (10, 10)
    assert counts(half.own) == (7, 10)


def test_kept_shares_follow_the_score_and_thresholds_the_probability():
    """A network may rank by something else than its success probability."""
    row = make_row("can", [view("can", [0.9, 0.8, 0.2, 0.1], [0, 0, 1, 1], score=[1, 2, 3, 4])])
    assert counts(row.best(0.5).own) == (2, 2)
    assert counts(row.thresholds[1]) == (0, 2)


def test_worst_object_is_told_by_its_own_best():
    good = view("good", np.linspace(0.5, 0.1, 10), [1] * 5 + [0] * 5)
    bad = view("bad", np.linspace(0.9, 0.6, 10), [0] * 5 + [1] * 5)
    table = make_table([good, bad])
    assert table.worst.name == "bad"
    assert counts(table.worst.best(0.28).own) == (0, 3)


def test_lead_is_over_the_better_control():
    views = [
        view("a", [0.9], [1], conditions=(condition(top=[1], any_yaw=[1], short_side=[0]),)),
        view("b", [0.9], [1], conditions=(condition(top=[1], any_yaw=[0], short_side=[0]),)),
    ]
    nominal = make_row("total", views).nominal
    assert nominal.lead.value == pytest.approx(0.5)
    assert nominal.lead.interval.low == pytest.approx(0)
    assert nominal.lead.interval.high == pytest.approx(1)


def test_the_best_grasp_is_left_out_where_its_score_is_low():
    weak, strong = condition("friction", top=[0, 1]), condition("friction", top=[1])
    views = [
        view("a", [0.9, 0.1], [1, 0], score=[0.8, 0.1], conditions=(condition(top=[1, 0]), weak)),
        view("a", [0.9], [1], score=[0.3], conditions=(condition(top=[0]), strong)),
        view("b", [0.9], [1], score=[0.75], conditions=(condition(top=[1]), strong)),
    ]
    row = make_row("total", views)
    assert SURE == (0.25, 0.5, 0.75, 0.9)
    assert [counts(cell) for cell in row.nominal.sure] == [(2, 3), (2, 2), (2, 2), (0, 0)]
    assert [counts(cell) for cell in row.conditions[1].sure] == [(2, 3), (1, 2), (1, 2), (0, 0)]
    assert row.nominal.sure[1].retained == pytest.approx(2 / 3)


def test_coverage_is_a_mean_over_objects(table):
    assert table.total.coverage.distinct.value == pytest.approx(4.5)
    assert table.total.coverage.views == 2
    assert table.other.coverage is None


def test_json_follows_the_contract(table):
    content = json.loads(table.to_json({"seed": 0}))
    assert set(content) >= {"protocol", "objects", "total", "standing", "other", "small", "worst_object"}
    cell = content["objects"]["can"]["thresholds"]["0.5"]
    assert (cell["executed"], cell["successes"]) == (4, 3)
    assert content["objects"]["box"]["thresholds"]["0.9"]["retained"] == 0.0
    assert content["objects"]["box"]["thresholds"]["0.9"]["rate"] is None
    assert content["objects"]["can"]["placements"] == 2
    assert content["total"]["top1"]["executed"] == 3
    assert set(content["total"]["kept"]) == {str(share) for share in KEPT_SHARES}
    assert content["total"]["conditions"]["nominal"]["blind_short_side"]["executed"] == 3
    assert set(content["total"]["conditions"]["nominal"]["top1_by_score"]) == {str(score) for score in SURE}
    assert content["unseen_views"] == [{"object": "box", "pose": "lying_0"}]
    assert sum(b["count"] for b in content["evaluator"]["reliability"]) == 8
    low, high = content["total"]["thresholds"]["0.0"]["bootstrap95"]
    assert low == pytest.approx(1 / 2)
    assert high == pytest.approx(2 / 3)
    assert content["objects"]["can"]["thresholds"]["0.0"]["bootstrap95"] is None
