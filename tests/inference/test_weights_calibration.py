"""A calibration travels with its weights, is applied by `FFHNet`, and is refused with other weights."""

from pathlib import Path

import numpy as np
import pytest
import torch

from ffhnet.errors import WeightsError
from ffhnet.inference import FFHNet
from ffhnet.inference.calibration import Calibration
from ffhnet.inference.risk import RiskTable
from ffhnet.inference.weights_calibration import (
    CALIBRATION_FILE,
    WeightsCalibration,
    load_calibration,
    save_calibration,
)
from ffhnet.model import CheckpointInfo, FFHEvaluator, FlowGenerator, ModelConfig, save_checkpoint
from ffhnet.perception.observation import Observation, observe_object

MODEL = ModelConfig(num_joints=2, inner_width=16, width=24, palm_points=4, flow_width=24)
INFO = CheckpointInfo("some_hand", ("a", "b"), (0.0, -0.05), (0.05, 0.05), MODEL)
MAPS = WeightsCalibration(
    probability=Calibration(2.0, 2.0, -1.0),
    robustness=Calibration(0.5, 0.5, 0.3),
    risk=RiskTable(np.arange(200) // 2, np.full(200, 0.9), np.ones(200)),
    source="made up",
)


def save_networks(folder: Path, seed: int) -> None:
    torch.manual_seed(seed)
    save_checkpoint(folder, INFO, FlowGenerator(MODEL), FFHEvaluator(MODEL))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_networks(tmp_path, 0)
    return tmp_path


@pytest.fixture
def view() -> Observation:
    cloud = np.random.default_rng(0).uniform(-0.03, 0.03, (900, 3)) + np.array([0, 0, 0.05])
    return observe_object(cloud, np.array([0.0, 0.0, 1.0]), "world")


def test_round_trip(folder: Path):
    assert load_calibration(folder) is None
    save_calibration(folder, MAPS)
    back = load_calibration(folder)
    assert back is not None
    assert (back.probability, back.robustness, back.source) == (
        MAPS.probability,
        MAPS.robustness,
        MAPS.source,
    )
    np.testing.assert_array_equal(back.risk.score, MAPS.risk.score)


def test_network_gives_mapped_probabilities_in_the_same_order(folder: Path, view: Observation):
    plain = FFHNet.from_pretrained(folder, device="cpu").grasp(view, num=40)
    save_calibration(folder, MAPS)
    mapped = FFHNet.from_pretrained(folder, device="cpu").grasp(view, num=40)
    np.testing.assert_allclose(mapped.position, plain.position)
    np.testing.assert_allclose(mapped.probability, MAPS.probability.apply(plain.probability))
    np.testing.assert_allclose(mapped.robustness, MAPS.robustness.apply(plain.robustness))


def test_risk_is_chosen_from_the_record_and_only_with_one(folder: Path):
    with pytest.raises(WeightsError, match="ffhnet calibrate"):
        FFHNet.from_pretrained(folder, device="cpu").control_risk(0.1)
    save_calibration(folder, MAPS)
    control = FFHNet.from_pretrained(folder, device="cpu").control_risk(0.1)
    assert control.refusal(np.array([0.95])) is None
    assert control.threshold is not None
    assert control.threshold <= 0.9


def test_calibration_of_other_weights_and_damaged_ones_are_refused(folder: Path, tmp_path: Path):
    save_calibration(folder, MAPS)
    text = (folder / CALIBRATION_FILE).read_text()
    other = tmp_path / "other"
    save_networks(other, 1)
    (other / CALIBRATION_FILE).write_text(text)
    with pytest.raises(WeightsError, match="made with other weights"):
        FFHNet.from_pretrained(other)
    for damaged in (text[:50], "[]", text.replace('"risk"', '"rusk"'), text.replace('"low"', '"lowest"')):
        (folder / CALIBRATION_FILE).write_text(damaged)
        with pytest.raises(WeightsError, match="calibration"):
            load_calibration(folder)
