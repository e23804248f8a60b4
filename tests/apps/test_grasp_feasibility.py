"""`ffhnet grasp` gives grasps that can be done, and says why the others cannot."""

import numpy as np
import pytest

from ffhnet.feasibility.arm import JOINT_NAMES
from ffhnet.grasps_file import load_plan
from ffhnet.hands import load_hand

INTRINSICS = ("--intrinsics", 615, 615, 320, 240)


@pytest.fixture(scope="module")
def example(request):
    return request.config.rootpath / "examples" / "data" / "spray_flask_2000005_depth.png"


def test_kept_and_dropped_are_all_samples(ffhnet, tmp_path, depth_png, untrained_weights):
    """Untrained networks put palms everywhere, under the table too."""
    arguments = ("grasp", depth_png, *INTRINSICS, "--weights", untrained_weights, "--num", 60)
    assert ffhnet(*arguments, "--no-feasibility", "--out", tmp_path / "all.npz")[0] == 0
    status, printed, err = ffhnet(*arguments, "--out", tmp_path / "checked.npz")
    assert (status, err) == (0, "")
    everything, plan = load_plan(tmp_path / "all.npz"), load_plan(tmp_path / "checked.npz")
    assert (len(everything.grasps), len(everything.dropped)) == (60, 0)
    positions = np.concatenate([plan.grasps.position, plan.dropped.position])
    assert {tuple(row) for row in everything.grasps.position} <= {tuple(row) for row in positions}
    assert plan.dropped.score.tolist() == sorted(plan.dropped.score, reverse=True)
    counted = ", ".join(f"{count} {reason}" for reason, count in plan.counts.items())
    assert f"{len(plan.grasps)} of {len(positions)} grasps are feasible; dropped: {counted}" in printed


def test_the_arm_reaches_what_comes_out(ffhnet, tmp_path, example):
    out = tmp_path / "plan.json"
    arguments = ("grasp", example, *INTRINSICS, "--robot", "panda", "--num", 60, "--out", out)
    status, _, err = ffhnet(*arguments, "--base", 0, 0.3, 0, -0.4)
    assert (status, err) == (0, "")
    plan = load_plan(out)
    assert len(plan.grasps) >= 10
    assert plan.arm.joint_names == JOINT_NAMES
    assert plan.arm.approach.shape[0] == len(plan.grasps)
    assert np.isfinite(plan.arm.approach).all()
    assert plan.preshape.shape == (len(plan.grasps), load_hand().num_joints)
    # Nobody reaches three metres.
    status, printed, _ = ffhnet(*arguments, "--base", 3, 3, 0, 0)
    assert status == 0
    assert "unreachable" in printed
    assert len(load_plan(out).grasps) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--robot", "panda"), "--base"),
        (("--base", 0, 0, 0, 0), "--robot"),
        (("--robot", "panda", "--base", 0, 0, 0, 0, "--no-feasibility"), "--no-feasibility"),
    ],
)
def test_options_that_do_not_go_together(ffhnet, example, options, message):
    status, _, err = ffhnet("grasp", example, *INTRINSICS, *options)
    assert status == 2
    assert err.count("\n") == 1
    assert message in err
