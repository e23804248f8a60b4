"""`ffhnet calibrate` from trials to a file that `ffhnet grasp --max-failure` uses."""

import json
import shutil

from ffhnet.inference.weights_calibration import CALIBRATION_FILE

SMALL = ("--objects", "procedural-val:4", "--first", 0, "--fit", 2, "--views", 1, "--samples", 6)


def test_calibrate_and_abstain(ffhnet, tmp_path, depth_png, untrained_weights):
    contents = []
    for workers in (1, 2):
        weights = tmp_path / f"weights_{workers}"
        shutil.copytree(untrained_weights, weights)
        status, printed, err = ffhnet("calibrate", weights, *SMALL, "--executed", 2, "--workers", workers)
        assert (status, err) == (0, "")
        assert "cannot be promised from 2 objects" in printed
        contents.append((weights / CALIBRATION_FILE).read_text())
    assert contents[0] == contents[1]
    assert len(json.loads(contents[0])["risk"]["score"]) == 2

    out = tmp_path / "grasps.json"
    scene = ("grasp", depth_png, "--intrinsics", 600, 600, 320, 240)
    status, printed, err = ffhnet(*scene, "--weights", weights, "--max-failure", 0.1, "--out", out)
    assert (status, err) == (0, "")
    assert "abstained: no threshold promises at most 10.0% failures" in printed
    assert json.loads(out.read_text())["grasps"] == []


def test_bad_input(ffhnet, untrained_weights, depth_png):
    status, _, err = ffhnet("calibrate", untrained_weights, *SMALL, "--fit", 4)
    assert (status, err.count("\n")) == (2, 1)
    assert "--fit must leave 2" in err
    status, _, err = ffhnet(
        "grasp", depth_png, "--intrinsics", 600, 600, 320, 240, "--weights", untrained_weights,
        "--max-failure", 0.1,
    )  # fmt: skip
    assert (status, err.count("\n")) == (2, 1)
    assert "ffhnet calibrate" in err
