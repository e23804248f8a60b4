"""The arm's kinematics: our table against MuJoCo's tree, and closed-form solutions against our table."""

import mujoco
import numpy as np
import pytest

from ffhnet.simulation.panda import kinematics
from ffhnet.simulation.panda.kinematics import LOWER, UPPER, forward, inverse, reaches, refine, within_limits

MODEL = kinematics.__file__.replace("kinematics.py", "panda.xml")


def random_joints(count, seed=0):
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (count, 7))


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(MODEL)


def test_forward_agrees_with_the_model(model):
    data, flange = mujoco.MjData(model), model.body("flange").id
    for q, T_base_flange in zip(random_joints(200), forward(random_joints(200)), strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.xpos[flange], T_base_flange[:3, 3], atol=1e-6)
        np.testing.assert_allclose(data.xmat[flange].reshape(3, 3), T_base_flange[:3, :3], atol=1e-6)


def test_limits_agree_with_the_model(model):
    np.testing.assert_allclose(model.jnt_range, np.stack([LOWER, UPPER], axis=1))
    assert within_limits((LOWER + UPPER) / 2)
    assert not within_limits(UPPER + 0.01 * np.eye(7)).any()
    assert not within_limits(np.full(7, np.nan))


def test_flange_of_the_stretched_arm_is_where_the_data_sheet_says():
    """Straight up: 333 + 316 + 384 mm, then the flange hangs 107 mm down, 88 mm in front."""
    height = 0.333 + 0.316 + 0.384 - 0.107
    np.testing.assert_allclose(forward(np.zeros(7))[:3, 3], [0.088, 0.0, height], atol=1e-12)


def test_inverse_finds_random_poses_and_every_solution_is_right():
    pytest.importorskip("frankik")
    poses = forward(random_joints(150, seed=1))
    solutions = inverse(poses)
    found = ~np.isnan(solutions).any(axis=-1)
    # Some poses only have solutions between the tried values of joint 7.
    assert found.any(axis=(1, 2)).mean() > 0.93
    assert found.sum(axis=(1, 2)).mean() > 8
    assert within_limits(solutions[found]).all()
    wanted = np.broadcast_to(poses[:, None, None], (*found.shape, 4, 4))[found]
    reached = forward(solutions[found])
    np.testing.assert_allclose(reached[:, :3, 3], wanted[:, :3, 3], atol=5e-4)
    np.testing.assert_allclose(reached[:, :3, :3], wanted[:, :3, :3], atol=5e-3)


def test_inverse_at_the_true_last_joint_mostly_finds_the_joints_again():
    pytest.importorskip("frankik")
    q = random_joints(100, seed=2)
    nearest = np.array(
        [
            np.nan_to_num(np.abs(inverse(forward(one)[None], one[6:])[0, 0] - one).max(axis=1), nan=9.0).min()
            for one in q
        ]
    )
    # The closed form knows four branches; a sixth of all postures lie on others.
    assert (nearest < 1e-6).mean() > 0.8


def test_inverse_rejects_poses_out_of_reach():
    pytest.importorskip("frankik")
    far = np.eye(4)
    far[0, 3] = 1.5
    assert np.isnan(inverse(far[None])).all()


def test_refine_comes_back_from_a_disturbance_on_the_same_branch():
    q = random_joints(200, seed=3)
    inside = LOWER + 0.1 + (UPPER - LOWER - 0.2) * (q - LOWER) / (UPPER - LOWER)
    start = inside + np.random.default_rng(4).uniform(-0.02, 0.02, inside.shape)
    refined = refine(start, forward(inside))
    assert not reaches(start, forward(inside)).any()
    assert reaches(refined, forward(inside)).mean() > 0.98
    assert np.median(np.abs(refined - inside).max(axis=1)) < 0.05
