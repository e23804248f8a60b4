"""The preset for another hand: what a few dozen objects can teach, in minutes on one core."""

from __future__ import annotations

import dataclasses

from ffhnet.model.config import ModelConfig
from ffhnet.training.config import STEPS, Network, TrainingConfig


def small_model(num_joints: int) -> ModelConfig:
    """The project's architecture at less than half its widths: both files together take less than 3 MB."""
    return dataclasses.replace(
        ModelConfig.default(num_joints),
        pca_components=48,
        inner_width=96,
        width=192,
        palm_points=64,
        flow_width=192,
        flow_blocks=3,
        flow_palm_points=64,
    )


def small_training(network: Network, num_joints: int) -> TrainingConfig:
    """The project's recipe for a small model, in half the steps."""
    default = TrainingConfig.default(network, num_joints)
    return dataclasses.replace(default, model=small_model(num_joints), steps=STEPS[network] // 2)
