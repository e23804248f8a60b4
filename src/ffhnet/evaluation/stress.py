"""The stress protocol: the same grasps in a world that is not as the network was told."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from ffhnet.evaluation.outcomes import Condition, Tries
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.simulation.strict_trial import StrictTrial, Verdict
from ffhnet.simulation.trial import GraspTrial


@dataclass(frozen=True)
class Stress:
    """One way in which the world differs.

    Attributes:
        name: of the condition.
        mass: factor on the object's mass.
        friction: sliding coefficient of every contact, the nominal one if none.
        position: m by which every palm is off, in a random direction.
        rotation: rad by which every palm is turned, about a random axis through its origin.
    """

    name: str
    mass: float = 1.0
    friction: float | None = None
    position: float = 0.0
    rotation: float = 0.0


STRESSES = (
    Stress("friction", friction=0.5),
    Stress("mass", mass=2.0),
    Stress("pose", position=0.005, rotation=0.05),
    Stress("all", mass=2.0, friction=0.5, position=0.005, rotation=0.05),
)
"""Friction 0.5; twice the mass; the palm off by exactly 5 mm and 0.05 rad; and all of it together."""


@dataclass(frozen=True)
class PoseErrors:
    """Directions in which palms are off, unit vectors in the world frame, one of each per grasp."""

    shift: Float[np.ndarray, "N 3"]
    axis: Float[np.ndarray, "N 3"]

    @classmethod
    def draw(cls, count: int, rng: np.random.Generator) -> PoseErrors:
        """Evenly over the sphere."""
        return cls(_directions(count, rng), _directions(count, rng))


@dataclass(frozen=True)
class Groups:
    """The grasps of one view (world frame) that are tried again in other worlds (`Condition`)."""

    top: Grasps
    random: Grasps
    blind_random_yaw: Grasps
    blind_short_side: Grasps

    @property
    def together(self) -> Grasps:
        """All in one batch, in the order of the attributes."""
        parts = [self.top, self.random, self.blind_random_yaw, self.blind_short_side]
        return Grasps.concatenate([part.replace(probability=None) for part in parts])

    def split(self, name: str, tries: Tries) -> Condition:
        """What became of each group, from what became of all."""
        sizes = [len(self.top), len(self.random), len(self.blind_random_yaw)]
        cuts = [0, *np.cumsum(sizes).tolist(), len(tries)]
        top, random, blind_random_yaw, blind_short_side = (tries[start:end] for start, end in pairwise(cuts))
        return Condition(name, top, random, blind_random_yaw, blind_short_side)


def try_stressed(
    trial: GraspTrial, groups: Groups, T_world_object: Float[np.ndarray, "4 4"], rng: np.random.Generator
) -> list[Condition]:
    """Every stress in turn; each grasp has the same pose error wherever it has one.

    Args:
        trial: executes grasps on the object; left in its nominal world.
        groups: the grasps.
        T_world_object: the object's resting pose.
        rng: source of the directions of pose errors.
    """
    grasps = groups.together
    errors = PoseErrors.draw(len(grasps), rng)
    return [
        groups.split(stress.name, try_in(stress, trial, grasps, T_world_object, errors))
        for stress in STRESSES
    ]


def try_in(
    stress: Stress,
    trial: GraspTrial,
    grasps: Grasps,
    T_world_object: Float[np.ndarray, "4 4"],
    errors: PoseErrors,
) -> Tries:
    """What becomes of grasps (world frame) under one stress; leaves `trial` in its nominal world."""
    moved = grasps.replace(
        position=grasps.position + stress.position * errors.shift,
        rotation=matrix_from_rotation_vector(stress.rotation * errors.axis) @ grasps.rotation,
    )
    trial.vary(stress.mass, stress.friction)
    try:
        return Tries.of(trial.run(moved, T_world_object))
    finally:
        trial.vary()


def try_strict(
    trial: StrictTrial, groups: Groups, T_world_object: Float[np.ndarray, "4 4"]
) -> tuple[Condition, ...]:
    """The strict protocol: "strict" counts as the bench does, "strict, held" from when pushing begins."""
    results = trial.run_strict(groups.together, T_world_object)
    executed = results.verdict != Verdict.COLLISION
    return (
        groups.split("strict", Tries(results.success, executed)),
        groups.split("strict, held", Tries(results.held, executed)),
    )


def _directions(count: int, rng: np.random.Generator) -> Float[np.ndarray, "N 3"]:
    """Unit vectors, evenly over the sphere."""
    vectors = rng.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
