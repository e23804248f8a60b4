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


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [("--executed", 0, "--executed"), ("--friction", 0, "above 0"), ("--full-views", -1, "at least 0")],
)
def test_bad_options_are_one_line(ffhnet, option, value, message):
    status, _, err = ffhnet("evaluate", option, value)
    assert status == 2
    assert message in err
    assert len(err.splitlines()) == 1
