"""What a hand can hit: the object, everything else that the camera saw, and the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ffhnet.feasibility.nearest import NearestGrid
from ffhnet.geometry.transforms import invert
from ffhnet.perception.cells import Cells
from ffhnet.perception.observation import Observation

_OBSTACLE_HEIGHT = 0.012
"""m above the table: lower things are within the noise of the table, and the margin to it keeps them away."""

_ABOVE = 0.8
"""m above the table at which a scene ends."""

_OBJECT_SKIN = 0.012
"""m from an object's points within which other points are taken for the object's, too."""

_ENOUGH = 200_000
"""Points of a capture that are enough to tell what is in it."""

_LONE = 3
"""Points of a cell of twice the side below which they are stray (flying pixels at the edges of objects)."""


@dataclass(frozen=True)
class ObservedScene:
    """Obstacles in the view frame of one object, where z points up.

    Attributes:
        T_input_view: pose of the view frame in the input frame.
        table: z of the table, m.
        grid: observed points above the table, within `radius` of the object's middle.
        of_object: which points of the grid belong to the object.
    """

    T_input_view: Float[np.ndarray, "4 4"]
    table: float
    grid: NearestGrid
    of_object: Bool[np.ndarray, " M"]

    @classmethod
    def of(cls, observation: Observation, radius: float, reach: float, cell: float) -> ObservedScene:
        """The scene of an observation.

        Args:
            observation: what the camera saw.
            radius: m around the object's middle within which points count.
            reach: m from a point within which the grid answers.
            cell: m, side of a cell of the grid.
        """
        T = invert(observation.T_input_view).astype(np.float32)
        table = observation.table_height
        scene = _to_view(T, observation.scene[:: 1 + len(observation.scene) // _ENOUGH])
        near = (scene[2] > table + _OBSTACLE_HEIGHT) & (scene[2] < table + _ABOVE)
        for axis in (0, 1):
            near &= np.abs(scene[axis]) < radius
        seen, own = scene[:, near].T, _to_view(T, observation.cloud).T
        skin = NearestGrid.of(own, _OBJECT_SKIN, _OBJECT_SKIN)
        others = np.delete(seen, skin.look_up(seen.T)[0], axis=0)
        if len(others):
            member = Cells.of(others, 2 * cell).member
            others = others[np.bincount(member)[member] >= _LONE]
        grid = NearestGrid.of(np.concatenate([own, others]), reach, cell)
        return cls(observation.T_input_view, table, grid, grid.source < len(own))


def _to_view(T_view_input: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "N 3"]) -> np.ndarray:
    """3×N coordinates in the view frame."""
    return T_view_input[:3, :3] @ points.T.astype(np.float32) + T_view_input[:3, 3:]
