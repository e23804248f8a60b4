"""The features of `LocalGeometry`, several times faster: one grid for both networks, blended in place."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.geometry.basis import BASIS_RADIUS
from ffhnet.model.local_geometry import (
    FAR,
    FAR_LIMIT,
    GRID,
    HEIGHT_EVERY,
    LINK_ABOVE,
    LINK_BELOW,
    LINK_HEIGHT,
    LINK_NEAR,
    NEAR,
    DistanceField,
    LocalGeometry,
)
from ffhnet.model.placed_links import POSTURES

CELL = 2 * BASIS_RADIUS / (GRID - 1)
"""m between two nodes of the distance field."""

MIDDLE = (GRID - 1) / 2
"""Coordinate of the view frame's origin, counted in cells."""


@dataclass(frozen=True)
class Affine:
    """What turns raw columns into the inputs that a network was trained on: raw * scale + offset."""

    scale: Float[Tensor, " F"]
    offset: Float[Tensor, " F"]


@dataclass(frozen=True)
class DistanceGrid:
    """The distance field of one object, ready to be read.

    Attributes:
        coefficients: of -distance/NEAR as a polynomial in the place within each cell, z fastest: 1, z, y,
            yz, x, xz, xy, xyz. The last node of an axis has no slope along it: beyond it is as at the border.
        table: z of the table in the view frame, counted in cells.
    """

    coefficients: Float[Tensor, "8 N3"]
    table: Float[Tensor, ""]


class GridMaker:
    """Makes the grid of an object: `DistanceField` with its sparse matrix laid out for a single vector."""

    def __init__(self, field: DistanceField):
        self._index = field.index.T.flatten()
        self._weight = field.weight.T / -NEAR

    def __call__(self, bps: Float[Tensor, " D"], table_height: Float[Tensor, ""]) -> DistanceGrid:
        """The grid of one object, from its basis point set vector and the table's height (m)."""
        terms = bps.index_select(0, self._index).view_as(self._weight).mul_(self._weight)
        c = terms.new_zeros(8, GRID, GRID, GRID)
        torch.sum(terms, dim=0, out=c[0].view(-1))
        torch.sub(c[:1, :, :, 1:], c[:1, :, :, :-1], out=c[1:2, :, :, :-1])
        torch.sub(c[:2, :, 1:], c[:2, :, :-1], out=c[2:4, :, :-1])
        torch.sub(c[:4, 1:], c[:4, :-1], out=c[4:, :-1])
        return DistanceGrid(c.view(8, -1), table_height / CELL + MIDDLE)


class PalmReader:
    """Reads grids around palms.

    It writes raw features, of which `affine` says how they become those of `LocalGeometry`: folded into the
    first layer of a network that costs nothing.
    """

    def __init__(self, geometry: LocalGeometry):
        points = geometry.points
        self.count, self.width = len(points), geometry.width
        self._links = geometry.links
        self._on_links = 0 if geometry.links is None else POSTURES * geometry.links.count
        self._heights = geometry.width - 2 * self.count - 3 * self._on_links
        self._points = (points.T / CELL).contiguous()
        parts = (
            (self.count, 1.0, 0.0),
            (self.count, -NEAR / FAR, -1.0),
            (self._heights, CELL / FAR, 0.0),
            (self._on_links, 1.0, 0.0),
            (self._on_links, -NEAR / FAR, -1.0),
            (self._on_links, CELL / LINK_HEIGHT, 0.0),
        )
        scale = torch.cat([points.new_full((count,), value) for count, value, _ in parts])
        offset = torch.cat([points.new_full((count,), value) for count, _, value in parts])
        self.affine = Affine(scale, offset)

    def write(
        self,
        grid: DistanceGrid,
        rotation: Float[Tensor, "G 3 3"],
        position: Float[Tensor, "G 3"],
        out: Float[Tensor, "G F"],
        joints: Float[Tensor, "G J"] | None = None,
    ) -> None:
        """Fill `out` with the raw features of grasps (position in m; joints in rad where links are read)."""
        num, count = len(rotation), self.count
        origin = position.T / CELL + MIDDLE
        turned = rotation.transpose(0, 1).reshape(3 * num, 3)
        cells = torch.addmm(origin.reshape(3 * num, 1), turned, self._points).view(3, num, count)
        if self._heights:
            limit = FAR_LIMIT * FAR / CELL
            height = out[:, 2 * count : 2 * count + self._heights]
            torch.sub(cells[2, :, ::HEIGHT_EVERY], grid.table, out=height).clamp_(-limit, limit)
        value = _read(grid, cells)
        torch.exp(value, out=out[:, :count])
        torch.clamp(value, min=-FAR_LIMIT * FAR / NEAR, out=out[:, count : 2 * count])
        if self._links is not None and joints is not None:
            placed = torch.bmm(self._links(joints), rotation.transpose(1, 2)) / CELL
            cells = placed.permute(2, 0, 1) + origin.unsqueeze(-1)
            near, far, height = out[:, -3 * self._on_links :].chunk(3, dim=1)
            low, high = (end * LINK_HEIGHT / CELL for end in (LINK_BELOW, LINK_ABOVE))
            torch.sub(cells[2], grid.table, out=height).clamp_(low, high)
            value = _read(grid, cells)
            torch.exp(value * (NEAR / LINK_NEAR), out=near)
            torch.clamp(value, min=-FAR_LIMIT * FAR / NEAR, out=far)


def _read(grid: DistanceGrid, cells: Float[Tensor, "3 G K"]) -> Float[Tensor, "G K"]:
    """-distance/NEAR at places counted in cells, which are moved to the border where they lie beyond."""
    within = cells.reshape(3, -1).clamp_(0, GRID - 1)
    node = within.floor()
    within.sub_(node)
    index = torch.add(node[1], node[0], alpha=GRID)
    index = torch.add(node[2], index, alpha=GRID, out=index).int()
    terms = grid.coefficients.index_select(1, index)
    for axis, half in enumerate((4, 2, 1)):
        terms[:half].addcmul_(terms[half : 2 * half], within[axis])
    return terms[0].view(cells.shape[1:])
