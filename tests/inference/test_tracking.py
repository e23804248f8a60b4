"""A tracked grasp stays with a moving object; the best sample of every single view does not."""

import itertools

import numpy as np
import pytest
import torch

from ffhnet.errors import OptionError
from ffhnet.geometry.rotations import about_z, geodesic_angle
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import NEAR_ANGLE, NEAR_POSITION, GraspTracker
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.observation import Observation, observe_depth

torch.set_num_threads(1)
FRAMES, NUM = 8, 60
T_WORLD_CAMERA = look_at([-0.5, 0.1, 0.45], [0, 0, 0.06])


@pytest.fixture(scope="module")
def network() -> FFHNet:
    return FFHNet.from_pretrained(device="cpu")


@pytest.fixture(scope="module")
def motion() -> list[tuple[Observation, np.ndarray]]:
    """A bottle that is pushed 1 cm and turned by 3 degrees per frame, and its pose in the camera frame."""
    bottle = next(s for s in resolve_objects("procedural-val:30") if "bottle" in s.name).load()
    frames = []
    for k in range(FRAMES):
        T_world_object = make_transform(about_z(np.radians(3.0 * k)), np.array([0.0, 0.01 * k, 0.0]))
        T_world_object = T_world_object @ bottle.resting_poses[0]
        mesh = bottle.visual.copy().apply_transform(T_world_object)
        depth = render_depth([mesh], T_WORLD_CAMERA, REALSENSE_D415)
        rng = np.random.default_rng(k)
        observation = observe_depth(depth + rng.normal(0, 5e-4, depth.shape), REALSENSE_D415, rng)
        frames.append((observation, invert(T_WORLD_CAMERA) @ T_world_object))
    return frames


def choices(network: FFHNet, motion: list[tuple[Observation, np.ndarray]], margin: float) -> list[Grasps]:
    tracker = GraspTracker(network, NUM, margin)
    return [tracker.update(observation, seed=k) for k, (observation, _) in enumerate(motion)]


def jumps(chosen: list[Grasps], motion: list[tuple[Observation, np.ndarray]]) -> np.ndarray:
    """How far the first grasp moves on the object from frame to frame, in multiples of "near"."""
    on_object = [
        grasps[0].to_frame(invert(T), "object") for grasps, (_, T) in zip(chosen, motion, strict=True)
    ]
    moved = [
        max(
            float(np.linalg.norm(b.position - a.position)) / NEAR_POSITION,
            float(geodesic_angle(a.rotation, b.rotation)[0]) / NEAR_ANGLE,
        )
        for a, b in itertools.pairwise(on_object)
    ]
    return np.array(moved)


def test_the_hand_follows_and_does_not_jump(network, motion):
    tracked = jumps(choices(network, motion, 0.1), motion)
    best = [network.grasp(observation, NUM, seed=k) for k, (observation, _) in enumerate(motion)]
    single = jumps(best, motion)
    assert (tracked < 1.2).sum() >= FRAMES - 2
    assert np.median(single) > 3 * np.median(tracked)


def test_what_is_chosen_is_nearly_the_best(network, motion):
    for grasps in choices(network, motion, 0.1):
        samples = grasps[np.arange(1, len(grasps))]
        assert len(samples) == NUM
        assert (np.diff(samples.score) <= 0).all()
        assert grasps.score[0] >= samples.score[0] - 0.1
        assert grasps.frame == "camera"


def test_without_a_margin_the_best_of_old_and_new_is_taken(network, motion):
    for grasps in choices(network, motion, 0.0):
        assert grasps.score[0] >= grasps.score.max()


def test_reset_forgets(network, motion):
    tracker = GraspTracker(network, NUM, margin=1.0)
    first = tracker.update(motion[0][0], seed=0)
    kept = tracker.update(motion[1][0], seed=1)
    np.testing.assert_allclose(kept.rotation[0], first.rotation[0])
    tracker.reset()
    fresh = tracker.update(motion[1][0], seed=1)
    np.testing.assert_array_equal(fresh.position[0], fresh.position[1])


def test_refusals(network, motion):
    with pytest.raises(OptionError, match="between 0 and 1, got 2"):
        GraspTracker(network, margin=2)
