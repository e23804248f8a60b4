"""How well an evaluator predicts stored trials that it has not learned from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from ffhnet.dataset.training_data import TrainingData
from ffhnet.geometry.transforms import invert
from ffhnet.metrics import auroc, expected_calibration_error
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.tensors import GraspTensors, ObjectTensors


@dataclass(frozen=True)
class Scores:
    """Quality of predicted probabilities.

    Attributes:
        executed, successes, collisions: counts of the trials.
        auroc_executed: without start collisions.
        auroc_all: with them, as failures.
        ece_executed: expected calibration error without start collisions.
    """

    executed: int
    successes: int
    collisions: int
    auroc_executed: float
    auroc_all: float
    ece_executed: float


def score(data: TrainingData, evaluator: FFHEvaluator) -> Scores:
    """Rates every trial in every view of its placement; a trial counts once per view."""
    probability, label, executed = [], [], []
    for view in range(data.num_views):
        trials = np.flatnonzero(data.trial_placement == data.view_placement[view])
        probability.append(_rate(data, view, trials, evaluator))
        label.append(data.label[trials])
        executed.append(data.executed[trials])
    p, y, tried = np.concatenate(probability), np.concatenate(label), np.concatenate(executed)
    return Scores(
        executed=int(data.executed.sum()),
        successes=int(data.success.sum()),
        collisions=int((~data.executed).sum()),
        auroc_executed=auroc(y[tried], p[tried]),
        auroc_all=auroc(y, p),
        ece_executed=expected_calibration_error(y[tried], p[tried]),
    )


def _rate(
    data: TrainingData, view: int, trials: np.ndarray, evaluator: FFHEvaluator
) -> Float[np.ndarray, " N"]:
    T_view_world = invert(data.T_world_view[view])
    rotation = T_view_world[:3, :3] @ data.rotation[trials]
    position = data.position[trials] @ T_view_world[:3, :3].T + T_view_world[:3, 3]

    def tensor(array: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(array, dtype=torch.float32).unsqueeze(0)

    objects = ObjectTensors(tensor(data.bps[view]), tensor(data.table_height[view]))
    grasps = GraspTensors(tensor(rotation), tensor(position), tensor(data.joints[trials]))
    with torch.inference_mode():
        return torch.sigmoid(evaluator(objects, grasps).success[0].double()).numpy()
