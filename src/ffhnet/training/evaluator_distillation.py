"""A small evaluator learns from a large one what becomes of the grasps that a small generator proposes.

A large evaluator can be asked about any grasp, without physics, and so about those that will be rated in use
(knowledge distillation, Hinton et al. 2015). From trials the student learns what really happened.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import OptionError
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.losses import evaluator_loss
from ffhnet.model.tensors import GraspTensors
from ffhnet.training.batches import view_tensors
from ffhnet.training.config import TrainingConfig
from ffhnet.training.loop import seeded
from ffhnet.training.tasks import EvaluatorTask
from ffhnet.training.view_chunks import view_chunks

HELD_OUT_VIEWS = 128
"""Views of the held-out measurement."""


class EvaluatorDistillationTask(EvaluatorTask):
    """Learn from trials, and on as many of the generator's own samples from a teacher.

    Args:
        module: the student.
        teacher: what it learns from.
        generator: the one that it will be used with; neither it nor the teacher changes.
        joint_limits: lower and upper limits (rad), to which the generator's joints are clipped.
        config: the run; `pairs` samples of each view are rated, and half of a batch's grasps are such.
        data: views and trials to learn from.
        held_out: others to measure on, or None.
    """

    _samples: tuple[Float[np.ndarray, "V P S"], Float[np.ndarray, "V P 3"]]

    def __init__(
        self,
        module: FFHEvaluator,
        teacher: FFHEvaluator,
        generator: FlowGenerator,
        joint_limits: tuple[Float[Tensor, " J"], Float[Tensor, " J"]],
        config: TrainingConfig,
        data: TrainingData,
        held_out: TrainingData | None,
    ):
        self._own = min(config.grasps // 2, config.pairs)
        if self._own < 1:
            raise OptionError(f"trials and samples want 2 grasps per view or more, got {config.grasps}")
        super().__init__(
            module, dataclasses.replace(config, grasps=config.grasps - self._own), data, held_out
        )
        self._teacher, self._generator = teacher.to(self._device).eval(), generator.to(self._device).eval()
        self._lower, self._upper = (limit.to(self._device) for limit in joint_limits)
        self._data, self._unseen = data, held_out

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Eq. 5 with what happened and with what the teacher says."""
        states, opinions = self._samples
        batch, own = self._draw(rng), rng.choice(self.config.pairs, self._own, replace=False)
        grasps = self._grasps(torch.from_numpy(states[batch.views][:, own]).float().to(self._device))
        opinion = torch.from_numpy(opinions[batch.views][:, own]).float().to(self._device)
        said = self.module(batch.objects, GraspTensors.joined([batch.grasps, grasps]))
        labels = batch.label, batch.robust, batch.collision
        wanted = [torch.cat(pair, dim=1) for pair in zip(labels, opinion.unbind(dim=-1), strict=True)]
        total = evaluator_loss(said, *wanted)
        return total, {"loss": total.item()}

    def metrics(self) -> dict[str, float]:
        """Of held-out trials, as for any evaluator; of held-out samples, how far off the teacher it is."""
        if self._unseen is None:
            return {}
        with torch.inference_mode(), seeded(self.config.seed) as rng:
            views = rng.choice(self._unseen.num_views, HELD_OUT_VIEWS)
            states, opinion = self._rate(self._unseen, views)
            self.module.eval()
            own = self._probabilities(self.module, self._unseen, views, states)
            self.module.train()
        return {**super().metrics(), "off_teacher": (own - opinion).abs().mean().item()}

    def prepare(self, progress: bool) -> None:
        """The generator's states for each view, and what the teacher says of them."""
        count, pairs = self._data.num_views, self.config.pairs
        states = np.empty((count, pairs, self._generator.state_width), np.float16)
        opinions = np.empty((count, pairs, 3), np.float16)
        with torch.inference_mode(), seeded(self.config.seed):
            for views in view_chunks(count, "samples to rate", progress):
                parts = self._rate(self._data, views)
                states[views], opinions[views] = (part.half().cpu().numpy() for part in parts)
        self._samples = states, opinions

    def _rate(
        self, data: TrainingData, views: Int[np.ndarray, " K"]
    ) -> tuple[Float[Tensor, "K P S"], Float[Tensor, "K P 3"]]:
        """The generator's states for some views, and the teacher's probabilities."""
        objects = view_tensors(data, views).to(self._device)
        noise = torch.randn(len(views), self.config.pairs, self._generator.state_width)
        temperature = self._generator.config.temperature
        *_, states = self._generator.path(objects, (temperature * noise).to(self._device))
        return states, self._probabilities(self._teacher, data, views, states)

    def _probabilities(
        self,
        network: FFHEvaluator,
        data: TrainingData,
        views: Int[np.ndarray, " K"],
        states: Float[Tensor, "K P S"],
    ) -> Float[Tensor, "K P 3"]:
        """Of success, of success under varied physics, and of a start collision; NaN and 0 if not known."""
        logits = network(view_tensors(data, views).to(self._device), self._grasps(states))
        unknown = torch.full_like(logits.success, torch.nan)
        robust = unknown if logits.robust is None else logits.robust.sigmoid()
        collision = torch.zeros_like(unknown) if logits.collision is None else logits.collision.sigmoid()
        return torch.stack([logits.success.sigmoid(), robust, collision], dim=-1)

    def _grasps(self, states: Float[Tensor, "V G S"]) -> GraspTensors:
        """The grasps that states stand for, with joints as they are in use."""
        raw = self._generator.grasps(states)
        return GraspTensors(raw.rotation, raw.position, raw.joints.clamp(self._lower, self._upper))
