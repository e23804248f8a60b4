"""A generator of grasps by flow matching: noise is carried to a grasp along a learned velocity field.

Conditional flow matching with straight paths (Lipman et al. 2023, Liu et al. 2023). Where the cVAE blurs a
grasp by what its latent vector cannot hold, the flow looks again at the object at every step: at the distance
field around the palm pose reached so far.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ffhnet.geometry.rotations import rotation_from_6d, rotation_to_6d
from ffhnet.model.condition import ObjectCondition
from ffhnet.model.config import ModelConfig
from ffhnet.model.flow_steps import flow_steps
from ffhnet.model.local_geometry import local_geometry
from ffhnet.model.tensors import GraspTensors, ObjectTensors

TIME_FREQUENCIES = 16
MAX_FREQUENCY = 100.0
"""rad per unit of flow time (0 is noise, 1 is a grasp)."""

CONDITION_WIDTH = 256


class FlowBlock(nn.Module):
    """A residual block whose normalised input is scaled and shifted by object and time."""

    def __init__(self, width: int):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.modulation = nn.Linear(CONDITION_WIDTH, 2 * width)
        self.first = nn.Linear(width, width)
        self.second = nn.Linear(width, width)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(self.second.bias)

    def forward(self, x: Float[Tensor, "V G F"], context: Float[Tensor, "V 1 C"]) -> Float[Tensor, "V G F"]:
        """The input plus what the block makes of it."""
        scale, shift = self.modulation(context).chunk(2, dim=-1)
        return x + self.second(functional.silu(self.first(self.norm(x) * (1 + scale) + shift)))


class FlowGenerator(nn.Module):
    """Maps an object and noise x ~ N(0, I) to a grasp by integrating dx/dt = v(x, t | object) from 0 to 1.

    The state x holds the palm's rotation (6-D), position and joint angles, each entry standardised over
    the training grasps.
    """

    mean: Tensor
    deviation: Tensor
    frequency: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.config = config
        self.state_width = 9 + config.num_joints
        self.condition = ObjectCondition(config)
        self.geometry = local_geometry(config, config.flow_palm_points)
        local = 0 if self.geometry is None else self.geometry.width
        width = config.flow_width
        self.object_layer = nn.Linear(config.condition_width, CONDITION_WIDTH)
        self.object_second = nn.Linear(CONDITION_WIDTH, CONDITION_WIDTH)
        self.time_layer = nn.Linear(2 * TIME_FREQUENCIES, CONDITION_WIDTH)
        self.first = nn.Linear(self.state_width + local, width)
        self.blocks = nn.ModuleList(FlowBlock(width) for _ in range(config.flow_blocks))
        self.head = nn.Linear(width, self.state_width)
        nn.init.zeros_(self.head.weight)
        self.register_buffer("mean", torch.zeros(self.state_width))
        self.register_buffer("deviation", torch.ones(self.state_width))
        frequency = torch.exp(torch.linspace(0, math.log(MAX_FREQUENCY), TIME_FREQUENCIES))
        self.register_buffer("frequency", frequency, persistent=False)

    def set_statistics(self, grasps: GraspTensors) -> None:
        """Take mean and deviation of the state's entries from training grasps."""
        rows = self._raw(grasps).flatten(0, 1)
        self.mean.copy_(rows.mean(dim=0))
        self.deviation.copy_(rows.std(dim=0).clamp(min=1e-3))

    def take_constants(self, other: FlowGenerator) -> None:
        """Take over what training does not change: projection, statistics, and its share of palm points."""
        self.condition.load_state_dict(other.condition.state_dict())
        self.mean.copy_(other.mean)
        self.deviation.copy_(other.deviation)
        if self.geometry is not None and other.geometry is not None:
            self.geometry.take_points(other.geometry)

    def loss(
        self,
        objects: ObjectTensors,
        states: Float[Tensor, "V G S"],
        noise: Float[Tensor, "V G S"],
        time: Float[Tensor, " V"],
        weight: Float[Tensor, "V G"] | None = None,
    ) -> Float[Tensor, ""]:
        """Mean square error of the velocity at each view's time along straight paths from noise to states.

        With weights, of mean 1, some states count more than others.
        """
        t = time[:, None, None]
        velocity = self._velocity(self._look(objects), (1 - t) * noise + t * states, time)
        off = (velocity - (states - noise)).square()
        return off.mean() if weight is None else (weight * off.mean(dim=-1)).mean()

    def states(self, grasps: GraspTensors) -> Float[Tensor, "V G S"]:
        """The states that stand for grasps; `grasps` is the way back."""
        return (self._raw(grasps) - self.mean) / self.deviation

    def sample(self, objects: ObjectTensors, num: int, source: torch.Generator) -> GraspTensors:
        """`num` grasps for each view in `flow_steps` steps; joint angles are not clipped.

        Args:
            objects: V views.
            num: grasps per view.
            source: of the noise, on the CPU.
        """
        noise = torch.randn(len(objects.bps), num, self.state_width, generator=source)
        *_, last = self.path(objects, self.config.temperature * noise.to(objects.bps.device))
        return self.grasps(last)

    def path(self, objects: ObjectTensors, noise: Float[Tensor, "V G S"]) -> Iterator[Float[Tensor, "V G S"]]:
        """The states after each of the `flow_steps` steps; the last is a grasp."""
        view, x, before = self._look(objects), noise, torch.zeros_like(noise)
        for step in flow_steps(self.config.flow_steps, self.config.flow_solver):
            time = torch.full((len(noise),), step.time, device=noise.device)
            velocity = self._velocity(view, x, time)
            x = x + step.now * velocity + step.before * before
            before = velocity
            yield x

    def grasps(self, x: Float[Tensor, "V G S"]) -> GraspTensors:
        """The grasps that states stand for; joint angles are not clipped."""
        raw = x * self.deviation + self.mean
        return GraspTensors(
            rotation=rotation_from_6d(raw[..., :6]),
            position=raw[..., 6:9] * self.config.position_scale,
            joints=raw[..., 9:] * self.config.joint_scale,
        )

    def _raw(self, grasps: GraspTensors) -> Float[Tensor, "V G S"]:
        position = grasps.position / self.config.position_scale
        joints = grasps.joints / self.config.joint_scale
        return torch.cat([rotation_to_6d(grasps.rotation), position, joints], dim=-1)

    def _look(self, objects: ObjectTensors) -> tuple[ObjectTensors, Tensor, Tensor | None]:
        """What all steps share: the objects, their embedding and their distance fields."""
        embedded = self.object_second(functional.silu(self.object_layer(self.condition(objects))))
        return objects, embedded, None if self.geometry is None else self.geometry.field(objects.bps)

    def _velocity(
        self,
        view: tuple[ObjectTensors, Tensor, Tensor | None],
        x: Float[Tensor, "V G S"],
        time: Float[Tensor, " V"],
    ) -> Float[Tensor, "V G S"]:
        objects, embedded, grid = view
        angle = time.unsqueeze(-1) * self.frequency
        clock = self.time_layer(torch.cat([angle.sin(), angle.cos()], dim=-1))
        context = functional.silu(embedded + clock).unsqueeze(1)
        seen = x
        if self.geometry is not None and grid is not None:
            seen = torch.cat([x, self.geometry(grid, objects, self.grasps(x))], dim=-1)
        hidden = self.first(seen)
        for block in self.blocks:
            hidden = block(hidden, context)
        return self.head(hidden)
