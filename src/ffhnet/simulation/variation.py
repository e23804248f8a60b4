"""Repeats of a trial with another pose, mass and friction: does the grasp hold in a world half known?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.simulation.trial import GraspTrial


@dataclass(frozen=True)
class Variation:
    """Uniform ranges of what nobody knows exactly when a grasp is executed.

    Attributes:
        position: m, palm position error per axis, ±.
        rotation: rad, palm orientation error about each axis, ±.
        mass: factors on the object's mass.
        friction: sliding coefficients.
    """

    position: float = 0.003
    rotation: float = np.radians(3.0)
    mass: tuple[float, float] = (0.5, 2.0)
    friction: tuple[float, float] = (0.4, 1.0)

    def perturb(self, grasps: Grasps, rng: np.random.Generator) -> Grasps:
        """The same grasps with pose errors."""
        shift = rng.uniform(-self.position, self.position, (len(grasps), 3))
        turn = rng.uniform(-self.rotation, self.rotation, (len(grasps), 3))
        return grasps.replace(
            position=grasps.position + shift, rotation=matrix_from_rotation_vector(turn) @ grasps.rotation
        )


def held_under_variation(
    trial: GraspTrial,
    grasps: Grasps,
    T_world_object: Float[np.ndarray, "4 4"],
    repeats: int,
    rng: np.random.Generator,
    variation: Variation | None = None,
) -> Int[np.ndarray, " N"]:
    """How many of `repeats` varied trials of each grasp succeed; a start collision counts as a failure.

    Args:
        trial: executes grasps on one object.
        grasps: world frame.
        T_world_object: the object's resting pose.
        repeats: trials per grasp, each with its own pose error, mass and friction.
        rng: source of randomness.
        variation: ranges.
    """
    variation = variation or Variation()
    held = np.zeros(len(grasps), dtype=int)
    try:
        for i in range(len(grasps)):
            varied = variation.perturb(grasps[np.full(repeats, i)], rng)
            for k in range(repeats):
                trial.vary(rng.uniform(*variation.mass), rng.uniform(*variation.friction))
                held[i] += int(trial.run(varied[k : k + 1], T_world_object).success[0])
    finally:
        trial.vary()
    return held
