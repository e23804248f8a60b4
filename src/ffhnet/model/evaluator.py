"""FFHEvaluator: the probability that a grasp lifts the object (section III-C, figure 3)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ffhnet.model.condition import ObjectCondition
from ffhnet.model.config import ModelConfig
from ffhnet.model.local_geometry import local_geometry
from ffhnet.model.resblock import GroupedBatchNorm, ResBlock
from ffhnet.model.tensors import GraspTensors, ObjectTensors


@dataclass(frozen=True)
class EvaluatorLogits:
    """What the evaluator says of each grasp; `torch.sigmoid` makes probabilities of logits.

    Attributes:
        success: the grasp lifts the object in nominal physics.
        robust: it does so with another mass, friction and palm pose; None where the model has no such output.
        collision: the open hand collides before it closes; None likewise.
    """

    success: Float[Tensor, "V G"]
    robust: Float[Tensor, "V G"] | None = None
    collision: Float[Tensor, "V G"] | None = None


class FFHEvaluator(nn.Module):
    """Three ResBlocks with skip connections from the input to each, and one output per logit."""

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.config = config
        grasp, condition, width = config.grasp_width(config.use_joints), config.condition_width, config.width
        self.condition = ObjectCondition(config)
        self.geometry = local_geometry(config, config.palm_points, with_links=True)
        self.grasp_norm = GroupedBatchNorm(grasp) if config.input_batch_norm else nn.Identity()
        self.condition_norm = GroupedBatchNorm(condition) if config.input_batch_norm else nn.Identity()
        own, self.local = grasp, None
        if self.geometry is not None:
            own += config.local_width or self.geometry.width
            if config.local_width:
                self.local = nn.Linear(self.geometry.width, config.local_width)
        self.blocks = nn.ModuleList(
            ResBlock(width_in, condition, config.inner_width, width, config.skip_batch_norm)
            for width_in in (own, width + own, width + own)
        )
        self.dropout = nn.Dropout(config.dropout)
        self.head = nn.Linear(width, 3 if config.judge_robustness else 1)

    def take_constants(self, other: FFHEvaluator) -> None:
        """Take over what training does not change: projection, and its share of palm points."""
        self.condition.load_state_dict(other.condition.state_dict())
        if self.geometry is not None and other.geometry is not None:
            self.geometry.take_points(other.geometry)

    def forward(self, objects: ObjectTensors, grasps: GraspTensors) -> EvaluatorLogits:
        """Logits of each grasp."""
        condition = self.condition_norm(self.condition(objects))
        x0 = self.grasp_norm(grasps.features(self.config, with_joints=self.config.use_joints))
        if self.geometry is not None:
            around = self.geometry(self.geometry.field(objects.bps), objects, grasps)
            if self.local is not None:
                around = functional.silu(self.local(around))
            x0 = torch.cat([x0, around], dim=-1)
        first, *others = self.blocks
        x = self.dropout(first(x0, condition))
        for block in others:
            x = self.dropout(block(torch.cat([x, x0], dim=-1), condition))
        return EvaluatorLogits(*self.head(x).unbind(dim=-1))
