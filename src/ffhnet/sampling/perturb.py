"""Perturb-and-keep: new proposals around grasps that held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand


@dataclass(frozen=True)
class PerturbConfig:
    """Standard deviations of the change, drawn per grasp up to these.

    Attributes:
        position: m per axis.
        rotation: rad per axis.
        joints: rad per joint.
    """

    position: float = 0.015
    rotation: float = 0.2
    joints: float = 0.12


def perturb(
    grasps: Grasps,
    closed_joints: Float[np.ndarray, "N J"],
    hand: Hand,
    rng: np.random.Generator,
    config: PerturbConfig | None = None,
) -> Grasps:
    """One neighbour of each grasp, with the joints taken from around its closed state.

    The closed joints show where the fingers met the object, so that the new grasps have the shape in
    which the hand holds it.

    Args:
        grasps: successful grasps.
        closed_joints: their measured joint angles after closing, rad.
        hand: gives the limits.
        rng: source of randomness.
        config: size of the changes.
    """
    config = config or PerturbConfig()
    # Near and far neighbours alike: near ones teach where success ends, far ones find new grasps.
    reach = rng.uniform(0.25, 1.0, size=(len(grasps), 1))
    turn = reach * config.rotation * rng.standard_normal((len(grasps), 3))
    shift = reach * config.position * rng.standard_normal((len(grasps), 3))
    joints = closed_joints + reach * config.joints * rng.standard_normal(closed_joints.shape)
    return grasps.replace(
        rotation=matrix_from_rotation_vector(turn) @ grasps.rotation,
        position=grasps.position + shift,
        joints=np.clip(joints, hand.lower, hand.upper),
        probability=None,
    )
