"""Where the object is around the hand: the cloud's distance field, read at points of the palm frame."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from torch import Tensor, nn
from torch.nn import functional

from ffhnet.geometry.basis import BASIS_RADIUS, basis_points
from ffhnet.model.config import ModelConfig
from ffhnet.model.placed_links import POSTURES, PlacedLinks
from ffhnet.model.tensors import GraspTensors, ObjectTensors

GRID = 24
"""Nodes of the distance field along each axis, over the ball of basis points: 17 mm apart."""

NEIGHBOURS = 12
"""Basis points from which the distance at a node is fitted."""

NEAR = 0.02
"""m: scale of the feature that tells how close the object is."""

FAR = 0.05
"""m: scale of the features that tell how far away object and table are."""

FAR_LIMIT = 3.0
"""These features end at this many times `FAR`."""

HEIGHT_EVERY = 6
"""The height over the table is read at every sixth point fixed to the palm, and at all points of links."""

LINK_NEAR = 0.01
LINK_HEIGHT = 0.02
"""m: the scales `NEAR` and `FAR` of points on links, for distances and heights: they touch what they grip."""

LINK_BELOW, LINK_ABOVE = -1.0, 3.0
"""Heights of points on links end at these times `LINK_HEIGHT`."""


class DistanceField(nn.Module):
    """The distance to the visible cloud on a regular grid, from the basis point set vector alone.

    The vector holds that distance at thousands of random points; at a node it is the value of the plane
    fitted to the nearest of them, which is linear in the vector, so that the whole grid is one fixed sparse
    matrix. It is right to 2 to 3 mm (root mean square) between 3 and 10 cm from the object, to 4 mm between 1
    and 3 cm, and on average 6.7 ± 3 mm too far within 1 cm, where the grid blurs the surface.
    """

    index: Tensor
    weight: Tensor

    def __init__(self, bps_size: int):
        super().__init__()
        index, weight = _plane_fit(bps_size)
        self.register_buffer("index", torch.tensor(index), persistent=False)
        self.register_buffer("weight", torch.from_numpy(weight).float(), persistent=False)

    def forward(self, bps: Float[Tensor, "V D"]) -> Float[Tensor, "V 1 N N N"]:
        """The field of each view, metres; axes x, y, z."""
        nodes = functional.embedding_bag(
            self.index, bps.T.contiguous(), per_sample_weights=self.weight, mode="sum"
        )
        return nodes.T.reshape(len(bps), 1, GRID, GRID, GRID)

    @staticmethod
    def read(grid: Float[Tensor, "V 1 N N N"], points: Float[Tensor, "V G K 3"]) -> Float[Tensor, "V G K"]:
        """Distances (m) at points (m, view frame); beyond the grid, those at its border."""
        # Torch takes the coordinate of the last axis first.
        place = (points / BASIS_RADIUS).flip(-1).unsqueeze(3)
        values = functional.grid_sample(grid, place, padding_mode="border", align_corners=True)
        return values[:, 0, :, :, 0]


class LocalGeometry(nn.Module):
    """Features of a grasp's surroundings: distances to the object around the hand, heights over the table.

    Args:
        count: points in the palm frame; zero until `set_points` is called. They travel with the weights.
        bps_size: length of the basis point set vector.
        with_heights: whether the height of the table may be used.
        links: points on the hand's links, which move with the joints; these need the height of the table.
    """

    points: Tensor

    def __init__(
        self, count: int, bps_size: int, with_heights: bool = True, links: PlacedLinks | None = None
    ):
        super().__init__()
        self.with_heights = with_heights
        self.field = DistanceField(bps_size)
        self.links = links
        self.register_buffer("points", torch.zeros(count, 3))

    @property
    def width(self) -> int:
        """Number of features of a grasp."""
        count = len(self.points)
        of_links = 0 if self.links is None else 3 * POSTURES * self.links.count
        return 2 * count + (len(range(0, count, HEIGHT_EVERY)) if self.with_heights else 0) + of_links

    def set_points(self, points: Float[np.ndarray, "K 3"]) -> None:
        """Store the points (m, palm frame) at which the field is read."""
        self.points.copy_(torch.as_tensor(points))

    def take_points(self, other: LocalGeometry) -> None:
        """Take over the first points of another, which has as many or more."""
        self.points.copy_(other.points[: len(self.points)])

    def forward(
        self, grid: Float[Tensor, "V 1 N N N"], objects: ObjectTensors, grasps: GraspTensors
    ) -> Float[Tensor, "V G F"]:
        """Features of each grasp; `grid` is the objects' distance field."""
        turned = torch.einsum("vgij,kj->vgki", grasps.rotation, self.points)
        points = turned + grasps.position.unsqueeze(2)
        distance = DistanceField.read(grid, points)
        features = [torch.exp(-distance / NEAR), (distance / FAR).clamp(max=FAR_LIMIT) - 1]
        if self.with_heights:
            height = points[:, :, ::HEIGHT_EVERY, 2] - objects.table_height[:, None, None]
            features.append((height / FAR).clamp(-FAR_LIMIT, FAR_LIMIT))
        if self.links is not None:
            placed = self.links(grasps.joints.flatten(0, 1)).unflatten(0, grasps.joints.shape[:2])
            points = placed @ grasps.rotation.transpose(-1, -2) + grasps.position.unsqueeze(2)
            distance = DistanceField.read(grid, points)
            height = (points[..., 2] - objects.table_height[:, None, None]) / LINK_HEIGHT
            features += [
                torch.exp(-distance / LINK_NEAR),
                (distance / FAR).clamp(max=FAR_LIMIT) - 1,
                height.clamp(LINK_BELOW, LINK_ABOVE),
            ]
        return torch.cat(features, dim=-1)


@lru_cache(maxsize=2)
def _plane_fit(bps_size: int) -> tuple[Int[np.ndarray, "M k"], Float[np.ndarray, "M k"]]:
    """For each node of the grid, basis points and weights whose weighted sum is the fitted plane's value."""
    basis = basis_points(bps_size)
    axis = np.linspace(-BASIS_RADIUS, BASIS_RADIUS, GRID)
    nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, index = cKDTree(basis).query(nodes, k=min(NEIGHBOURS, len(basis)))
    closeness = (distance + 0.002) ** -4
    closeness /= closeness.sum(axis=1, keepdims=True)
    offset = (basis[index] - nodes[:, None]) / 0.02
    design = np.concatenate([np.ones((*index.shape, 1)), offset], axis=-1)
    ridge = np.diag([0.0, 0.01, 0.01, 0.01])
    normal = np.einsum("nki,nk,nkj->nij", design, closeness, design) + ridge
    value_row = np.linalg.inv(normal)[:, 0]
    weight = np.einsum("nj,nkj,nk->nk", value_row, design, closeness)
    # A plane says nothing about nodes outside the ball, in the corners of the grid: there the mean is taken.
    inside = np.linalg.norm(nodes, axis=1, keepdims=True) <= BASIS_RADIUS
    return index, np.where(inside, weight, closeness)


def local_geometry(config: ModelConfig, count: int, with_links: bool = False) -> LocalGeometry | None:
    """The module with the first `count` of a model's palm points, or None if that leaves none.

    Args:
        config: the architecture.
        count: points fixed to the palm.
        with_links: look at the points of the model's links, too, if it has any.
    """
    count = min(count, config.palm_points)
    links = None
    if with_links and config.link_points:
        links = PlacedLinks(config.links, config.link_points, config.num_joints)
    return LocalGeometry(count, config.bps_size, config.use_table_height, links) if count else None
