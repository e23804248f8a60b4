"""Points sorted into the cells of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from ffhnet.perception.cloud import bounding_box


@dataclass(frozen=True)
class Cells:
    """Which cells of a grid hold some of N points; a cell's index counts with z fastest.

    Attributes:
        origin: corner of the first cell, m.
        shape: number of cells along each axis.
        number: for each cell, 1 + its place in `occupied`, 0 where it is empty.
        occupied: index of each cell that holds points.
        member: for each point, the place of its cell in `occupied`.
        source: index of one of the points of each occupied cell.
    """

    origin: Float[np.ndarray, " 3"]
    shape: tuple[int, int, int]
    number: Int[np.ndarray, " C"]
    occupied: Int[np.ndarray, " M"]
    member: Int[np.ndarray, " N"]
    source: Int[np.ndarray, " M"]

    @classmethod
    def of(cls, points: Float[np.ndarray, "N 3"], cell: float, border: int = 0) -> Cells:
        """Cells of a side (m) around points (m), with empty ones around them; at least one point."""
        origin = bounding_box(points)[0] - border * points.dtype.type(cell)
        cells = ((points - origin) * points.dtype.type(1 / cell)).astype(np.int32)
        nx, ny, nz = (int(n) for n in bounding_box(cells)[1] + border + 1)
        keys = (cells[:, 0] * ny + cells[:, 1]) * nz + cells[:, 2]
        # As `np.unique`, without sorting: of the points of a cell the last one stays.
        number = np.zeros(nx * ny * nz, dtype=np.int32)
        rows = np.arange(len(points), dtype=np.int32)
        number[keys] = rows
        source = np.flatnonzero(number[keys] == rows)
        number[keys[source]] = np.arange(1, len(source) + 1)
        return cls(origin, (nx, ny, nz), number, keys[source], number[keys] - 1, source)

    def steps(self, radius: float) -> Int[np.ndarray, " S"]:
        """From a cell's index to those of all cells within a radius (in cells) of it, far ones first."""
        x, y, z = _ball(radius).T
        _, ny, nz = self.shape
        return (x * ny + y) * nz + z


@lru_cache(maxsize=8)
def _ball(radius: float) -> Int[np.ndarray, "S 3"]:
    """Offsets to all cells within a radius (in cells), far ones first."""
    reach = int(np.ceil(radius))
    steps = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    length = np.linalg.norm(steps, axis=1)
    order = np.argsort(-length, kind="stable")
    return steps[order[length[order] <= radius]]
