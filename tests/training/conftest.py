from collections.abc import Callable

import pytest
from training_world import JOINT_LIMITS, MODEL, point_world

from ffhnet.dataset.training_data import TrainingData
from ffhnet.model.config import ModelConfig


@pytest.fixture
def make_world() -> Callable[..., TrainingData]:
    return point_world


@pytest.fixture
def model() -> ModelConfig:
    return MODEL


@pytest.fixture
def joint_limits() -> tuple[tuple[float, ...], tuple[float, ...]]:
    return JOINT_LIMITS
