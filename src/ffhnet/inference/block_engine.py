"""Networks of ResBlocks for one object: batch norms folded into weights, the object's part computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.inference.distance_grid import Affine, DistanceGrid, PalmReader
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.resblock import LEAK, ResBlock
from ffhnet.model.tensors import GraspTensors


def norm_affine(norm: nn.Module, width: int, like: Tensor) -> Affine:
    """The affine map that a batch norm is at inference; an Identity keeps its `width` inputs."""
    if not isinstance(norm, nn.BatchNorm1d):
        return Affine(like.new_ones(width), like.new_zeros(width))
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return Affine(scale, norm.bias - norm.running_mean * scale)


class FoldedBlock:
    """A `ResBlock` at inference: the first layers of both paths are one layer, and all norms are gone.

    Args:
        block: the trained block.
        own: how raw columns become the inputs that differ between grasps.
        condition: how the object's condition becomes the shared inputs.
    """

    def __init__(self, block: ResBlock, own: Affine, condition: Affine):
        weights, biases = [], []
        for layer, norm in ((block.first, block.first_norm), (block.skip, block.skip_norm)):
            weight, bias = layer.linear.weight, layer.linear.bias
            affine = norm_affine(norm, len(bias), bias)
            weights.append(weight * affine.scale.unsqueeze(-1))
            biases.append(bias * affine.scale + affine.offset)
        weight = torch.cat(weights)
        inputs, shared = weight[:, : block.first.own], weight[:, block.first.own :]
        self.inner = len(biases[0])
        self._bias = torch.cat(biases) + inputs @ own.offset + shared @ condition.offset
        self._shared = (shared * condition.scale).contiguous()
        self._first = (inputs * own.scale).T.contiguous()
        second = norm_affine(block.second_norm, block.second.out_features, block.second.bias)
        self._second = (block.second.weight * second.scale.unsqueeze(-1)).T.contiguous()
        self._second_bias = block.second.bias * second.scale + second.offset

    def look(self, condition: Float[Tensor, " C"]) -> Float[Tensor, " F"]:
        """The object's part of the first layers."""
        return functional.linear(condition, self._shared, self._bias)

    def write(
        self,
        seen: Float[Tensor, " F"],
        x: Float[Tensor, "G own"],
        wide: Float[Tensor, "G F"],
        out: Float[Tensor, "G out"],
    ) -> None:
        """The block's output; `wide` is for what lies between, and `out` may be columns of `x`."""
        functional.leaky_relu_(torch.addmm(seen, x, self._first, out=wide), LEAK)
        skip = wide[:, self.inner :]
        skip.addmm_(wide[:, : self.inner], self._second)
        functional.leaky_relu_(torch.add(skip, self._second_bias, out=out), LEAK)


@dataclass(frozen=True)
class BlocksView:
    """What all grasps of an object share: its part of each block's first layers, and the grid."""

    blocks: tuple[Float[Tensor, " F"], ...]
    grid: DistanceGrid | None


class DecoderEngine:
    """The decoder of a trained `FFHGenerator`."""

    def __init__(self, network: FFHGenerator):
        config = network.config
        self._config = config
        like = network.rotation_head.weight
        condition = norm_affine(network.decoder_norm, config.condition_width, like)
        self._blocks = [
            FoldedBlock(block, norm_affine(nn.Identity(), block.first.own, like), condition)
            for block in (network.decoder_first, network.decoder_second)
        ]
        heads = network.rotation_head, network.position_head, network.joints_head
        self._head_weight = torch.cat([head.weight for head in heads])
        self._head_bias = torch.cat([head.bias for head in heads])
        self.noise_width = config.latent

    def look(
        self, condition: Float[Tensor, " C"], grid: DistanceGrid | None
    ) -> Callable[[Float[Tensor, "G L"]], GraspTensors]:
        """The generator of an object's grasps, from the network's condition."""
        return partial(self._sample, BlocksView(tuple(block.look(condition) for block in self._blocks), grid))

    def _sample(self, view: BlocksView, noise: Float[Tensor, "G L"]) -> GraspTensors:
        """The grasp of each latent vector, as one view of G grasps."""
        first, second = self._blocks
        num, latent = noise.shape
        joined = noise.new_empty(num, latent + self._config.width)
        joined[:, :latent] = noise
        x, wide = joined[:, latent:], noise.new_empty(num, len(view.blocks[0]))
        first.write(view.blocks[0], joined[:, :latent], wide, x)
        second.write(view.blocks[1], joined, wide, x)
        raw = functional.linear(x, self._head_weight, self._head_bias).unsqueeze(0)
        return GraspTensors(
            rotation=rotation_from_6d(raw[..., :6]),
            position=raw[..., 6:9] * self._config.position_scale,
            joints=raw[..., 9:] * self._config.joint_scale,
        )


class EvaluatorEngine:
    """A trained `FFHEvaluator`."""

    def __init__(self, network: FFHEvaluator):
        self._network = network
        self._config = config = network.config
        like = network.head.weight
        self._reader = None if network.geometry is None else PalmReader(network.geometry)
        self._own_width = config.grasp_width(config.use_joints)
        grasp = norm_affine(network.grasp_norm, self._own_width, like)
        scale, offset = [grasp.scale], [grasp.offset]
        self._local = network.local
        if self._reader is not None:
            affine = self._reader.affine
            if network.local is not None:
                self._local_weight = (network.local.weight * affine.scale).T.contiguous()
                self._local_bias = network.local.bias + network.local.weight @ affine.offset
                affine = norm_affine(nn.Identity(), config.local_width, like)
            scale.append(affine.scale)
            offset.append(affine.offset)
        kept = norm_affine(nn.Identity(), config.width, like)
        own = Affine(torch.cat(scale), torch.cat(offset))
        joined = Affine(torch.cat([kept.scale, own.scale]), torch.cat([kept.offset, own.offset]))
        condition = norm_affine(network.condition_norm, config.condition_width, like)
        first, *others = (block for block in network.blocks if isinstance(block, ResBlock))
        self._blocks = [
            FoldedBlock(first, own, condition),
            *(FoldedBlock(block, joined, condition) for block in others),
        ]
        self._joined_width = len(joined.scale)

    def look(
        self, condition: Float[Tensor, " C"], grid: DistanceGrid | None
    ) -> Callable[[GraspTensors], tuple[Float[Tensor, "1 G"], ...]]:
        """The judge of an object's grasps, from the network's condition and the object's grid."""
        return partial(self._rate, BlocksView(tuple(block.look(condition) for block in self._blocks), grid))

    def _rate(self, view: BlocksView, grasps: GraspTensors) -> tuple[Float[Tensor, "1 G"], ...]:
        """Logits of the grasps of one view."""
        c, width = self._config, self._config.width
        num = grasps.rotation.shape[1]
        joined = grasps.rotation.new_empty(num, self._joined_width)
        x, own = joined[:, :width], joined[:, width:]
        own[:, : self._own_width] = grasps.features(c, with_joints=c.use_joints)[0]
        if self._reader is not None and view.grid is not None:
            rotation, position, joints = grasps.rotation[0], grasps.position[0], grasps.joints[0]
            around = own[:, self._own_width :]
            raw = around if self._local is None else around.new_empty(num, self._reader.width)
            self._reader.write(view.grid, rotation, position, raw, joints)
            if self._local is not None:
                around.copy_(functional.silu(torch.addmm(self._local_bias, raw, self._local_weight)))
        wide = joined.new_empty(num, len(view.blocks[0]))
        for b, (block, seen) in enumerate(zip(self._blocks, view.blocks, strict=True)):
            block.write(seen, own if b == 0 else joined, wide, x)
        return self._network.head(x).unsqueeze(0).unbind(dim=-1)
