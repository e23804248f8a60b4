"""The losses of section III, equations 3 to 5."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ffhnet.model.evaluator import EvaluatorLogits
from ffhnet.model.generator import LatentGaussian
from ffhnet.model.tensors import GraspTensors

ROTATION_WEIGHT = 1.0
POSITION_WEIGHT = 100.0
JOINTS_WEIGHT = 10.0
KL_WEIGHT = 5e-3
AUXILIARY_WEIGHT = 0.3
"""Of the evaluator's outputs beside success."""


@dataclass(frozen=True)
class GeneratorLoss:
    """Unweighted parts of Eq. 3 and 4; squares are averaged over batch and entries."""

    rotation: Float[Tensor, ""]
    position: Float[Tensor, ""]
    joints: Float[Tensor, ""]
    kl: Float[Tensor, ""]

    def total(self, kl_weight: float, joints_weight: float = JOINTS_WEIGHT) -> Float[Tensor, ""]:
        """Eq. 3, with a KL weight that a schedule may change and the weight of the joints."""
        reconstruction = (
            ROTATION_WEIGHT * self.rotation + POSITION_WEIGHT * self.position + joints_weight * self.joints
        )
        return reconstruction + kl_weight * self.kl


def kl_divergence(latent: LatentGaussian) -> Float[Tensor, ""]:
    """KL of q(z) from N(0, I) in nats: summed over the latents, averaged over the batch."""
    terms = latent.mean.square() + latent.log_variance.exp() - 1 - latent.log_variance
    return 0.5 * terms.sum(-1).mean()


def generator_loss(predicted: GraspTensors, wanted: GraspTensors, latent: LatentGaussian) -> GeneratorLoss:
    """Parts of the FFHGenerator's loss (Eq. 3 and 4)."""
    return GeneratorLoss(
        rotation=functional.mse_loss(predicted.rotation, wanted.rotation),
        position=functional.mse_loss(predicted.position, wanted.position),
        joints=functional.mse_loss(predicted.joints, wanted.joints),
        kl=kl_divergence(latent),
    )


def evaluator_loss(
    logits: EvaluatorLogits,
    success: Float[Tensor, "V G"],
    robust: Float[Tensor, "V G"],
    collision: Float[Tensor, "V G"],
) -> Float[Tensor, ""]:
    """Binary cross-entropy (Eq. 5) of success, and of the outputs beside it where the model has them.

    Args:
        logits: of each grasp.
        success: labels in nominal physics; they may be probabilities.
        robust: labels under varied physics; NaN where a grasp was not repeated.
        collision: 1 where the start collided.
    """
    total = functional.binary_cross_entropy_with_logits(logits.success, success)
    if logits.robust is not None and logits.collision is not None:
        total = total + AUXILIARY_WEIGHT * functional.binary_cross_entropy_with_logits(
            logits.collision, collision
        )
        known = ~robust.isnan()
        if known.any():
            total = total + AUXILIARY_WEIGHT * functional.binary_cross_entropy_with_logits(
                logits.robust[known], robust[known]
            )
    return total
