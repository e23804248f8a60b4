"""Rotations by property: orthonormal, invertible, consistent with each other."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from ffhnet.geometry.rotations import (
    about_z,
    geodesic_angle,
    matrix_from_euler_xyz,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    rotation_from_6d,
    rotation_to_6d,
)
from ffhnet.geometry.transforms import apply, invert, make_transform

angles = hnp.arrays(float, (3,), elements=st.floats(-3.1, 3.1))


@given(hnp.arrays(float, (6,), elements=st.floats(-2, 2)))
def test_any_two_directions_make_a_rotation(vectors):
    a, b = vectors[:3], vectors[3:]
    if np.linalg.norm(np.cross(a, b)) < 1e-3:
        return
    rotation = rotation_from_6d(torch.tensor(vectors)).numpy()
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) > 0.999
    np.testing.assert_allclose(rotation[:, 0], a / np.linalg.norm(a), atol=1e-9)
    # b lies in the plane of x and y, on y's side.
    assert abs(rotation[:, 2] @ b) < 1e-9
    assert rotation[:, 1] @ b > 0


@given(angles)
def test_6d_and_quaternion_round_trips(euler):
    rotation = matrix_from_euler_xyz(euler)
    again = rotation_from_6d(rotation_to_6d(torch.tensor(rotation))).numpy()
    np.testing.assert_allclose(again, rotation, atol=1e-9)
    quaternion = quaternion_from_matrix(rotation)
    assert quaternion[0] >= 0
    np.testing.assert_allclose(matrix_from_quaternion(quaternion), rotation, atol=1e-9)
    np.testing.assert_allclose(matrix_from_quaternion(-3 * quaternion), rotation, atol=1e-9)


@given(angles, angles)
def test_geodesic_angle_is_the_angle_between(euler, vector):
    rotation = matrix_from_euler_xyz(euler)
    turn = vector / 3.2  # shorter than half a turn
    angle = geodesic_angle(matrix_from_rotation_vector(turn) @ rotation, rotation)
    np.testing.assert_allclose(angle, np.linalg.norm(turn), atol=1e-6)


def test_euler_angles_are_urdf_rpy():
    roll, pitch, yaw = 0.3, -1.1, 0.7
    wanted = Rotation.from_euler("z", yaw) * Rotation.from_euler("y", pitch) * Rotation.from_euler("x", roll)
    np.testing.assert_allclose(matrix_from_euler_xyz([roll, pitch, yaw]), wanted.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(about_z(0.4), matrix_from_euler_xyz([0, 0, 0.4]), atol=1e-12)


def test_batches_keep_their_shape():
    euler = np.random.default_rng(0).uniform(-3, 3, (4, 5, 3))
    rotation = matrix_from_euler_xyz(euler)
    assert rotation.shape == (4, 5, 3, 3)
    quaternion = quaternion_from_matrix(rotation)
    assert quaternion.shape == (4, 5, 4)
    np.testing.assert_allclose(matrix_from_quaternion(quaternion[2, 3]), rotation[2, 3], atol=1e-9)


@given(angles, hnp.arrays(float, (3,), elements=st.floats(-5, 5)))
def test_transforms_invert_and_compose(euler, position):
    T_a_b = make_transform(matrix_from_euler_xyz(euler), position)
    np.testing.assert_allclose(invert(T_a_b) @ T_a_b, np.eye(4), atol=1e-9)
    points = np.random.default_rng(0).normal(size=(7, 3))
    np.testing.assert_allclose(apply(invert(T_a_b), apply(T_a_b, points)), points, atol=1e-9)
    np.testing.assert_allclose(apply(T_a_b, np.zeros(3)), position)
