"""Counting: thresholds, own best shares, top-1 and start collisions."""

import json

import numpy as np
import pytest

from ffhnet.evaluation.protocol import ViewOutcome
from ffhnet.evaluation.tables import make_table


def view(name, probability, success, executed=None, heuristic=()):
    probability = np.array(probability)
    executed = np.ones(len(probability), bool) if executed is None else np.array(executed, bool)
    return ViewOutcome(
        name, "standing", probability, np.array(success, bool), executed, np.array(heuristic, bool)
    )


@pytest.fixture
def table():
    return make_table(
        [
            view("can", [0.96, 0.8, 0.6, 0.1], [1, 1, 0, 0], [1, 1, 1, 0], heuristic=[1, 0, 0]),
            view("can", [0.2, 0.97], [1, 1]),
            view("box", [0.4, 0.3], [0, 1]),
        ]
    )


def test_thresholds_count_collisions_as_failures(table):
    can = table.rows[0]
    assert [(c.successes, c.kept) for c in can.thresholds] == [(4, 6), (3, 4), (3, 3), (2, 2), (2, 2)]
    assert can.thresholds[0].collisions == 1
    assert can.thresholds[1].retained == pytest.approx(4 / 6)
    assert table.total.thresholds[0].kept == 8


def test_empty_cells_do_not_enter_the_mean(table):
    assert np.isnan(table.rows[1].thresholds[1].rate)
    assert table.mean_rate(0) == pytest.approx((4 / 6 + 1 / 2) / 2)
    assert table.mean_rate(1) == pytest.approx(3 / 4)


def test_top1_and_own_best(table):
    assert (table.total.top1.successes, table.total.top1.kept) == (2, 3)
    assert (table.rows[0].best[0].successes, table.rows[0].best[0].kept) == (2, 2)
    assert (table.total.heuristic.successes, table.total.heuristic.kept) == (1, 3)


def test_json_follows_the_contract(table):
    content = json.loads(table.to_json({"seed": 0}))
    assert set(content) >= {"protocol", "objects", "total"}
    cell = content["objects"]["can"]["thresholds"]["0.5"]
    assert (cell["executed"], cell["successes"]) == (4, 3)
    assert content["objects"]["box"]["thresholds"]["0.9"]["retained"] == 0.0
    assert content["total"]["top1"]["executed"] == 3
