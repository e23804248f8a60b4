"""Checkpoints: round trip, 16-bit storage, and every kind of damage."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import torch

from ffhnet.errors import OptionError, WeightsError
from ffhnet.model import (
    CheckpointInfo,
    FFHEvaluator,
    FFHGenerator,
    ModelConfig,
    load_checkpoint,
    save_checkpoint,
)
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.pca import Projection

MODEL = ModelConfig(num_joints=2, bps_size=16, pca_components=4, inner_width=8, width=12, generator="cvae")
INFO = CheckpointInfo("some_hand", ("a", "b"), (0.0, -0.2), (1.0, 0.2), MODEL, training={"note": [1, 2]})


@pytest.fixture
def networks() -> tuple[FFHGenerator, FFHEvaluator]:
    torch.manual_seed(0)
    generator, evaluator = FFHGenerator(MODEL), FFHEvaluator(MODEL)
    rng = np.random.default_rng(0)
    for network in (generator, evaluator):
        network.condition.set_projection(Projection(rng.random(16), rng.normal(size=(16, 4))))
        for buffer in network.buffers():
            if buffer.ndim == 1 and buffer.is_floating_point():
                buffer.copy_(torch.rand(len(buffer)) * 1e-9)
    return generator, evaluator


@pytest.fixture
def folder(tmp_path: Path, networks: tuple[FFHGenerator, FFHEvaluator]) -> Path:
    save_checkpoint(tmp_path / "weights", INFO, *networks)
    return tmp_path / "weights"


def test_round_trip_is_exact(folder: Path, networks: tuple[FFHGenerator, FFHEvaluator]):
    loaded = load_checkpoint(folder, hand="some_hand")
    assert loaded.info == INFO
    for before, after in zip(networks, (loaded.generator, loaded.evaluator), strict=True):
        assert not after.training
        wanted = before.state_dict()
        assert wanted.keys() == after.state_dict().keys()
        for name, tensor in after.state_dict().items():
            assert torch.equal(tensor, wanted[name]), name


def test_a_flow_is_loaded_as_a_flow(tmp_path: Path, networks: tuple[FFHGenerator, FFHEvaluator]):
    model = dataclasses.replace(MODEL, generator="flow", palm_points=6)
    info = dataclasses.replace(INFO, model=model)
    flow, evaluator = FlowGenerator(model), FFHEvaluator(model)
    assert flow.geometry is not None
    flow.geometry.set_points(np.arange(18.0).reshape(6, 3))
    save_checkpoint(tmp_path, info, flow, evaluator)
    loaded = load_checkpoint(tmp_path).generator
    assert isinstance(loaded, FlowGenerator)
    assert loaded.geometry is not None
    torch.testing.assert_close(loaded.geometry.points, flow.geometry.points)


def test_half_precision_halves_matrices_and_keeps_tiny_variances(tmp_path: Path, folder: Path, networks):
    save_checkpoint(tmp_path / "half", INFO, *networks, half=True)
    loaded = load_checkpoint(tmp_path / "half")
    wanted = networks[1].state_dict()
    for name, tensor in loaded.evaluator.state_dict().items():
        assert tensor.dtype == wanted[name].dtype
        stored_half = tensor.ndim >= 2
        # Below 6e-5, 16-bit floats lose relative precision.
        torch.testing.assert_close(
            tensor, wanted[name], rtol=1e-3 if stored_half else 0, atol=6e-8 if stored_half else 0
        )
    full_size = (folder / "evaluator.safetensors").stat().st_size
    assert (tmp_path / "half" / "evaluator.safetensors").stat().st_size < full_size


def test_networks_can_be_saved_one_after_the_other(tmp_path: Path, networks):
    generator, evaluator = networks
    save_checkpoint(tmp_path, dataclasses.replace(INFO, training={"generator": 1}), generator=generator)
    with pytest.raises(WeightsError, match=r"evaluator\.safetensors is missing"):
        load_checkpoint(tmp_path)
    save_checkpoint(tmp_path, dataclasses.replace(INFO, training={"evaluator": 2}), evaluator=evaluator)
    assert load_checkpoint(tmp_path).info.training == {"generator": 1, "evaluator": 2}


def test_a_folder_is_not_shared_by_two_hands(folder: Path, networks):
    other = dataclasses.replace(INFO, hand="other")
    with pytest.raises(WeightsError, match="another hand"):
        save_checkpoint(folder, other, *networks)


def test_weights_of_another_hand(folder: Path):
    with pytest.raises(WeightsError, match=r"wanted weights for hand 'other'.*'some_hand'"):
        load_checkpoint(folder, hand="other")


def test_missing_folder(tmp_path: Path):
    with pytest.raises(WeightsError, match=r"config\.json is missing"):
        load_checkpoint(tmp_path / "nowhere")


@pytest.mark.parametrize("name", ["generator.safetensors", "evaluator.safetensors"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "empty", "remove"])
def test_damaged_weights(folder: Path, name: str, damage: str):
    path = folder / name
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    if damage == "remove":
        path.unlink()
    else:
        path.write_bytes({"truncate": bytes(data[:-7]), "flip": bytes(data), "empty": b""}[damage])
    with pytest.raises(WeightsError, match=name):
        load_checkpoint(folder)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "{}",
        "null",
        '{"format": 1}',
        '{"format": 9}',
        '{"format": 1, "sha256": {}, "model": {}}',
    ],
)
def test_damaged_description(folder: Path, text: str):
    (folder / "config.json").write_text(text)
    with pytest.raises(WeightsError, match=r"config\.json"):
        load_checkpoint(folder)


def test_weights_that_do_not_fit_the_description(folder: Path):
    content = json.loads((folder / "config.json").read_text())
    content["model"]["width"] += 1
    (folder / "config.json").write_text(json.dumps(content))
    with pytest.raises(WeightsError, match="does not fit the architecture"):
        load_checkpoint(folder)


@pytest.mark.parametrize(
    "name", ["width", "flow_width", "palm_points", "links", "link_points", "local_width"]
)
def test_sizes_far_beyond_the_files_are_refused_before_memory_is_taken(folder: Path, name: str):
    content = json.loads((folder / "config.json").read_text())
    content["model"].update({"generator": "flow", "links": 3, "link_points": 2, name: 10_000_000})
    (folder / "config.json").write_text(json.dumps(content))
    with pytest.raises(WeightsError, match="weights, there are at most"):
        load_checkpoint(folder)


@pytest.mark.parametrize(
    ("buffer", "values"),
    [("parent", [0, 2, 0]), ("parent", [0, 0, -1]), ("leader", [0, 2, 0]), ("link", [3, 0])],
)
def test_a_hand_whose_links_do_not_exist_is_refused(tmp_path: Path, networks, buffer: str, values: list[int]):
    model = dataclasses.replace(MODEL, palm_points=6, links=3, link_points=2)
    evaluator = FFHEvaluator(model)
    assert evaluator.geometry is not None
    links = evaluator.geometry.links
    assert links is not None
    save_checkpoint(tmp_path, dataclasses.replace(INFO, model=model), FFHGenerator(model), evaluator)
    load_checkpoint(tmp_path)
    getattr(links, buffer).copy_(torch.tensor(values))
    save_checkpoint(tmp_path, dataclasses.replace(INFO, model=model), evaluator=evaluator)
    with pytest.raises(WeightsError, match=r"evaluator\.safetensors describes no hand"):
        load_checkpoint(tmp_path)


def test_limits_must_fit_the_joints():
    with pytest.raises(OptionError, match="1 lower"):
        dataclasses.replace(INFO, joint_lower=(0.0,))
