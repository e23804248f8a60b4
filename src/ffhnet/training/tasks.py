"""What differs between training the generator and the evaluator: batches, loss and held-out metrics."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.dataset.training_data import TrainingData
from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.metrics import auroc, binary_cross_entropy, expected_calibration_error
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.losses import evaluator_loss, generator_loss, kl_divergence
from ffhnet.training.batches import Batch, BatchMaker
from ffhnet.training.config import TrainingConfig

HELD_OUT_VIEWS, HELD_OUT_GRASPS, HELD_OUT_SEED = 128, 64, 20
"""Size and seed of the fixed batch on which metrics are measured."""

TIME_SPREAD = 1.2
"""Standard deviation of the logit of the flow times that are trained."""


class Task(Protocol):
    """A network together with what it is to learn."""

    @property
    def module(self) -> nn.Module:
        """The network in training."""
        ...

    def prepare(self, progress: bool) -> None:
        """What is computed once, before the first step, with a progress bar if asked for."""
        ...

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Loss of a fresh batch and its parts for the log; noise comes from torch's global generator."""
        ...

    def metrics(self) -> dict[str, float]:
        """Metrics on held-out data, empty without any."""
        ...


class _BatchTask:
    """What the tasks share: a network, where its batches come from, and a fixed held-out batch."""

    def __init__(
        self,
        device: torch.device,
        config: TrainingConfig,
        batches: BatchMaker,
        held_out: BatchMaker | None,
    ):
        self.config = config
        self._device = device
        self._batches = batches
        self._held_out: Batch | None = None
        if held_out is not None:
            rng = np.random.default_rng(HELD_OUT_SEED)
            self._held_out = held_out.draw(rng, HELD_OUT_VIEWS, HELD_OUT_GRASPS).to(device)

    def prepare(self, progress: bool) -> None:
        """Nothing: batches come from the data as they are."""

    def _draw(self, rng: np.random.Generator) -> Batch:
        return self._batches.draw(rng, self.config.views, self.config.grasps).to(self._device)


class _SuccessTask(_BatchTask):
    """The tasks of generators: batches of successful grasps."""

    def __init__(
        self, device: torch.device, config: TrainingConfig, data: TrainingData, held_out: TrainingData | None
    ):
        super().__init__(
            device,
            config,
            BatchMaker.for_generator(data, config.min_local_success, config.min_margin),
            None if held_out is None else BatchMaker.for_generator(held_out),
        )


class GeneratorTask(_SuccessTask):
    """Reconstruct successful grasps through a Gaussian latent (Eq. 3 and 4)."""

    def __init__(
        self, module: FFHGenerator, config: TrainingConfig, data: TrainingData, held_out: TrainingData | None
    ):
        super().__init__(next(module.parameters()).device, config, data, held_out)
        self.module = module

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Eq. 3 on one batch."""
        batch = self._draw(rng)
        noise = torch.randn(*batch.label.shape, self.config.model.latent, device=self._device)
        predicted, latent = self.module(batch.objects, batch.grasps, noise)
        parts = generator_loss(predicted, batch.grasps, latent)
        total = parts.total(self.config.kl_weight_at(step), self.config.joints_weight)
        names = ("rotation", "position", "joints", "kl")
        return total, {"loss": total.item(), **{name: getattr(parts, name).item() for name in names}}

    def metrics(self) -> dict[str, float]:
        """Reconstruction errors and KL on held-out successes."""
        return {} if self._held_out is None else generator_metrics(self.module, self._held_out)


class FlowTask(_SuccessTask):
    """Carry noise to successful grasps along straight paths."""

    def __init__(
        self, module: FlowGenerator, config: TrainingConfig, data: TrainingData, held_out: TrainingData | None
    ):
        super().__init__(next(module.parameters()).device, config, data, held_out)
        self.module = module

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Flow matching loss of one batch; noise and times come from torch's global generator."""
        total = self._loss(self._draw(rng))
        return total, {"loss": total.item()}

    def metrics(self) -> dict[str, float]:
        """The same loss on held-out successes."""
        if self._held_out is None:
            return {}
        self.module.eval()
        with torch.inference_mode(), torch.random.fork_rng():
            torch.manual_seed(HELD_OUT_SEED)
            value = self._loss(self._held_out).item()
        self.module.train()
        return {"velocity_error": value}

    def _loss(self, batch: Batch) -> Tensor:
        noise = torch.randn(*batch.label.shape, self.module.state_width, device=self._device)
        time = flow_times(len(batch.label), self._device)
        return self.module.loss(batch.objects, self.module.states(batch.grasps), noise, time)


class EvaluatorTask(_BatchTask):
    """Predict the success of grasps of all kinds (Eq. 5)."""

    def __init__(
        self, module: FFHEvaluator, config: TrainingConfig, data: TrainingData, held_out: TrainingData | None
    ):
        super().__init__(
            next(module.parameters()).device,
            config,
            BatchMaker.for_evaluator(data, config.shares),
            None if held_out is None else BatchMaker.for_evaluator(held_out, None),
        )
        self.module = module

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Eq. 5 on one batch."""
        batch = self._draw(rng)
        logits = self.module(batch.objects, batch.grasps)
        total = evaluator_loss(logits, batch.label, batch.robust, batch.collision)
        return total, {"loss": total.item()}

    def metrics(self) -> dict[str, float]:
        """Discrimination and calibration on held-out trials, drawn as often as they occur."""
        return {} if self._held_out is None else evaluator_metrics(self.module, self._held_out)


def flow_times(views: int, device: torch.device) -> Float[Tensor, " V"]:
    """The time at which each view's paths are looked at, from torch's global generator.

    A logistic normal spends more steps where noise and grasp mix than at the ends. One time for all grasps of
    a view saves a third of the step: they then share what the object's part computes.
    """
    return torch.sigmoid(TIME_SPREAD * torch.randn(views, device=device))


def generator_metrics(module: FFHGenerator, batch: Batch) -> dict[str, float]:
    """Mean errors of the reconstruction through the latent mean, and the KL divergence."""
    module.eval()
    with torch.inference_mode():
        latent = module.encode(batch.objects, batch.grasps)
        predicted = module.decode(batch.objects, latent.mean)
        kl = kl_divergence(latent).item()
    module.train()
    distance = (predicted.position - batch.grasps.position).norm(dim=-1)
    angle = geodesic_angle(
        predicted.rotation.double().cpu().numpy(), batch.grasps.rotation.double().cpu().numpy()
    )
    return {
        "position_mm": 1000 * distance.mean().item(),
        "rotation_deg": float(np.rad2deg(angle).mean()),
        "joints_rad": (predicted.joints - batch.grasps.joints).abs().mean().item(),
        "kl_nats": kl,
    }


def evaluator_metrics(module: FFHEvaluator, batch: Batch) -> dict[str, float]:
    """AUROC, cross-entropy and expected calibration error of the predicted probabilities."""
    module.eval()
    with torch.inference_mode():
        probability = torch.sigmoid(module(batch.objects, batch.grasps).success).flatten().cpu().numpy()
    module.train()
    label = batch.label.flatten().cpu().numpy()
    return {
        "auroc": auroc(label, probability),
        "bce": binary_cross_entropy(label, probability),
        "ece": expected_calibration_error(label, probability),
    }
