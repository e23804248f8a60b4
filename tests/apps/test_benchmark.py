"""`ffhnet benchmark` measures what it says and writes the report of the contract; no test looks at a time."""

import json

import pytest

from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.perception import bps


def test_ways_take_turns_and_the_first_rounds_do_not_count():
    calls = []
    times = Clock(3).in_turns({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")})
    assert calls == ["a", "b"] * 5
    assert [len(times[name].ms) for name in "ab"] == [3, 3]


def test_clock_is_the_given_one():
    ticks = iter([0.0, 0.5, 2.0, 5.0])
    assert Clock(1, lambda: next(ticks)).in_turns({"a": lambda: None}, warm_up=1)["a"].ms == (3000.0,)


def test_factor_is_the_median_within_rounds():
    slow, quick = Times((10.0, 40.0, 90.0)), Times((5.0, 10.0, 10.0))
    assert quick.times_faster(slow) == 4
    assert slow.to_json()["median"] == 40
    assert slow.to_json()["fastest"] == 10
    assert Times((7.0,)).to_json() == {"median": 7, "quartile_1": 7, "quartile_3": 7, "fastest": 7}


@pytest.fixture
def speed(ffhnet, untrained_weights, tmp_path, monkeypatch):
    """Run parts of the benchmark, as small as they go: what it prints, and its report."""
    monkeypatch.setattr(bps, "_encode", bps._encode)

    def run(*parts):
        sizes = ("--grasps", 4, "--rounds", 1, "--counts", 1, 3, "--points", 60, "--threads", 1)
        file = tmp_path / "report.json"
        status, printed, err = ffhnet(
            "benchmark", "--only", *parts, *sizes, "--weights", untrained_weights, "--json", file
        )
        assert (status, err) == (0, "")
        return printed, json.loads(file.read_text())

    return run


def test_report_of_the_networks(speed):
    printed, report = speed("inference", "gpu")
    inference = report["inference"]
    assert min(inference[name] for name in ("published_ms", "plain_ms", "engine_ms", "realtime_ms")) > 0
    # The untrained networks of this test are too small for it.
    assert inference["reduced_ms"] is None
    assert "skipped" in printed
    assert 0 <= inference["largest_difference"] < 1e-4
    assert [row["grasps"] for row in inference["curve"]] == [1, 3]
    assert {"skipped"} == set(report["gpu"]) or report["gpu"]["engine_ms"] > 0
    assert report["machine"]["torch"]


def test_report_of_perception_and_training(speed):
    _, report = speed("perception", "training")
    inference, perception = report["inference"], report["perception"]
    assert set(inference) == {"bps_ms", "whole_ms", "realtime_whole_ms", "reduced_whole_ms"}
    assert min(inference["whole_ms"], inference["realtime_whole_ms"]) > inference["bps_ms"] > 0
    assert [row["weights"] for row in perception["tracking"]] == ["engine"] * 4 + ["realtime"] * 4
    stages = perception["stages"]
    assert perception["depth_to_observation_ms"] > stages["plane"]["fastest"]
    assert stages["realtime: depth_to_feasible"]["fastest"] > stages["depth_to_observation"]["fastest"]
    assert [row["points"] for row in perception["encodings"]] == [60]
    assert min(report["training"].values()) > 0


def test_refusals(ffhnet):
    assert ffhnet("benchmark", "--rounds", 0)[0] == 2
    assert ffhnet("benchmark", "--only", "gravity")[0] == 2
