"""A whole evaluation of one object, through the command."""

import json

import pytest

ARGUMENTS = (
    "evaluate",
    *("--objects", "thin_box_2000008", "--placements", 2, "--poses", "all", "--samples", 12),
    *("--executed", 4, "--heuristic", 1, "--stress", "--strict", "--density", 200),
)


def test_evaluation_of_one_object(ffhnet, untrained_weights, tmp_path):
    """All that was asked for is there, and neither the number of workers nor a second run changes it."""
    texts = []
    for workers in (1, 2):
        path = tmp_path / f"{workers}.json"
        files = ("--json", path) if workers == 1 else ("--json", path, "--html", tmp_path / "report.html")
        status, out, err = ffhnet(*ARGUMENTS, "--weights", untrained_weights, "--workers", workers, *files)
        assert (status, err) == (0, "")
        texts.append(path.read_text())
    assert texts[0] == texts[1]
    assert "Table I" in out
    assert "blind, short side" in out
    content = json.loads(texts[0])
    assert content["protocol"]["density"] == 200
    total = content["total"]
    assert total["placements"] == 2
    assert content["standing"]["placements"] == content["other"]["placements"] == 1
    assert total["thresholds"]["0.0"]["executed"] == 8
    assert total["coverage"]["full_views"] == 1
    conditions = total["conditions"]
    assert list(conditions) == ["nominal", "friction", "mass", "pose", "all", "strict", "strict, held"]
    assert conditions["all"]["top"]["executed"] == 10
    assert conditions["strict"]["top"]["executed"] == 20
    for condition in conditions.values():
        assert condition["blind_random_yaw"]["executed"] == condition["blind_short_side"]["executed"] == 2
    text = (tmp_path / "report.html").read_text()
    assert "Strict protocol" in text
    assert text.count("<img") == 3


def test_the_arm_lifts_an_object_that_it_knows_from_a_depth_image_only(ffhnet, tmp_path):
    path = tmp_path / "arm.json"
    settings = ("--objects", "spray_flask_2000005", "--placements", 1, "--samples", 30, "--workers", 1)
    status, out, err = ffhnet("evaluate", "--protocol", "arm", *settings, "--json", path)
    assert (status, err) == (0, "")
    assert "hand touches no table before closing" in out
    content = json.loads(path.read_text())
    assert content["results"] == {"success": 1}
    assert content["scenes"][0]["rise"] > 0.15


ARM = ("--protocol", "arm", "--objects", "procedural-test:3")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--executed", 0), "--executed"),
        (("--friction", 0), "above 0"),
        (("--full-views", -1), "at least 0"),
        ((*ARM, "--neighbours", 30), "--neighbours must be from 0 to 2"),
    ],
)
def test_bad_options_are_one_line(ffhnet, options, message):
    status, _, err = ffhnet("evaluate", *options)
    assert status == 2
    assert message in err
    assert len(err.splitlines()) == 1
