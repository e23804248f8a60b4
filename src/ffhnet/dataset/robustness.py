"""How well the neighbours of a grasp do: a success in bad company is luck, and a poor thing to imitate."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ffhnet.dataset.training_data import TrainingData
from ffhnet.geometry.rotations import geodesic_angle

POSITION_SCALE = 0.02
"""m: neighbours further away count less, as a Gaussian of this deviation (what a generator blurs)."""

ROTATION_SCALE = np.radians(20.0)
"""rad, likewise."""

PRIOR_WEIGHT = 0.5
"""The overall success rate counts as much as this many neighbours at the very same pose."""


def local_success(data: TrainingData) -> Float[np.ndarray, " T"]:
    """Success rate among the other trials of the same placement, weighted by nearness of the palm pose.

    Start collisions count as failures.
    """
    success = data.success.astype(float)
    prior = success.mean()
    rate = np.empty(data.num_trials)
    for placement in range(data.num_placements):
        rows = np.flatnonzero(data.trial_placement == placement)
        position, rotation = data.position[rows], data.rotation[rows]
        distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
        angle = geodesic_angle(rotation[:, None], rotation[None])
        weight = np.exp(-0.5 * ((distance / POSITION_SCALE) ** 2 + (angle / ROTATION_SCALE) ** 2))
        np.fill_diagonal(weight, 0.0)
        rate[rows] = (weight @ success[rows] + PRIOR_WEIGHT * prior) / (weight.sum(axis=1) + PRIOR_WEIGHT)
    return rate
