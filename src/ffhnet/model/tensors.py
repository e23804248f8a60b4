"""What goes through the networks: V views of objects, and G grasps for each, in the view frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.model.config import ModelConfig


@dataclass(frozen=True)
class ObjectTensors:
    """The objects of V views.

    Attributes:
        bps: distances in metres from the basis points to the visible cloud.
        table_height: z of the table in the view frame, metres (negative).
    """

    bps: Float[Tensor, "V 4096"]
    table_height: Float[Tensor, " V"]

    def to(self, device: torch.device) -> ObjectTensors:
        """The same on another device."""
        return ObjectTensors(self.bps.to(device), self.table_height.to(device))

    def repeat(self, grasps_per_view: int) -> ObjectTensors:
        """Each view repeated, so that every grasp has its own: the plain, ungrouped form."""
        return ObjectTensors(
            self.bps.repeat_interleave(grasps_per_view, dim=0),
            self.table_height.repeat_interleave(grasps_per_view, dim=0),
        )


@dataclass(frozen=True)
class GraspTensors:
    """G grasps for each of V views, in the frame of their view.

    Attributes:
        rotation: palm axes as columns.
        position: palm origin, metres.
        joints: joint angles, radians.
    """

    rotation: Float[Tensor, "V G 3 3"]
    position: Float[Tensor, "V G 3"]
    joints: Float[Tensor, "V G J"]

    def to(self, device: torch.device) -> GraspTensors:
        """The same on another device."""
        return GraspTensors(self.rotation.to(device), self.position.to(device), self.joints.to(device))

    @staticmethod
    def joined(parts: Sequence[GraspTensors]) -> GraspTensors:
        """The grasps of several batches of the same views, one after the other."""
        return GraspTensors(
            torch.cat([part.rotation for part in parts], dim=1),
            torch.cat([part.position for part in parts], dim=1),
            torch.cat([part.joints for part in parts], dim=1),
        )

    def ungrouped(self) -> GraspTensors:
        """One grasp per view, V·G views: the partner of `ObjectTensors.repeat`."""
        return GraspTensors(
            self.rotation.flatten(0, 1).unsqueeze(1),
            self.position.flatten(0, 1).unsqueeze(1),
            self.joints.flatten(0, 1).unsqueeze(1),
        )

    def features(self, config: ModelConfig, with_joints: bool) -> Float[Tensor, "V G F"]:
        """Network input: rotation (row-major), scaled position and, if wanted, scaled joints."""
        parts = [self.rotation.flatten(-2), self.position / config.position_scale]
        if with_joints:
            parts.append(self.joints / config.joint_scale)
        return torch.cat(parts, dim=-1)
