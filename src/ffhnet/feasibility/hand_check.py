"""Whether the open hand can take up a grasp: against the table, the object, and all else that was seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int

from ffhnet.feasibility.reasons import Reason
from ffhnet.feasibility.scene import ObservedScene
from ffhnet.feasibility.shapes import PlacedShapes, Shapes
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.perception.observation import Observation
from ffhnet.simulation.physics import Physics

_PITCH = 0.02
_CELL = 0.005
_REACH = 0.022
"""m: the probes of a shape, the cells of the scene, and how far a probe looks."""

_RADIUS = 0.5
"""m around an object within which a hand is on its approach."""


@dataclass(frozen=True)
class Margins:
    """How near the hand may come to what was seen, m; negative is penetration.

    The defaults were chosen against start collisions in physics: `docs/execution.md`, "Margins".

    Attributes:
        table: to the table.
        object: to the object's observed points.
        scene: to all other observed points.
    """

    table: float = 0.004
    object: float = 0.001
    scene: float = 0.004


class HandCheck:
    """Holds one hand's shapes against scenes."""

    def __init__(self, hand: Hand, margins: Margins | None = None, physics: Physics | None = None) -> None:
        """Makes the shapes of a hand ready; `physics` says how long the straight approach is."""
        self.hand = hand
        self.margins = margins or Margins()
        self.physics = physics or Physics()
        self._shapes = Shapes.of(hand.tree, _PITCH)

    def look(self, observation: Observation) -> ObservedScene:
        """The scene of an observation, fine enough for this check."""
        return ObservedScene.of(observation, _RADIUS, _REACH, _CELL)

    def __call__(self, grasps: Grasps, scene: ObservedScene) -> Int[np.ndarray, " N"]:
        """The `Reason` of each grasp (in the input frame of the scene's observation)."""
        margins = self.margins
        reason = np.full(len(grasps), Reason.FEASIBLE, dtype=np.int8)
        T_view_palm = invert(scene.T_input_view) @ make_transform(grasps.rotation, grasps.position)
        retreat = -T_view_palm[:, :3, 0]
        opened = self._place(T_view_palm, self.hand.open(grasps.joints))
        to_table = opened.lowest() - scene.table
        for back in np.linspace(0, self.physics.approach_distance, self.physics.approach_steps):
            left = np.flatnonzero(reason == Reason.FEASIBLE)
            shift = back * retreat[left]
            to_object, to_scene = self._distances(opened, left, shift, scene)
            table_hit = to_table[left] + shift[:, 2] < margins.table
            hits = [table_hit, to_object < margins.object, to_scene < margins.scene]
            kinds = [Reason.TABLE, Reason.OBJECT, Reason.SCENE] if back == 0 else 3 * [Reason.APPROACH]
            reason[left] = np.select(hits, kinds, Reason.FEASIBLE)
        if not scene.of_object.all():
            left = np.flatnonzero(reason == Reason.FEASIBLE)
            closed = self._place(T_view_palm[left], grasps.joints[left])
            _, to_scene = self._distances(closed, np.arange(len(left)), np.zeros((len(left), 3)), scene)
            reason[left] = np.where(to_scene < margins.scene, Reason.SCENE, Reason.FEASIBLE)
        return reason

    def _place(
        self, T_view_palm: Float[np.ndarray, "N 4 4"], joints: Float[np.ndarray, "N J"]
    ) -> PlacedShapes:
        with torch.inference_mode():
            T_palm_body = self.hand.body_poses(torch.as_tensor(joints, dtype=torch.float32)).numpy()
        return self._shapes.place(T_view_palm[:, None].astype(np.float32) @ T_palm_body)

    @staticmethod
    def _distances(
        placed: PlacedShapes,
        rows: Int[np.ndarray, " R"],
        shift: Float[np.ndarray, "R 3"],
        scene: ObservedScene,
    ) -> Float[np.ndarray, "2 R"]:
        """Distances (m) of shifted hands to the object and to all else; infinite where it is far."""
        near = placed.near(scene.grid, rows, shift)
        distance = np.full((2, len(rows)), np.inf, dtype=np.float32)
        other = np.where(scene.of_object[near.point], 0, 1)
        np.minimum.at(distance, (other, near.row), near.distance)
        return distance
