"""FFHGenerator: a conditional variational autoencoder of grasps (section III-B, figure 2)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.model.condition import ObjectCondition
from ffhnet.model.config import ModelConfig
from ffhnet.model.resblock import GroupedBatchNorm, ResBlock
from ffhnet.model.tensors import GraspTensors, ObjectTensors


@dataclass(frozen=True)
class LatentGaussian:
    """The encoder's q(z | object, grasp): mean and log-variance per latent dimension."""

    mean: Float[Tensor, "V G L"]
    log_variance: Float[Tensor, "V G L"]

    def sample(self, noise: Float[Tensor, "V G L"]) -> Float[Tensor, "V G L"]:
        """Eq. 2: z = μ + σ ⊙ ε."""
        return self.mean + torch.exp(0.5 * self.log_variance) * noise


class FFHGenerator(nn.Module):
    """Maps an object and a latent sample z ~ N(0, I) to a grasp in the view frame."""

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.config = config
        grasp, condition, width = config.grasp_width(True), config.condition_width, config.width
        self.condition = ObjectCondition(config)

        self.grasp_norm = GroupedBatchNorm(grasp) if config.input_batch_norm else nn.Identity()
        self.encoder_norm = GroupedBatchNorm(condition) if config.input_batch_norm else nn.Identity()
        self.encoder_first = self._block(grasp)
        self.encoder_second = self._block(grasp + width)
        self.latent_mean = nn.Linear(width, config.latent)
        self.latent_log_variance = nn.Linear(width, config.latent)

        self.decoder_norm = GroupedBatchNorm(condition) if config.input_batch_norm else nn.Identity()
        self.decoder_first = self._block(config.latent)
        self.decoder_second = self._block(config.latent + width)
        self.joints_head = nn.Linear(width, config.num_joints)
        self.rotation_head = nn.Linear(width, 6)
        self.position_head = nn.Linear(width, 3)

    def _block(self, own: int) -> ResBlock:
        c = self.config
        return ResBlock(own, c.condition_width, c.inner_width, c.width, c.skip_batch_norm)

    def encode(self, objects: ObjectTensors, grasps: GraspTensors) -> LatentGaussian:
        """Distribution of the latent vector of each grasp."""
        condition = self.encoder_norm(self.condition(objects))
        x0 = self.grasp_norm(grasps.features(self.config, with_joints=True))
        x = self.encoder_first(x0, condition)
        x = self.encoder_second(torch.cat([x0, x], dim=-1), condition)
        return LatentGaussian(self.latent_mean(x), self.latent_log_variance(x))

    def decode(self, objects: ObjectTensors, latent: Float[Tensor, "V G L"]) -> GraspTensors:
        """The grasp of each latent vector; joint angles are not clipped to any limits."""
        condition = self.decoder_norm(self.condition(objects))
        x = self.decoder_first(latent, condition)
        x = self.decoder_second(torch.cat([latent, x], dim=-1), condition)
        return GraspTensors(
            rotation=rotation_from_6d(self.rotation_head(x)),
            position=self.position_head(x) * self.config.position_scale,
            joints=self.joints_head(x) * self.config.joint_scale,
        )

    def sample(self, objects: ObjectTensors, num: int, source: torch.Generator) -> GraspTensors:
        """`num` grasps for each view from latent samples z ~ N(0, temperature² I), drawn on the CPU."""
        noise = torch.randn(len(objects.bps), num, self.config.latent, generator=source)
        return self.decode(objects, self.config.temperature * noise.to(objects.bps.device))

    def forward(
        self, objects: ObjectTensors, grasps: GraspTensors, noise: Float[Tensor, "V G L"]
    ) -> tuple[GraspTensors, LatentGaussian]:
        """Reconstruction of the grasps through a latent sample, and the latent distribution."""
        latent = self.encode(objects, grasps)
        return self.decode(objects, latent.sample(noise)), latent
