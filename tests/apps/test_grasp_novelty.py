"""`ffhnet grasp` says what is unlike all that the networks know, and refuses it where that is wanted."""

import json
import shutil

import numpy as np
import pytest

from ffhnet.inference.calibration import Calibration
from ffhnet.inference.ffhnet import shipped_weights
from ffhnet.inference.novelty import NoveltyLimit
from ffhnet.inference.risk import RiskTable
from ffhnet.inference.weights_calibration import WeightsCalibration, save_calibration


@pytest.fixture
def weights(tmp_path):
    """The package's weights with a limit of novelty to one's liking."""

    def calibrated(limit):
        folder = tmp_path / "weights"
        shutil.copytree(shipped_weights(), folder, dirs_exist_ok=True)
        table = RiskTable(np.arange(4), np.full(4, 0.9), np.ones(4))
        save_calibration(folder, WeightsCalibration(Calibration(), None, table, "made up", limit))
        return folder

    return calibrated


def test_novelty_is_told_and_refused(ffhnet, tmp_path, depth_png, weights):
    out = tmp_path / "grasps.json"
    command = ("grasp", depth_png, "--intrinsics", 600, 600, 320, 240, "--num", 20, "--out", out)

    def grasp(limit, *options):
        status, printed, err = ffhnet(*command, "--weights", weights(limit), *options)
        assert (status, err) == (0, "")
        return printed, json.loads(out.read_text())

    printed, file = grasp(NoveltyLimit(1000.0, 0.01, 500), "--refuse-novel")
    assert "unlike" not in printed
    assert 0 < file["novelty"] < 1

    printed, file = grasp(NoveltyLimit(1e-3, 0.01, 500))
    assert printed.count("unlike anything the networks know") == 1
    assert file["novelty"] > 1
    assert len(file["grasps"]) > 0

    printed, file = grasp(NoveltyLimit(1e-3, 0.01, 500), "--refuse-novel")
    assert "abstained: unlike anything" in printed
    assert file["grasps"] == []
    assert "novelty" in {grasp["reason"] for grasp in file["dropped"]}

    assert "novelty" not in grasp(None)[1]
    status, _, err = ffhnet(*command, "--weights", weights(None), "--refuse-novel")
    assert (status, err.count("\n")) == (2, 1)
    assert "ffhnet calibrate" in err
