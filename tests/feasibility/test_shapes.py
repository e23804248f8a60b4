"""Shapes against points: the grid's answer is that of every point against every shape."""

import numpy as np
import pytest
import torch

from ffhnet.feasibility.nearest import NearestGrid
from ffhnet.feasibility.shapes import Shapes
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import make_transform
from ffhnet.hands import load_hand


@pytest.fixture(scope="module")
def shapes():
    return Shapes.of(load_hand().tree, 0.02)


def bottle(count=6000):
    """Points on a tube around the origin."""
    rng = np.random.default_rng(0)
    angle, height = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.1, 0.1, count)
    return np.stack([0.035 * np.cos(angle), 0.035 * np.sin(angle), height], axis=1)


def poses(count):
    rng = np.random.default_rng(1)
    T = make_transform(
        matrix_from_rotation_vector(rng.normal(size=(count, 3))), 0.1 * rng.normal(size=(count, 3))
    )
    hand = load_hand()
    joints = rng.uniform(hand.lower, hand.upper, size=(count, hand.num_joints))
    return T[:, None] @ hand.body_poses(torch.as_tensor(joints)).numpy()


def distances(shapes, T_frame_body, points):
    """From all shapes of one pose to all points, one by one."""
    least = np.inf
    for shape, body in enumerate(shapes.body):
        T = T_frame_body[body] @ shapes.T_body_shape[shape]
        beyond = np.abs((points - T[:3, 3]) @ T[:3, :3]) - shapes.half[shape]
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
        least = min(least, outside.min() - shapes.radius[shape])
    return least


def test_near_points_are_found_at_their_distance(shapes):
    points, T = bottle(), poses(60)
    grid = NearestGrid.of(points, 0.022, 0.005)
    shift = np.full((60, 3), 0.01)
    near = shapes.place(T).near(grid, np.arange(60), shift)
    found = np.full(60, np.inf)
    np.minimum.at(found, near.row, near.distance)
    moved = T.copy()
    moved[..., :3, 3] += 0.01
    exact = np.array([distances(shapes, pose, points) for pose in moved])
    close = exact < 0.005
    assert 15 < close.sum() < 55
    assert np.abs(found - exact)[close].max() < 0.005
    assert np.abs(found - exact)[close].mean() < 0.002
    assert (found[~close] > 0.002).all()


def test_rows_are_poses(shapes):
    grid, T = NearestGrid.of(bottle(), 0.022, 0.005), poses(30)
    placed = shapes.place(T)
    rows = np.array([7, 3])
    near = placed.near(grid, rows, np.zeros((2, 3)))
    for place, row in enumerate(rows):
        alone = shapes.place(T[[row]]).near(grid, np.array([0]), np.zeros((1, 3)))
        np.testing.assert_allclose(
            np.sort(near.distance[near.row == place]), np.sort(alone.distance), atol=1e-5
        )


def test_lowest_point_is_that_of_the_mesh(shapes):
    hand = load_hand()
    joints = hand.eigengrasp_origin
    rotation = matrix_from_rotation_vector(np.array([0.4, -0.7, 1.1]))
    T = make_transform(rotation, np.array([0.0, 0.0, 0.3]))
    bodies = T @ hand.body_poses(torch.as_tensor(joints)[None]).numpy()
    mesh = hand.shape(joints).apply_transform(T)
    assert shapes.place(bodies).lowest()[0] == pytest.approx(mesh.bounds[0, 2], abs=5e-4)


def test_grid_gives_the_nearest_point():
    points = bottle()
    grid = NearestGrid.of(points, 0.02, 0.005)
    places = np.random.default_rng(2).uniform(-0.12, 0.12, size=(3, 5000)).astype(np.float32)
    hit, point = grid.look_up(places)
    true = np.linalg.norm(places.T[:, None] - grid.points[None], axis=2).min(axis=1)
    found = np.full(5000, np.inf)
    found[hit] = np.linalg.norm(places.T[hit] - grid.points[point], axis=1)
    reached = true < 0.01
    assert reached.sum() > 200
    assert np.isfinite(found[reached]).all()
    assert (found[reached] - true[reached]).max() < 0.005 * np.sqrt(3)
    assert (found[reached] - true[reached]).mean() < 0.001


def test_empty_grid_has_nothing():
    grid = NearestGrid.of(np.zeros((0, 3)), 0.02, 0.005)
    assert len(grid.look_up(np.zeros((3, 4), np.float32))[0]) == 0
