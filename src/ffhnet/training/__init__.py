"""Training the networks from `TrainingData`."""

from ffhnet.training.config import ClassShares, TrainingConfig
from ffhnet.training.train import (
    LookPoints,
    distill_evaluator,
    distill_generator,
    refine_generator,
    train_evaluator,
    train_generator,
)

__all__ = [
    "ClassShares",
    "LookPoints",
    "TrainingConfig",
    "distill_evaluator",
    "distill_generator",
    "refine_generator",
    "train_evaluator",
    "train_generator",
]
