"""Measures of diversity on grasps whose answer is known."""

import json

import numpy as np
import pytest
from trial_makers import HAND, make_trials, write_data_set

from ffhnet.dataset.diversity import diversity
from ffhnet.geometry.rotations import matrix_from_rotation_vector, quaternion_from_matrix
from ffhnet.simulation.distinct import NEAR_POSITION


def two_proposers():
    """On one placement, `same` always repeats one success; `varied` never does, and tries twice as much."""
    n_same, n_varied = 10, 20
    n = n_same + n_varied
    position = np.zeros((n, 3))
    position[n_same:, 0] = np.arange(n_varied) * 2 * NEAR_POSITION
    joints = np.zeros((n, HAND.num_joints))
    joints[n_same:] = np.where(np.arange(n_varied) % 2, 0.6, 0.2)[:, None]
    return make_trials(
        ["success"] * n,
        proposer=np.array(["same"] * n_same + ["varied"] * n_varied),
        position=position,
        joints=joints,
        closed_joints=joints,
    )


def test_proposers_are_compared_at_the_same_number_of_trials():
    same, varied = diversity(two_proposers(), HAND, np.random.default_rng(0))
    assert [d.mean for d in same.distinct[:2]] == [1, 1]
    assert [d.mean for d in varied.distinct[:2]] == [5, 10]
    assert np.isnan(same.distinct[2].mean)
    assert same.distinct[2].placements == 0
    assert varied.distinct[2].mean == 20
    assert (same.closed_spread, varied.closed_spread) == (0, pytest.approx(0.2))
    assert same.success.trials == 10


def test_a_placement_that_one_proposer_lacks_is_left_out():
    """`varied` alone makes 40 failures elsewhere: they lower its rate and not its count."""
    known = two_proposers()
    alone = make_trials(
        ["missed"] * 40,
        proposer=np.array(["varied"] * 40),
        object_name=np.array(["pouch_000002"] * 40),
    )
    both = type(known).concatenate([known, alone])
    _, varied = diversity(both, HAND, np.random.default_rng(0))
    assert varied.distinct[0].placements == 1
    assert varied.distinct[0].mean == 5
    assert varied.success.value == pytest.approx(20 / 60)


def test_failures_and_collisions_add_nothing():
    trials = two_proposers()
    outcome = np.array(["success", "slipped", "collision"] * 10)
    (measured,) = diversity(
        make_trials(outcome, position=trials.position * 3, closed_joints=trials.joints),
        HAND,
        np.random.default_rng(0),
    )
    assert measured.success.trials == 20
    assert measured.distinct[2].mean <= 10


def test_unrecorded_contacts_give_no_types():
    trials = make_trials(["success"] * 6, contact_links=np.full(6, np.nan))
    (measured,) = diversity(trials, HAND, np.random.default_rng(0))
    assert np.isnan(measured.type_entropy)
    assert measured.to_json()["type_entropy_bits"] is None


def test_the_seed_decides():
    rng = np.random.default_rng(3)
    rotation = matrix_from_rotation_vector(rng.normal(0, 0.4, (200, 3)))
    trials = make_trials(
        np.where(rng.random(200) < 0.5, "success", "missed"),
        position=rng.normal(0, 0.02, (200, 3)),
        quaternion_wxyz=quaternion_from_matrix(rotation),
    )
    first, again, other = (diversity(trials, HAND, np.random.default_rng(s))[0].distinct for s in (0, 0, 1))
    assert first == again
    assert first != other


def test_the_command_prints_and_writes_json(tmp_path, capsys):
    from ffhnet.apps.cli import main

    folder = write_data_set(tmp_path / "set", two_proposers())
    main(["data", "diversity", str(folder), "--json", str(tmp_path / "measures.json")])
    assert "distinct @10" in capsys.readouterr().out
    same, varied = json.loads((tmp_path / "measures.json").read_text())["proposers"]
    assert (same["proposer"], same["executed"]) == ("same", 10)
    assert varied["distinct_per_placement"][1] == {"executed_trials": 10, "placements": 1, "mean": 10.0}
    assert varied["distinct_per_placement"][3]["mean"] is None
