"""Where the points of a hand's links are for given joint angles: forward kinematics inside a network."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ffhnet.hands.kinematics import link_poses
from ffhnet.hands.link_points import DEGREE, LinkPoints

POSTURES = 2
"""Of the hand: open, as it comes, and with the grasp's joints."""


class PlacedLinks(nn.Module):
    """Points on the links of the open hand and of the hand with the grasp's joints, in the palm frame.

    All that is known of the hand are buffers that travel with the weights; until `take` or a checkpoint
    gives them they are zero.

    Args:
        links: number of links.
        count: number of points.
        num_joints: actuated joints.
    """

    parent: Tensor
    fixed: Tensor
    axis: Tensor
    leader: Tensor
    powers: Tensor
    opened: Tensor
    closes: Tensor
    points: Tensor
    link: Tensor

    def __init__(self, links: int, count: int, num_joints: int):
        super().__init__()
        self.count = count
        for name, shape in (
            ("fixed", (links, 4, 4)),
            ("axis", (links, 3, 1)),
            ("powers", (links, DEGREE + 1, 1)),
            ("opened", (num_joints,)),
            ("points", (count, 3, 1)),
        ):
            self.register_buffer(name, torch.zeros(shape))
        for name, size in (("parent", links), ("leader", links), ("link", count)):
            self.register_buffer(name, torch.zeros(size, dtype=torch.int64))
        self.register_buffer("closes", torch.zeros(num_joints, dtype=torch.bool))

    def take(self, hand: LinkPoints) -> None:
        """Store a hand."""
        for name, buffer in self.named_buffers():
            buffer.copy_(torch.as_tensor(getattr(hand, name)).reshape(buffer.shape))

    def is_sound(self) -> bool:
        """Whether every link comes after its parent, and every joint and link that is named exists."""
        links, joints = len(self.parent), len(self.opened)
        earlier = torch.arange(-1, links - 1, device=self.parent.device).clamp(min=0)
        lowest = min(int(self.parent.min()), int(self.leader.min()), int(self.link.min()))
        return (
            lowest >= 0
            and bool((self.parent <= earlier).all())
            and int(self.leader.max()) < joints
            and int(self.link.max()) < links
        )

    def forward(self, joints: Float[Tensor, "N J"]) -> Float[Tensor, "N P 3"]:
        """The P = 2K points (m): those of the open hand, then those with these joint angles (rad)."""
        opened = torch.where(self.closes, self.opened, joints)
        poses = self._poses(torch.cat([opened, joints]))[:, self.link]
        points = (poses[..., :3, :3] @ self.points).squeeze(-1) + poses[..., :3, 3]
        return torch.cat(points.split(len(joints)), dim=1)

    def _poses(self, joints: Float[Tensor, "M J"]) -> Float[Tensor, "M L 4 4"]:
        """Pose of each link in the palm frame."""
        of_leader = joints[:, self.leader]
        angle = torch.zeros_like(of_leader)
        for power in reversed(range(DEGREE + 1)):
            angle = angle * of_leader + self.powers[:, power, 0]
        return link_poses(self.fixed, self.axis.squeeze(-1), self.parent.tolist(), angle)
