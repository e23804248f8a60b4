"""`FlowGenerator` for one object: what depends on object and time alone is computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.inference.distance_grid import DistanceGrid, PalmReader
from ffhnet.model.flow import FlowBlock, FlowGenerator
from ffhnet.model.flow_steps import flow_steps
from ffhnet.model.tensors import GraspTensors


@dataclass(frozen=True)
class FlowView:
    """What all grasps of an object share: scale and shift of each step's and block's norm, and the grid."""

    scale: Float[Tensor, "T B F"]
    shift: Float[Tensor, "T B F"]
    grid: DistanceGrid | None


class FlowEngine:
    """The sampling of a trained `FlowGenerator`, step by step the same numbers up to rounding.

    Args:
        network: the trained network.
        dtype: of the products in its blocks, but for the first step, whose errors grow in all others.
    """

    def __init__(self, network: FlowGenerator, dtype: torch.dtype = torch.float32):
        self._network = network
        self._blocks = [block for block in network.blocks if isinstance(block, FlowBlock)]
        exact, reduced = (
            [(block, *_products(block, kind)) for block in self._blocks] for kind in (torch.float32, dtype)
        )
        self._steps = flow_steps(network.config.flow_steps, network.config.flow_solver)
        self._products = [exact, *([reduced] * (len(self._steps) - 1))]
        time = torch.tensor([step.time for step in self._steps], device=network.frequency.device)
        angle = time.unsqueeze(-1) * network.frequency
        self._clock = network.time_layer(torch.cat([angle.sin(), angle.cos()], dim=-1))
        self._modulation_weight = torch.cat([block.modulation.weight for block in self._blocks])
        self._modulation_bias = torch.cat([block.modulation.bias for block in self._blocks])
        self._norm_weight = torch.stack([block.norm.weight for block in self._blocks])
        self._norm_bias = torch.stack([block.norm.bias for block in self._blocks])
        self._reader = None if network.geometry is None else PalmReader(network.geometry)
        self._first_weight: Tensor = network.first.weight
        self._first_bias: Tensor = network.first.bias
        self.noise_width = network.state_width
        if self._reader is not None:
            affine, width = self._reader.affine, network.state_width
            local = network.first.weight[:, width:]
            self._first_bias = network.first.bias + local @ affine.offset
            self._first_weight = torch.cat([network.first.weight[:, :width], local * affine.scale], dim=-1)

    def look(
        self, condition: Float[Tensor, " C"], grid: DistanceGrid | None
    ) -> Callable[[Float[Tensor, "G S"]], GraspTensors]:
        """The generator of an object's grasps, from the network's condition and the object's grid."""
        n = self._network
        embedded = n.object_second(functional.silu(n.object_layer(condition)))
        context = functional.silu(embedded + self._clock)
        modulation = functional.linear(context, self._modulation_weight, self._modulation_bias)
        scale, shift = modulation.view(len(self._steps), len(self._blocks), 2, -1).unbind(dim=2)
        scale = scale + 1
        view = FlowView(self._norm_weight * scale, self._norm_bias * scale + shift, grid)
        return partial(self._sample, view)

    def _sample(self, view: FlowView, noise: Float[Tensor, "G S"]) -> GraspTensors:
        """A grasp for each row of noise (already scaled by the temperature), as one view of G grasps."""
        n = self._network
        num, width = noise.shape
        seen = noise.new_empty(num, self._first_weight.shape[1])
        state = seen[:, :width]
        state.copy_(noise)
        hidden = noise.new_empty(num, n.config.flow_width)
        before = torch.zeros_like(noise)
        for step, products, scale, shift in zip(
            self._steps, self._products, view.scale, view.shift, strict=True
        ):
            if self._reader is not None and view.grid is not None:
                pose = state[:, :9] * n.deviation[:9] + n.mean[:9]
                position = pose[:, 6:] * n.config.position_scale
                self._reader.write(view.grid, rotation_from_6d(pose[:, :6]), position, seen[:, width:])
            torch.addmm(self._first_bias, seen, self._first_weight.T, out=hidden)
            for b, (block, first, bias, second) in enumerate(products):
                normed = functional.layer_norm(hidden, hidden.shape[1:], scale[b], shift[b], block.norm.eps)
                inner = functional.silu(functional.linear(normed.to(first.dtype), first, bias), inplace=True)
                # What the blocks add up stays in full precision.
                hidden.add_(block.second.bias).add_(functional.linear(inner, second))
            velocity = n.head(hidden)
            state.add_(velocity, alpha=step.now).add_(before, alpha=step.before)
            before = velocity
        return n.grasps(state.unsqueeze(0))


def _products(block: FlowBlock, dtype: torch.dtype) -> tuple[Tensor, Tensor, Tensor]:
    """First weight and bias and second weight of a block."""
    first, second = block.first, block.second
    return first.weight.to(dtype), first.bias.to(dtype), second.weight.to(dtype)
