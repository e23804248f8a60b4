"""One optimiser step of each network, on made-up data of the shape that training has."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor
from torch.nn import functional

from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

VIEWS, GRASPS = 48, 32
"""Of a batch, as in `ffhnet train`."""


def measure_training(clock: Clock) -> dict[str, Times]:
    """Times of a step (draw noise, forward, backward, Adam) of flow and evaluator at their default size."""
    config, source = ModelConfig.default(), torch.Generator().manual_seed(0)
    objects = ObjectTensors(torch.rand(VIEWS, config.bps_size) * 0.2, torch.full((VIEWS,), -0.1))
    grasps = GraspTensors(
        rotation_from_6d(torch.randn(VIEWS, GRASPS, 6, generator=source)),
        torch.randn(VIEWS, GRASPS, 3, generator=source) * 0.1,
        torch.rand(VIEWS, GRASPS, config.num_joints, generator=source),
    )
    label = torch.rand(VIEWS, GRASPS, generator=source).round()
    flow, evaluator = FlowGenerator(config), FFHEvaluator(config)
    adam_flow, adam_evaluator = _adam(flow.parameters()), _adam(evaluator.parameters())

    def flow_step() -> None:
        noise = torch.randn(VIEWS, GRASPS, flow.state_width, generator=source)
        _step(adam_flow, flow.loss(objects, flow.states(grasps), noise, torch.rand(VIEWS, generator=source)))

    def evaluator_step() -> None:
        logits = evaluator(objects, grasps).success
        _step(adam_evaluator, functional.binary_cross_entropy_with_logits(logits, label))

    return clock.in_turns({"generator_step": flow_step, "evaluator_step": evaluator_step})


def _adam(parameters: Iterable[torch.nn.Parameter]) -> torch.optim.Optimizer:
    return torch.optim.Adam(parameters, lr=1e-4)


def _step(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
