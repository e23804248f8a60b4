"""The trajectory for controllers is the motion of the trials."""

import numpy as np

from ffhnet.hands import load_hand
from ffhnet.hands.closing import closing_advances, closing_trajectory

PERIOD = 0.012


def test_trajectory_passes_the_targets_of_a_trial():
    hand, rng = load_hand(), np.random.default_rng(0)
    joints = rng.uniform(hand.lower, hand.upper, size=(20, hand.num_joints))
    joints[0] = hand.open(joints[0])
    trajectory = closing_trajectory(hand, joints, PERIOD)
    for i, grasp in enumerate(joints):
        advances = closing_advances(hand, grasp, PERIOD)
        wanted = np.minimum(hand.open(grasp) + np.cumsum(advances, axis=0), hand.upper)
        came = trajectory.at(i, PERIOD * np.arange(1, len(wanted) + 1))
        np.testing.assert_allclose(came, wanted, atol=1e-9)
        np.testing.assert_array_equal(trajectory.at(i, np.zeros(1))[0], hand.open(grasp))
    end = np.nanmax(trajectory.times, axis=1)
    np.testing.assert_allclose(end, hand.closing.duration + hand.closing.squeeze)


def test_times_rise():
    hand = load_hand()
    joints = np.array([hand.upper, hand.lower, hand.eigengrasp_origin])
    trajectory = closing_trajectory(hand, joints, PERIOD)
    for times in trajectory.times:
        assert (np.diff(times[~np.isnan(times)]) > 0).all()
    assert len(closing_trajectory(hand, joints[:0], PERIOD)) == 0


def test_torque_limits_are_those_of_the_model():
    hand = load_hand()
    limit = dict(zip(hand.joint_names, hand.torque_limit, strict=True))
    assert (limit["index_mcp"], limit["index_pip"], limit["thumb_abduction"]) == (1.15, 0.6, 1.15)
