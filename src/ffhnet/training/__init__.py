"""Training the two networks from `TrainingData`."""

from ffhnet.training.config import ClassShares, TrainingConfig
from ffhnet.training.train import train_evaluator, train_generator

__all__ = ["ClassShares", "TrainingConfig", "train_evaluator", "train_generator"]
