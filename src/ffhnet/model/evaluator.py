"""FFHEvaluator: the probability that a grasp lifts the object (section III-C, figure 3)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.model.condition import ObjectCondition
from ffhnet.model.config import ModelConfig
from ffhnet.model.resblock import GroupedBatchNorm, ResBlock
from ffhnet.model.tensors import GraspTensors, ObjectTensors


class FFHEvaluator(nn.Module):
    """Three ResBlocks with skip connections from the input to each; the output is a logit."""

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.config = config
        grasp, condition, width = config.grasp_width(config.use_joints), config.condition_width, config.width
        self.condition = ObjectCondition(config)
        self.grasp_norm = GroupedBatchNorm(grasp) if config.input_batch_norm else nn.Identity()
        self.condition_norm = GroupedBatchNorm(condition) if config.input_batch_norm else nn.Identity()
        self.blocks = nn.ModuleList(
            ResBlock(own, condition, config.inner_width, width, config.skip_batch_norm)
            for own in (grasp, width + grasp, width + grasp)
        )
        self.dropout = nn.Dropout(config.dropout)
        self.head = nn.Linear(width, 1)

    def forward(self, objects: ObjectTensors, grasps: GraspTensors) -> Float[Tensor, "V G"]:
        """Logits; `torch.sigmoid` makes success probabilities of them."""
        condition = self.condition_norm(self.condition(objects))
        x0 = self.grasp_norm(grasps.features(self.config, with_joints=self.config.use_joints))
        first, *others = self.blocks
        x = self.dropout(first(x0, condition))
        for block in others:
            x = self.dropout(block(torch.cat([x, x0], dim=-1), condition))
        return self.head(x).squeeze(-1)
