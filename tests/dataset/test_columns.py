"""Reading trials: nulls, missing columns, several data sets."""

import numpy as np
from trial_makers import HAND, make_trials, write_data_set

from ffhnet.dataset.columns import read_trial_columns, split_of


def varied_trials():
    rng = np.random.default_rng(0)
    closed = rng.uniform(0, 1, (4, HAND.num_joints)).astype(np.float16).astype(float)
    closed[1] = np.nan
    return make_trials(
        ["success", "collision", "missed", "success"],
        closed_joints=closed,
        contact_links=np.array([5.0, np.nan, 0.0, 7.0]),
        repeats=np.array([8, 0, 8, 0]),
        held=np.array([6, 0, 1, 0]),
    )


def test_nulls_stay_in_their_rows(tmp_path):
    made = varied_trials()
    read = read_trial_columns([write_data_set(tmp_path / "set", made)])
    np.testing.assert_array_equal(read.closed_joints, made.closed_joints)
    np.testing.assert_array_equal(read.contact_links, made.contact_links)
    np.testing.assert_array_equal(read.held, made.held)
    assert read.executed.tolist() == [True, False, True, True]
    assert read.success.tolist() == [True, False, False, True]


def test_older_data_sets_have_no_repeats(tmp_path):
    old = write_data_set(tmp_path / "old", varied_trials(), repeated=False)
    new = write_data_set(tmp_path / "new", varied_trials())
    read = read_trial_columns([old, new])
    assert read.repeats.tolist() == [0, 0, 0, 0, 8, 0, 8, 0]


def test_placements_of_one_object_are_told_apart_and_found_again():
    trials = make_trials(
        ["success"] * 4,
        object_name=np.array(["a_0", "a_0", "b_0", "a_0"]),
        placement=np.array([0, 1, 0, 0]),
    )
    key = trials.placement_key
    assert key[0] == key[3]
    assert len(set(key.tolist())) == 3


def test_split_is_that_of_the_seed():
    names = ("tube_000008", "rounded_block_1000000", "pouch_2000000", "tube_000009", "Shampoo")
    assert [split_of(name) for name in names] == ["train", "val", "test", "scans", "scans"]
