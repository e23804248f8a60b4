"""Rotations as matrices, 6-D vectors, quaternions (wxyz) and Euler angles; batched over leading axes."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from torch import Tensor


def rotation_from_6d(vectors: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrix from two 3-vectors a, b (Zhou et al. 2019, cited in section III-B).

    Column x is a normalised, z = x × b normalised, y = z × x. The scale of a and b does not matter.
    """
    a, b = vectors[..., :3], vectors[..., 3:]
    x = torch.nn.functional.normalize(a, dim=-1)
    z = torch.nn.functional.normalize(torch.linalg.cross(x, b), dim=-1)
    y = torch.linalg.cross(z, x)
    return torch.stack([x, y, z], dim=-1)


def rotation_to_6d(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 6"]:
    """The first two columns of a rotation matrix, the inverse of `rotation_from_6d`."""
    return torch.cat([rotation[..., :, 0], rotation[..., :, 1]], dim=-1)


def quaternion_from_matrix(rotation: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 4"]:
    """Unit quaternions (wxyz, w ≥ 0) of rotation matrices."""
    flat = np.asarray(rotation, dtype=float).reshape(-1, 3, 3)
    xyzw = Rotation.from_matrix(flat).as_quat(canonical=True).reshape(-1, 4)
    return xyzw[:, [3, 0, 1, 2]].reshape(*np.shape(rotation)[:-2], 4)


def matrix_from_quaternion(quaternion_wxyz: Float[np.ndarray, "*batch 4"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation matrices of quaternions (wxyz), which are normalised first."""
    flat = np.asarray(quaternion_wxyz, dtype=float).reshape(-1, 4)[:, [1, 2, 3, 0]]
    return Rotation.from_quat(flat).as_matrix().reshape(*np.shape(quaternion_wxyz)[:-1], 3, 3)


def matrix_from_euler_xyz(angles: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation about the fixed x, then y, then z axis (URDF "rpy"), angles in radians."""
    flat = np.asarray(angles, dtype=float).reshape(-1, 3)
    return Rotation.from_euler("xyz", flat).as_matrix().reshape(*np.shape(angles)[:-1], 3, 3)


def matrix_from_rotation_vector(vector: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation by |vector| radians about vector."""
    flat = np.asarray(vector, dtype=float).reshape(-1, 3)
    return Rotation.from_rotvec(flat).as_matrix().reshape(*np.shape(vector)[:-1], 3, 3)


def geodesic_angle(
    a: Float[np.ndarray, "*batch 3 3"], b: Float[np.ndarray, "*batch 3 3"]
) -> Float[np.ndarray, "*batch"]:
    """Angle in radians of the rotation that takes a to b."""
    trace = np.einsum("...ij,...ij->...", a, b)
    return np.arccos(np.clip((trace - 1) / 2, -1, 1))


def about_z(angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation by `angle` radians about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
