"""A hand of one's own, the one in examples/data: what a check finds, and the way from data to grasps."""

import json
import shutil
from pathlib import Path

import pytest

from ffhnet.apps import cli
from ffhnet.apps.hand_option import for_workers
from ffhnet.errors import OptionError, WeightsError
from ffhnet.hands import DEFAULT_HAND, load_hand
from ffhnet.inference.ffhnet import find_weights

EXAMPLES = Path(__file__).parents[2] / "examples" / "data"
DEPTH = EXAMPLES / "jar_2000004_depth.png"


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(EXAMPLES / "three_fingers", tmp_path / "hand")
    load_hand.cache_clear()
    return tmp_path / "hand"


def check(folder, capsys) -> str:
    cli.main(["hand", "check", str(folder / "hand.toml")])
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("hand.xml", '<position name="left_pip" joint="left_pip"/>', "", "actuator has the name of left_pip"),
        ("hand.xml", 'conaffinity="1"', 'conaffinity="0"', "objects pass through palm, left_proximal"),
        ("hand.toml", "-1.5708", "1.5708", "x has to point to the object"),
        ("hand.toml", "[0.0, -1.5708, 0.0]", "[3.1416, -1.5708, 0.0]", "the thumb is on the side of +z"),
        ("hand.xml", 'axis="0 1 0"', 'axis="0 -1 0"', "closing takes the fingertips apart"),
        ("hand.xml", 'pos="0.045 0 0.02"', 'pos="-0.04 0.028 0.02"', "the open hand touches itself: left_"),
    ],
)
def test_check_finds_what_would_spoil_trials(folder, capsys, file, old, new, said):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    assert said in check(folder, capsys)


def test_check_finds_nothing_in_the_example(folder, capsys):
    assert "to be mended" not in check(folder, capsys)


def test_another_hand_than_that_of_the_data_is_refused(folder):
    with pytest.raises(OptionError, match="for 'dlr_hit_ii'"):
        for_workers(str(folder / "hand.toml"), "dlr_hit_ii")


def test_no_weights_ship_for_a_hand_of_ones_own():
    with pytest.raises(WeightsError, match="no weights for the hand 'three_fingers'"):
        find_weights(None, "three_fingers")
    assert find_weights(None, DEFAULT_HAND) == find_weights(None)


def test_from_data_to_grasps(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hand = ["--hand", "hand/hand.toml"]
    few = ["--count", "2", "--placements", "1", "--views", "2", "--heuristic", "12", "--power", "2"]
    cli.main(["generate", "data", *hand, *few, "--perturb", "6", "--workers", "1"])
    assert json.loads((tmp_path / "data" / "dataset.json").read_text())["hand"] == "three_fingers"
    weights = tmp_path / "weights"
    cli.main(
        ["train", "data", *hand, "--out", "weights", "--preset", "small", "--steps", "2", "--threads", "1"]
    )
    assert sum((weights / f"{name}.safetensors").stat().st_size for name in ("generator", "evaluator")) < 3e6
    tried = ["--objects", "jar_2000004", "--placements", "1", "--samples", "8", "--heuristic", "2"]
    cli.main(["evaluate", *hand, "--weights", "weights", *tried, "--workers", "1", "--json", "out.json"])
    assert json.loads((tmp_path / "out.json").read_text())["total"]["thresholds"]["0.0"]["executed"] == 8
    camera = ["--intrinsics", "615", "615", "320", "240"]
    wanted = ["--weights", "weights", "--no-feasibility", "--num", "20", "--out", "grasps.json"]
    cli.main(["grasp", str(DEPTH), *camera, *hand, *wanted])
    assert json.loads((tmp_path / "grasps.json").read_text())["joint_names"][0] == "left_mcp"
