"""The paper's grasp sampler (section IV-B): palm poses from points and normals, joints from eigengrasps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.geometry.rotations import matrix_from_euler_xyz
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand


@dataclass(frozen=True)
class HeuristicConfig:
    """Ranges of the sampler; the defaults are the paper's.

    Attributes:
        offset: m between the surface point and the reference point, along the approach direction.
        position_noise: m, uniform per axis.
        roll: rad about the palm's x axis, uniform in ±roll.
        pitch_yaw: rad about the palm's y and z axes, uniform in ±pitch_yaw.
        reference: point of the palm frame (m) that `offset` is measured from.
        tilt: rad by which the approach direction leaves the palm's x axis towards the palm's face
            (about y). Zero comes fingertips first, larger values bring the palm's face to the object.
    """

    offset: tuple[float, float] = (0.045, 0.115)
    position_noise: float = 0.01
    roll: float = 0.7
    pitch_yaw: float = 0.35
    reference: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)


PAPER = HeuristicConfig()
"""Fingertips first, as the authors' palm frame has it: mostly precision grasps."""

POWER = HeuristicConfig(offset=(0.0, 0.03), reference=(0.075, 0.0, 0.025), tilt=(0.2, 1.2))
"""The hollow of the hand meets the surface, coming from between finger direction and palm normal:
power grasps. Twice the success of `PAPER` on the same views (see `docs/figures.md`)."""


DRAWS_PER_TRIAL = 20
"""Proposals drawn for each trial that is wanted: about one in ten heuristic ones is free of collisions."""


def sample_heuristic(
    cloud: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    hand: Hand,
    count: int,
    rng: np.random.Generator,
    config: HeuristicConfig = PAPER,
) -> Grasps:
    """Grasps in the frame of the cloud, which must be a world frame (z up), not filtered for collisions.

    Args:
        cloud: visible object points, metres.
        normals: their outward unit normals.
        hand: gives eigengrasps and limits.
        count: number of grasps.
        rng: source of randomness.
        config: ranges.
    """
    chosen = rng.integers(len(cloud), size=count)
    nominal = _nominal_rotations(normals[chosen], cloud)
    tilt = rng.uniform(*config.tilt, size=count)
    zero = np.zeros(count)
    # Turning the palm by +tilt about its y axis takes the tilted approach direction onto the normal.
    nominal = nominal @ matrix_from_euler_xyz(np.stack([zero, -tilt, zero], axis=1))
    noise = np.array([config.roll, config.pitch_yaw, config.pitch_yaw])
    rotation = nominal @ matrix_from_euler_xyz(rng.uniform(-noise, noise, size=(count, 3)))
    offset = rng.uniform(*config.offset, size=(count, 1))
    jitter = rng.uniform(-config.position_noise, config.position_noise, size=(count, 3))
    return Grasps(
        rotation=rotation,
        position=cloud[chosen] + offset * normals[chosen] + jitter - rotation @ np.array(config.reference),
        joints=sample_joints(hand, count, rng),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )


def sample_joints(hand: Hand, count: int, rng: np.random.Generator) -> Float[np.ndarray, "N J"]:
    """Joint angles (rad) from uniformly weighted eigengrasps (eq. 6), within the limits."""
    weights = rng.uniform(size=(count, len(hand.eigengrasps)))
    return np.clip(hand.eigengrasp_origin + weights @ hand.eigengrasps, hand.lower, hand.upper)


def _nominal_rotations(
    normals: Float[np.ndarray, "N 3"], cloud: Float[np.ndarray, "M 3"]
) -> Float[np.ndarray, "N 3 3"]:
    """Palm x against the normal, y along the longer side of the object's face, thumb side up."""
    centred = cloud - cloud.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]  # rows: principal axes
    lengths = np.ptp(centred @ axes.T, axis=0)
    x = -normals
    # The axis most parallel to the normal points into the face; of the other two, the longer one counts.
    into = np.argmax(np.abs(x @ axes.T), axis=1)
    length = np.where(np.arange(3) == into[:, None], -1.0, lengths)
    side = axes[np.argmax(length, axis=1)]
    y = side - np.sum(side * x, axis=1, keepdims=True) * x
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    y = np.where(y[:, 2:] < -0.2, -y, y)
    return np.stack([x, y, np.cross(x, y)], axis=2)
