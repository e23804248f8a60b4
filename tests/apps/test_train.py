"""`ffhnet train`, `refine` and `distil`: from a data set to weights that `ffhnet grasp` takes."""

import json
from pathlib import Path

import pytest

DATA = Path(__file__).parents[2] / "data" / "val0"
FEW = ("--steps", 2, "--threads", 1, "--device", "cpu")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    return tmp_path_factory.mktemp("trained") / "weights"


def test_train_refine_distil_and_grasp(ffhnet, trained, tmp_path, depth_png):
    status, printed, err = ffhnet("train", DATA, "--val", DATA, "--out", trained, *FEW)
    assert (status, err) == (0, "")
    assert printed.startswith("24 objects, ")
    assert "velocity_error" in printed
    assert "auroc" in printed
    # A finished run is not trained again.
    before = (trained / "generator.safetensors").read_bytes()
    assert ffhnet("train", DATA, "--out", trained, *FEW)[0] == 0
    assert (trained / "generator.safetensors").read_bytes() == before

    refined = tmp_path / "refined"
    status, _, err = ffhnet(
        *("refine", DATA, "--weights", trained, "--out", refined),
        *("--temperature", 0.9, "--solver", "adams", *FEW),
    )
    assert (status, err) == (0, "")
    model = json.loads((refined / "config.json").read_text())["model"]
    assert (model["temperature"], model["flow_solver"]) == (0.9, "adams")
    assert (refined / "evaluator.safetensors").read_bytes() == (
        trained / "evaluator.safetensors"
    ).read_bytes()
    assert (refined / "generator.safetensors").read_bytes() != before

    small = tmp_path / "small"
    distil = ("distil", DATA, "--weights", trained, "--out", small, "--guidance", 0.5)
    status, _, err = ffhnet(*distil, *FEW)
    assert (status, err) == (0, "")
    assert json.loads((small / "config.json").read_text())["model"]["flow_steps"] == 2
    for name in ("generator.safetensors", "evaluator.safetensors"):
        assert (small / name).stat().st_size < 0.5 * (trained / name).stat().st_size

    for weights in (trained, refined, small):
        out = tmp_path / "grasps.json"
        # What hardly trained networks propose need not be feasible.
        scene = ("grasp", depth_png, "--intrinsics", 600, 600, 320, 240, "--num", 5, "--no-feasibility")
        assert ffhnet(*scene, "--weights", weights, "--out", out)[0] == 0
        assert len(json.loads(out.read_text())["grasps"]) == 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("train", DATA, "--steps", 0), "--threads and --steps must be at least 1"),
        (("train", "nowhere"), "nowhere"),
        (("refine", DATA, "--weights", "nowhere"), "no weights in nowhere"),
        (("refine", DATA, "--weights", "nowhere", "--belief", -1), "--belief is a power of at least 0"),
        (("distil", DATA, "--weights", "nowhere"), "no weights in nowhere"),
        (("distil", DATA, "--weights", "nowhere", "--guidance", -1), "--guidance at least 0"),
    ],
)
def test_bad_input(ffhnet, tmp_path, arguments, message):
    status, _, err = ffhnet(*arguments, "--out", tmp_path / "weights")
    assert (status, err.count("\n")) == (2, 1)
    assert message in err
    assert not (tmp_path / "weights").exists()


def test_a_cvae_can_be_neither_refined_nor_distilled(ffhnet, tmp_path):
    weights = tmp_path / "cvae"
    assert ffhnet("train", DATA, "--generator", "cvae", "--out", weights, *FEW)[0] == 0
    for command in ("refine", "distil"):
        status, _, err = ffhnet(command, DATA, "--weights", weights, "--out", tmp_path / "new", *FEW)
        assert (status, err.count("\n")) == (2, 1)
        assert "holds a cvae" in err
