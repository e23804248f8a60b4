"""The data card says what the files hold."""

import numpy as np
import pytest
from trial_makers import make_trials, write_data_set

from ffhnet.dataset.card import data_card
from ffhnet.errors import DatasetError


def rows(card, first):
    """Cells of the rows that start with `first`."""
    lines = [line for line in card.splitlines() if line.startswith(f"| {first} |")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@pytest.fixture
def train(tmp_path):
    trials = make_trials(
        ["success"] * 3 + ["missed"] + ["collision"] * 2 + ["slipped"],
        object_name=np.array(["tube_000008"] * 4 + ["bottle_000000"] * 3),
        repeats=np.array([4, 4, 0, 4, 0, 0, 0]),
        held=np.array([4, 1, 0, 0, 0, 0, 0]),
    )
    return write_data_set(tmp_path / "first", trials, versions={"mujoco": "1.2.3"})


def test_counts(train):
    card = data_card([train])
    assert rows(card, "`first`") == [["`first`", "train", "2", "0 to 8", "2", "6", "5", "3", "2"]]
    assert rows(card, "tube") == [["tube", "1", "4", "75.0% (30.1% to 95.4%)"]]
    assert rows(card, "bottle")[0][2:] == ["1", "0.0% (0.0% to 79.3%)"]
    assert rows(card, "power") == [["power", "5", "60.0% (23.1% to 88.2%)", "3", "2", "1", "1", "0", "0"]]


def test_every_table_is_as_wide_as_its_heading(train):
    widths = {}
    for block in data_card([train]).split("\n\n"):
        if block.startswith("|"):
            widths[block] = {line.count("|") for line in block.strip().splitlines() if line.startswith("|")}
    assert len(widths) >= 4
    assert all(len(width) == 1 for width in widths.values())


def test_robustness_of_repeated_trials(train):
    card = data_card([train])
    assert rows(card, "success")[0] == ["success", "2", "0.625", "0.0%", "50.0%", "0.0%", "50.0%"]
    assert rows(card, "failure")[0] == ["failure", "1", "0.000", "100.0%", "0.0%", "0.0%", "0.0%"]


def test_settings_versions_and_commands(train):
    card = data_card([train], ["ffhnet generate data/first --count 2"])
    assert rows(card, "seed") == [["seed", "7"]]
    assert rows(card, "version of mujoco") == [["version of mujoco", "1.2.3"]]
    assert rows(card, "version of numpy") == [["version of numpy", "not recorded"]]
    assert "```\nffhnet generate data/first --count 2\n```" in card
    assert "risen at least 15 cm" in card
    assert "Apache-2.0" in card


def test_splits_are_kept_apart(train, tmp_path):
    other = make_trials(["success", "dropped"], object_name=np.array(["rounded_block_1000000"] * 2))
    card = data_card([train, write_data_set(tmp_path / "second", other, repeated=False)])
    assert "## Split `train`" in card
    assert "no trial was repeated" in card
    assert rows(card, "rounded_block") == [["rounded_block", "1", "2", "50.0% (9.5% to 90.5%)"]]
    assert [row[1] for row in rows(card, "power")] == ["5", "2"]


def test_no_data_set(tmp_path):
    with pytest.raises(DatasetError, match="at least one"):
        data_card([])
    with pytest.raises(DatasetError, match="no data set"):
        data_card([tmp_path])
