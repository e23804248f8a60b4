"""The features of `LocalGeometry`, several times faster: one grid for both networks, blended in place."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.geometry.basis import BASIS_RADIUS
from ffhnet.model.local_geometry import FAR, FAR_LIMIT, GRID, HEIGHT_EVERY, NEAR, DistanceField, LocalGeometry

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
        self._heights = geometry.width - 2 * len(points)
        self._points = (points.T / CELL).contiguous()
        parts = (1.0, self.count), (-NEAR / FAR, self.count), (CELL / FAR, self._heights)
        scale = torch.cat([points.new_full((count,), value) for value, count in parts])
        offset = torch.zeros_like(scale)
        offset[self.count : 2 * self.count] = -1
        self.affine = Affine(scale, offset)

    def write(
        self,
        grid: DistanceGrid,
        rotation: Float[Tensor, "G 3 3"],
        position: Float[Tensor, "G 3"],
        out: Float[Tensor, "G F"],
    ) -> None:
        """Fill `out` with the raw features of palms (position in m)."""
        num, count = len(rotation), self.count
        origin = (position.T / CELL + MIDDLE).reshape(3 * num, 1)
        cells = torch.addmm(origin, rotation.transpose(0, 1).reshape(3 * num, 3), self._points)
        cells = cells.view(3, num, count)
        if self._heights:
            height = out[:, 2 * count :]
            torch.sub(cells[2, :, ::HEIGHT_EVERY], grid.table, out=height)
            height.clamp_(-FAR_LIMIT * FAR / CELL, FAR_LIMIT * FAR / CELL)

        within = cells.view(3, -1).clamp_(0, GRID - 1)
        node = within.floor()
        within.sub_(node)
        index = torch.add(node[1], node[0], alpha=GRID)
        index = torch.add(node[2], index, alpha=GRID, out=index).int()
        terms = grid.coefficients.index_select(1, index)
        for axis, half in enumerate((4, 2, 1)):
            terms[:half].addcmul_(terms[half : 2 * half], within[axis])
        value = terms[0].view(num, count)
        torch.exp(value, out=out[:, :count])
        torch.clamp(value, min=-FAR_LIMIT * FAR / NEAR, out=out[:, count : 2 * count])
