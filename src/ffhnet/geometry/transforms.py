"""Rigid transforms as 4×4 matrices. `T_a_b` takes coordinates in frame b to coordinates in frame a."""

import numpy as np
from jaxtyping import Float


def make_transform(
    rotation: Float[np.ndarray, "*batch 3 3"] | None = None,
    position: Float[np.ndarray, "*batch 3"] | None = None,
) -> Float[np.ndarray, "*batch 4 4"]:
    """Transform from a rotation (identity if none) and a position in metres (zero if none)."""
    batch: tuple[int, ...] = ()
    if rotation is not None:
        batch = rotation.shape[:-2]
    elif position is not None:
        batch = position.shape[:-1]
    transform = np.broadcast_to(np.eye(4), (*batch, 4, 4)).copy()
    if rotation is not None:
        transform[..., :3, :3] = rotation
    if position is not None:
        transform[..., :3, 3] = position
    return transform


def invert(transform: Float[np.ndarray, "*batch 4 4"]) -> Float[np.ndarray, "*batch 4 4"]:
    """Inverse of a rigid transform."""
    rotation_t = np.swapaxes(transform[..., :3, :3], -1, -2)
    return make_transform(rotation_t, -np.einsum("...ij,...j->...i", rotation_t, transform[..., :3, 3]))


def apply(
    transform: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, "*n 3"]:
    """Points (metres) taken through one transform."""
    return points @ transform[:3, :3].T + transform[:3, 3]
