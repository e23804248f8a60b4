"""The batch type: slicing, ranking, frames, and what it refuses."""

import numpy as np
import pytest

from ffhnet.errors import OptionError
from ffhnet.geometry.rotations import matrix_from_euler_xyz
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps


def batch(count=5, frame="world", probability=True):
    rng = np.random.default_rng(count)
    return Grasps(
        rotation=matrix_from_euler_xyz(rng.uniform(-3, 3, (count, 3))),
        position=rng.normal(size=(count, 3)),
        joints=rng.uniform(size=(count, 2)),
        joint_names=("a", "b"),
        hand="two_joints",
        frame=frame,
        probability=rng.uniform(size=count) if probability else None,
    )


def test_ranked_is_best_first_and_keeps_rows_together():
    grasps = batch()
    ranked = grasps.ranked()
    assert (np.diff(ranked.probability) <= 0).all()
    best = np.argmax(grasps.probability)
    np.testing.assert_array_equal(ranked.position[0], grasps.position[best])
    np.testing.assert_array_equal(ranked.joints[0], grasps.joints[best])
    np.testing.assert_array_equal(ranked.rotation[0], grasps.rotation[best])
    with pytest.raises(OptionError, match="cannot be ranked"):
        batch(probability=False).ranked()


def test_robustness_ranks_where_it_is_known():
    grasps = batch()
    other = grasps.replace(robustness=1 - grasps.probability)
    np.testing.assert_array_equal(other.score, 1 - grasps.probability)
    np.testing.assert_array_equal(other.ranked().position[0], grasps.position[np.argmin(grasps.probability)])


def test_slices_are_batches():
    grasps = batch()
    assert len(grasps[2]) == 1
    assert len(grasps[1:4]) == 3
    assert len(grasps[grasps.probability > 2]) == 0
    np.testing.assert_array_equal(grasps[-1].position[0], grasps.position[-1])


def test_change_of_frame_there_and_back():
    grasps = batch()
    T = make_transform(matrix_from_euler_xyz([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0]))
    moved = grasps.to_frame(T, "camera")
    assert moved.frame == "camera"
    assert not np.allclose(moved.position, grasps.position)
    back = moved.to_frame(invert(T), "world")
    np.testing.assert_allclose(back.position, grasps.position, atol=1e-12)
    np.testing.assert_allclose(back.rotation, grasps.rotation, atol=1e-12)


def test_a_grasp_goes_where_its_frame_goes():
    """A quarter turn about z takes x to y; then everything moves by (1, 2, 3)."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    grasps = batch(1).replace(position=np.array([[10.0, 20.0, 30.0]]), rotation=np.eye(3)[None])
    moved = grasps.to_frame(make_transform(quarter, np.array([1.0, 2.0, 3.0])), "camera")
    np.testing.assert_allclose(moved.position, [[-19.0, 12.0, 33.0]])
    np.testing.assert_allclose(moved.rotation, quarter[None])


def test_concatenate_refuses_mixtures():
    joined = Grasps.concatenate([batch(3), batch(4)])
    assert len(joined) == 7
    assert Grasps.concatenate([batch(3), batch(4, probability=False)]).probability is None
    with pytest.raises(OptionError, match="cannot join"):
        Grasps.concatenate([batch(3), batch(3, frame="camera")])


def test_wrong_shapes_are_named():
    with pytest.raises(OptionError, match=r"Grasps\.joints must have shape \(5, 3\)"):
        batch().replace(joint_names=("a", "b", "c"))
