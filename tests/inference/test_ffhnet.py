"""`FFHNet`: ranking, frames, limits, determinism and refusals, with untrained networks."""

import weakref
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ffhnet.errors import HandError, OptionError, WeightsError
from ffhnet.geometry.rotations import matrix_from_euler_xyz
from ffhnet.geometry.transforms import make_transform
from ffhnet.inference import FFHNet
from ffhnet.inference import ffhnet as ffhnet_module
from ffhnet.model import CheckpointInfo, FFHEvaluator, FFHGenerator, ModelConfig, save_checkpoint
from ffhnet.model.checkpoint import Checkpoint
from ffhnet.model.pca import Projection

torch.set_num_threads(1)
MODEL = ModelConfig(num_joints=2, bps_size=32, pca_components=4, inner_width=16, width=24, generator="cvae")
INFO = CheckpointInfo("some_hand", ("a", "b"), (0.0, -0.05), (0.05, 0.05), MODEL)


@dataclass(frozen=True)
class View:
    """The part of an observation that the networks need."""

    bps: np.ndarray
    table_height: float
    T_input_view: np.ndarray
    frame: str = "camera"


@pytest.fixture
def checkpoint() -> Checkpoint:
    torch.manual_seed(0)
    generator, evaluator = FFHGenerator(MODEL).eval(), FFHEvaluator(MODEL).eval()
    rng = np.random.default_rng(0)
    for network in (generator, evaluator):
        network.condition.set_projection(Projection(rng.random(32), rng.normal(size=(32, 4))))
    torch.nn.init.normal_(evaluator.head.weight, std=0.5)
    return Checkpoint(INFO, generator, evaluator)


@pytest.fixture
def net(checkpoint: Checkpoint) -> FFHNet:
    return FFHNet(checkpoint)


@pytest.fixture
def view() -> View:
    T = make_transform(matrix_from_euler_xyz(np.array([0.4, -0.2, 1.0])), np.array([0.3, -0.1, 0.8]))
    return View(np.random.default_rng(1).random(32), -0.06, T)


def test_grasps_are_ranked_and_complete(net: FFHNet, view: View):
    grasps = net.grasp(view, num=200)
    assert len(grasps) == 200
    assert (grasps.frame, grasps.hand, grasps.joint_names) == ("camera", "some_hand", ("a", "b"))
    assert (np.diff(grasps.robustness) <= 0).all()
    assert grasps.robustness[0] > grasps.robustness[-1]
    product = grasps.rotation @ np.swapaxes(grasps.rotation, 1, 2)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-5)
    np.testing.assert_allclose(np.linalg.det(grasps.rotation), 1, atol=1e-5)


def test_joints_are_clipped_to_the_limits(net: FFHNet, view: View):
    joints = net.grasp(view, num=3000).joints
    assert (joints >= INFO.joint_lower).all()
    assert (joints <= INFO.joint_upper).all()
    assert (joints == INFO.joint_upper).any()
    assert ((joints > INFO.joint_lower) & (joints < INFO.joint_upper)).any()


def test_moving_the_input_frame_moves_the_grasps(net: FFHNet, view: View):
    T = make_transform(matrix_from_euler_xyz(np.array([-1.0, 0.5, 2.0])), np.array([1.0, 2.0, -0.5]))
    before = net.grasp(view, num=50)
    after = net.grasp(replace(view, T_input_view=T @ view.T_input_view, frame="world"), num=50)
    wanted = before.to_frame(T, "world")
    np.testing.assert_allclose(after.position, wanted.position, atol=1e-9)
    np.testing.assert_allclose(after.rotation, wanted.rotation, atol=1e-9)
    np.testing.assert_array_equal(after.probability, before.probability)


def test_input_frame_is_the_view_frame_taken_through_t_input_view(net: FFHNet, view: View):
    raw = net.generate(view, 50, torch.Generator().manual_seed(7))
    assert raw.frame == "view"
    assert raw.probability is None
    ranked = net.grasp(view, num=50, seed=7)
    homogeneous = np.c_[raw.position, np.ones(50)] @ view.T_input_view.T
    assert {tuple(p) for p in homogeneous[:, :3].round(9)} == {tuple(p) for p in ranked.position.round(9)}


def test_evaluate_agrees_with_grasp_in_any_order(net: FFHNet, view: View):
    grasps = net.grasp(view, num=60)
    order = np.random.default_rng(0).permutation(60)
    np.testing.assert_allclose(
        net.evaluate(view, grasps[order]).probability, grasps.probability[order], atol=1e-5
    )


def test_an_observation_is_looked_at_once_and_then_forgotten(
    net: FFHNet, view: View, monkeypatch: pytest.MonkeyPatch
):
    looked = []
    look = net._look_anew
    monkeypatch.setattr(net, "_look_anew", lambda observation: looked.append(0) or look(observation))
    first, other = net.grasp(view, num=9), replace(view, table_height=view.table_height - 0.05)
    net.evaluate(view, first)
    assert len(looked) == 1
    moved = net.grasp(other, num=9)
    assert np.abs(moved.position - first.position).max() > 1e-6
    np.testing.assert_array_equal(net.grasp(view, num=9).position, first.position)
    assert len(looked) == 3
    reference = weakref.ref(other)
    net.grasp(other, num=9)
    del other
    assert reference() is None


def test_a_higher_temperature_spreads_the_samples(net: FFHNet, view: View):
    usual, own, wide = (
        net.grasp(view, num=200, temperature=t) for t in (None, net.info.model.temperature, 1.4)
    )
    np.testing.assert_array_equal(usual.position, own.position)
    assert wide.position.std(axis=0).sum() > 1.1 * usual.position.std(axis=0).sum()


def test_threshold_keeps_the_best(net: FFHNet, view: View):
    every = net.grasp(view, num=100)
    middle = float(every.probability[40])
    kept = net.grasp(view, num=100, threshold=middle)
    np.testing.assert_array_equal(kept.position, every.position[every.probability >= middle])
    assert len(net.grasp(view, num=100, threshold=1.0)) == 0


def test_seed_decides(net: FFHNet, view: View):
    first, again, other = (net.grasp(view, num=20, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.position, again.position)
    assert not np.array_equal(first.position, other.position)


def test_refusals(net: FFHNet, view: View):
    grasps = net.grasp(view, num=3)
    with pytest.raises(HandError, match="some_hand"):
        net.evaluate(view, grasps.replace(hand="other"))
    with pytest.raises(OptionError, match="frame 'camera', got 'world'"):
        net.evaluate(view, grasps.replace(frame="world"))
    with pytest.raises(OptionError, match="32 BPS values"):
        net.grasp(replace(view, bps=np.zeros(31)))
    with pytest.raises(OptionError, match="at least 1, got 0"):
        net.grasp(view, num=0)
    with pytest.raises(OptionError, match="between 0 and 1"):
        net.grasp(view, threshold=1.5)
    for temperature in (0.0, -1.0, 2.5, float("nan")):
        with pytest.raises(OptionError, match="wanted a temperature"):
            net.grasp(view, temperature=temperature)


def test_from_pretrained(tmp_path: Path, checkpoint: Checkpoint, net: FFHNet, view: View):
    save_checkpoint(tmp_path, INFO, checkpoint.generator, checkpoint.evaluator)
    loaded = FFHNet.from_pretrained(tmp_path, hand="some_hand", device="cpu")
    np.testing.assert_array_equal(loaded.grasp(view, num=20).position, net.grasp(view, num=20).position)
    with pytest.raises(WeightsError, match="other"):
        FFHNet.from_pretrained(tmp_path, hand="other")
    with pytest.raises(WeightsError, match="no_such_name"):
        FFHNet.from_pretrained("no_such_name")


def test_without_a_path_the_packages_weights_are_taken(
    tmp_path: Path, checkpoint: Checkpoint, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(ffhnet_module.resources, "files", lambda package: tmp_path)
    with pytest.raises(WeightsError, match=r"config\.json is missing"):
        FFHNet.from_pretrained()
    save_checkpoint(tmp_path / "weights", INFO, checkpoint.generator, checkpoint.evaluator)
    save_checkpoint(tmp_path / "weights" / "named", INFO, checkpoint.generator, checkpoint.evaluator)
    assert FFHNet.from_pretrained().info == INFO
    assert FFHNet.from_pretrained("named").info == INFO


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_gives_the_same_grasps(checkpoint: Checkpoint, view: View):
    on_cpu = FFHNet(checkpoint).grasp(view, num=50)
    on_gpu = FFHNet(checkpoint, "cuda").grasp(view, num=50)
    np.testing.assert_allclose(on_gpu.probability, on_cpu.probability, atol=1e-3)
