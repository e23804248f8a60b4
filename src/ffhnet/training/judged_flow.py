"""What the tasks share that teach a flow with an evaluator as the judge of its samples."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from ffhnet.dataset.training_data import TrainingData
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors
from ffhnet.training.batches import view_tensors
from ffhnet.training.config import TrainingConfig
from ffhnet.training.loop import seeded

HELD_OUT_VIEWS, HELD_OUT_GRASPS = 128, 32
"""Size of the held-out measurement."""


class JudgedFlow:
    """A flow in training, its teacher, and the evaluator that judges both.

    Args:
        module: the flow in training; it and the teacher standardise states alike.
        teacher: a trained flow.
        evaluator: neither it nor the teacher changes.
        joint_limits: lower and upper limits (rad): the evaluator sees joints clipped to them.
        config: the run.
        data: views to learn from.
        held_out: views to measure on, or None.
    """

    def __init__(
        self,
        module: FlowGenerator,
        teacher: FlowGenerator,
        evaluator: FFHEvaluator,
        joint_limits: tuple[Float[Tensor, " J"], Float[Tensor, " J"]],
        config: TrainingConfig,
        data: TrainingData,
        held_out: TrainingData | None,
    ):
        self.module = module
        self.config = config
        self._device = next(module.parameters()).device
        self._evaluator = evaluator.to(self._device).eval().requires_grad_(False)
        self._lower, self._upper = (limit.to(self._device) for limit in joint_limits)
        self._data = data
        self._held_out = held_out
        self._teacher = teacher.to(self._device).eval()

    def metrics(self) -> dict[str, float]:
        """What the evaluator says of samples on held-out views."""
        if self._held_out is None:
            return {}
        self.module.eval()
        with torch.inference_mode(), seeded(self.config.seed) as rng:
            views = rng.choice(self._held_out.num_views, HELD_OUT_VIEWS)
            objects = self._objects(self._held_out, views)
            noise = self._noise(HELD_OUT_VIEWS, HELD_OUT_GRASPS, self.module.config.temperature)
            *_, last = self.module.path(objects, noise)
            blame = self._doubt(objects, self.module.grasps(last)).mean().item()
        self.module.train()
        return {"blame": blame}

    def _noise(self, views: int, grasps: int, temperature: float) -> Float[Tensor, "V G S"]:
        """What samples start from."""
        return (temperature * torch.randn(views, grasps, self.module.state_width)).to(self._device)

    def _doubt(self, objects: ObjectTensors, grasps: GraspTensors) -> Float[Tensor, "V G"]:
        """Negative logarithm of the probability that a grasp holds, mean over the evaluator's outputs."""
        joints = grasps.joints.clamp(self._lower, self._upper)
        logits = self._evaluator(objects, GraspTensors(grasps.rotation, grasps.position, joints))
        outputs = [logits.success] if logits.robust is None else [logits.success, logits.robust]
        return torch.stack([functional.softplus(-output) for output in outputs]).mean(dim=0)

    def _objects(self, data: TrainingData, views: Int[np.ndarray, " V"]) -> ObjectTensors:
        return view_tensors(data, views).to(self._device)
