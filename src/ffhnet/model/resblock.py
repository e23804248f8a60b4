"""The fully connected residual block of section III-E, fed with a part that all grasps of a view share."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

LEAK = 0.2
"""Negative slope of every LeakyReLU (public code)."""


def leaky_relu(x: Tensor) -> Tensor:
    """LeakyReLU with the slope used everywhere here."""
    return functional.leaky_relu(x, LEAK)


class GroupedBatchNorm(nn.BatchNorm1d):
    """Batch norm over all leading axes of (V, G, F) or (V, F)."""

    def forward(self, input: Float[Tensor, "*batch F"]) -> Float[Tensor, "*batch F"]:
        """Normalise each feature."""
        return super().forward(input.flatten(0, -2)).view_as(input)


class ConditionedLinear(nn.Module):
    """A fully connected layer on [x, condition], where the condition is shared by the G grasps of a view.

    The same numbers as concatenating the two, but the condition's share is computed once per view.
    """

    def __init__(self, own: int, condition: int, out: int):
        super().__init__()
        self.own = own
        self.linear = nn.Linear(own + condition, out)

    def forward(
        self, x: Float[Tensor, "V G own"], condition: Float[Tensor, "V condition"]
    ) -> Float[Tensor, "V G out"]:
        """W [x, condition] + b."""
        weight = self.linear.weight
        shared = functional.linear(condition, weight[:, self.own :], self.linear.bias)
        return functional.linear(x, weight[:, : self.own]) + shared.unsqueeze(1)


class ResBlock(nn.Module):
    """FC ResBlock: two FC layers beside one FC layer, each with batch norm, summed.

    Args:
        own: width of the input that differs between grasps.
        condition: width of the input shared by the grasps of a view.
        inner: width between the two layers of the main path.
        out: output width.
        skip_batch_norm: batch norm on the skip path (in the paper, not in the public code).
    """

    def __init__(self, own: int, condition: int, inner: int, out: int, skip_batch_norm: bool):
        super().__init__()
        self.first = ConditionedLinear(own, condition, inner)
        self.first_norm = GroupedBatchNorm(inner)
        self.second = nn.Linear(inner, out)
        self.second_norm = GroupedBatchNorm(out)
        self.skip = ConditionedLinear(own, condition, out)
        self.skip_norm = GroupedBatchNorm(out) if skip_batch_norm else nn.Identity()

    def forward(
        self, x: Float[Tensor, "V G own"], condition: Float[Tensor, "V condition"]
    ) -> Float[Tensor, "V G out"]:
        """Block output for each grasp."""
        main = leaky_relu(self.first_norm(self.first(x, condition)))
        main = self.second_norm(self.second(main))
        skip = leaky_relu(self.skip_norm(self.skip(x, condition)))
        return leaky_relu(torch.add(main, skip))
