"""The exported networks in ONNX Runtime against `FFHNet`, for every kind of network."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from test_engine import CONFIGS, make_checkpoint, make_grasps, make_objects

from ffhnet.errors import OptionError
from ffhnet.inference.calibration import Calibration
from ffhnet.inference.onnx_export import export_onnx
from ffhnet.inference.onnx_networks import OnnxEvaluator, _probability
from ffhnet.model.checkpoint import Checkpoint, save_checkpoint

pytest.importorskip("onnx", reason="the extra `onnx` brings it")
onnxruntime = pytest.importorskip("onnxruntime", reason="the extra `onnx` brings it")

SHORT = replace(CONFIGS["blind flow"], flow_steps=1)
MODELS = {"blind flow": SHORT, **{name: CONFIGS[name] for name in ("student", "no table", "raw with table")}}
"""Few steps, because each takes a while to record."""


def save(checkpoint: Checkpoint, folder: Path) -> Path:
    save_checkpoint(folder, checkpoint.info, checkpoint.generator, checkpoint.evaluator)
    return folder


def run(file: Path, **inputs: np.ndarray) -> dict[str, np.ndarray]:
    session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
    wanted = {entry.name: inputs[entry.name].astype(np.float32) for entry in session.get_inputs()}
    outputs = [entry.name for entry in session.get_outputs()]
    return dict(zip(outputs, session.run(None, wanted), strict=True))


@pytest.mark.parametrize("name", MODELS)
def test_same_answers_as_the_networks(name: str, tmp_path: Path):
    config = MODELS[name]
    checkpoint, objects = make_checkpoint(config), make_objects(config)
    files = export_onnx(save(checkpoint, tmp_path / "weights"), tmp_path / "onnx")
    seen = {"bps": objects.bps[0].numpy(), "table_height": objects.table_height.numpy()}
    description = json.loads(files.description.read_text())
    width = description["generator.onnx"]["inputs"]["noise"]["shape"][1]
    # Other numbers of grasps than the one that was recorded.
    for num in (1, 50):
        noise = torch.randn(1, num, width, generator=torch.Generator().manual_seed(3))
        with torch.inference_mode():
            wanted = checkpoint.generator.sample(objects, num, torch.Generator().manual_seed(3))
        got = run(files.generator, noise=noise[0].numpy(), **seen)
        np.testing.assert_allclose(got["rotation"], wanted.rotation[0], atol=1e-5)
        np.testing.assert_allclose(got["position"], wanted.position[0], atol=1e-5)
        np.testing.assert_allclose(got["joints"], wanted.joints[0].clamp(-1, 1), atol=1e-5)
    anywhere = make_grasps(config, 60)
    with torch.inference_mode():
        logits = checkpoint.evaluator(objects, anywhere)
    parts = {key: part[0].numpy() for key, part in vars(anywhere).items()}
    rated = run(files.evaluator, **seen, **parts)
    np.testing.assert_allclose(rated["probability"], logits.success[0].sigmoid(), atol=1e-5)
    assert ("robustness" in rated) == config.judge_robustness
    if config.judge_robustness:
        np.testing.assert_allclose(rated["robustness"], logits.robust[0].sigmoid(), atol=1e-5)
        assert np.std(rated["robustness"]) > 0.01


def test_description_says_what_the_files_take(tmp_path: Path):
    checkpoint = make_checkpoint(MODELS["no table"])
    files = export_onnx(save(checkpoint, tmp_path / "weights"), tmp_path / "onnx")
    description = json.loads(files.description.read_text())
    assert description["joint_names"] == list(checkpoint.info.joint_names)
    for file in (files.generator, files.evaluator):
        session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
        for kind, entries in (("inputs", session.get_inputs()), ("outputs", session.get_outputs())):
            assert {e.name: e.shape for e in entries} == {
                name: entry["shape"] for name, entry in description[file.name][kind].items()
            }


def test_probabilities_are_calibrated_as_elsewhere():
    calibration = Calibration(0.7, 1.3, -0.4)
    logit = torch.linspace(-30, 30, 101)
    wanted = calibration.apply(logit.double().sigmoid().numpy())
    np.testing.assert_allclose(_probability(logit, calibration), wanted, atol=1e-6)
    np.testing.assert_allclose(_probability(logit, None), logit.sigmoid())


def test_each_probability_gets_its_own_calibration():
    config = CONFIGS["default"]
    objects, grasps = make_objects(config), make_grasps(config, 30)
    success, robust = Calibration(0.5, 0.5, 1.0), Calibration(2.0, 2.0, -1.0)
    inputs = objects.bps[0], objects.table_height, grasps.rotation[0], grasps.position[0], grasps.joints[0]
    with torch.inference_mode():
        plain = OnnxEvaluator(make_checkpoint(config).evaluator, None, None)(*inputs)
        told = OnnxEvaluator(make_checkpoint(config).evaluator, success, robust)(*inputs)
    np.testing.assert_allclose(told[0], success.apply(plain[0].numpy()), atol=1e-6)
    np.testing.assert_allclose(told[1], robust.apply(plain[1].numpy()), atol=1e-6)


def test_folder_that_is_a_file(tmp_path: Path):
    (tmp_path / "onnx").touch()
    weights = save(make_checkpoint(MODELS["no table"]), tmp_path / "weights")
    with pytest.raises(OptionError, match="cannot make the folder"):
        export_onnx(weights, tmp_path / "onnx")
