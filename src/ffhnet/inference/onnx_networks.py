"""Both networks as modules that ONNX can hold: one object, any number of grasps, noise as an input."""

from __future__ import annotations

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ffhnet.inference.calibration import EDGE, Calibration
from ffhnet.model.checkpoint import CheckpointInfo
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.local_geometry import GRID, DistanceField, LocalGeometry
from ffhnet.model.tensors import GraspTensors, ObjectTensors

LARGEST_LOGIT = math.log((1 - EDGE) / EDGE)


class GatheredField(DistanceField):
    """The same field by look-ups: ONNX has no sparse matrices, and no embedding bags."""

    def forward(self, bps: Float[Tensor, "V D"]) -> Float[Tensor, "V 1 N N N"]:
        """The field of each view, metres; axes x, y, z."""
        nodes = (bps[:, self.index.flatten()].unflatten(1, self.index.shape) * self.weight).sum(dim=-1)
        return nodes.reshape(-1, 1, GRID, GRID, GRID)


class OnnxGenerator(nn.Module):
    """Grasps from standard normal noise, as `FFHNet.generate` gives them."""

    INPUTS = "bps", "table_height", "noise"
    OUTPUTS = "rotation", "position", "joints"

    lower: Tensor
    upper: Tensor

    def __init__(self, network: FlowGenerator | FFHGenerator, info: CheckpointInfo):
        super().__init__()
        self.network = network
        self.temperature = info.model.temperature
        self.noise_width = network.state_width if isinstance(network, FlowGenerator) else info.model.latent
        self.register_buffer("lower", torch.tensor(info.joint_lower))
        self.register_buffer("upper", torch.tensor(info.joint_upper))
        if isinstance(network, FlowGenerator):
            _gather(network.geometry, network.config.bps_size)

    def forward(
        self, bps: Float[Tensor, " D"], table_height: Float[Tensor, " 1"], noise: Float[Tensor, "G S"]
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Rotations (G×3×3), positions (G×3, m) and joint angles within their limits (G×J, rad)."""
        objects, start = ObjectTensors(bps.unsqueeze(0), table_height), self.temperature * noise.unsqueeze(0)
        if isinstance(self.network, FlowGenerator):
            *_, last = self.network.path(objects, start)
            grasps = self.network.grasps(last)
        else:
            grasps = self.network.decode(objects, start)
        joints = torch.minimum(torch.maximum(grasps.joints[0], self.lower), self.upper)
        return grasps.rotation[0], grasps.position[0], joints


class OnnxEvaluator(nn.Module):
    """Calibrated probabilities, as `FFHNet.evaluate` gives them."""

    INPUTS = "bps", "table_height", "rotation", "position", "joints"

    def __init__(self, network: FFHEvaluator, success: Calibration | None, robust: Calibration | None):
        super().__init__()
        self.network = network
        self.calibrations = success, robust
        self.outputs = ("probability", "robustness") if network.config.judge_robustness else ("probability",)
        _gather(network.geometry, network.config.bps_size)

    def forward(
        self,
        bps: Float[Tensor, " D"],
        table_height: Float[Tensor, " 1"],
        rotation: Float[Tensor, "G 3 3"],
        position: Float[Tensor, "G 3"],
        joints: Float[Tensor, "G J"],
    ) -> tuple[Tensor, ...]:
        """A probability for each grasp and each of `outputs`."""
        grasps = GraspTensors(rotation.unsqueeze(0), position.unsqueeze(0), joints.unsqueeze(0))
        logits = self.network(ObjectTensors(bps.unsqueeze(0), table_height), grasps)
        values = (logits.success, logits.robust)[: len(self.outputs)]
        pairs = zip(values, self.calibrations, strict=False)
        return tuple(_probability(value[0], calibration) for value, calibration in pairs)


def _gather(geometry: LocalGeometry | None, bps_size: int) -> None:
    if geometry is not None:
        geometry.field = GatheredField(bps_size)


def _probability(logit: Float[Tensor, " G"], calibration: Calibration | None) -> Float[Tensor, " G"]:
    """`Calibration.apply` of a logit."""
    if calibration is not None:
        logit = logit.clamp(-LARGEST_LOGIT, LARGEST_LOGIT)
        small, large = functional.logsigmoid(logit), functional.logsigmoid(-logit)
        logit = calibration.low * small - calibration.high * large + calibration.shift
    return logit.sigmoid()
