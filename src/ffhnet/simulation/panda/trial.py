"""The grasp trial with the hand on the arm."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ffhnet.grasps import Grasps
from ffhnet.simulation.panda.reach import ArmPaths, PandaReach
from ffhnet.simulation.panda.scene import ArmScene
from ffhnet.simulation.trial import GraspTrial, TrialResults


class ArmTrial(GraspTrial):
    """The same trial, but an arm carries the hand and lifts it, and the table stays.

    A grasp that the arm does not reach counts as COLLISION: the hand could not take up its pose.
    `PandaReach.plan` says why.
    """

    def __init__(self, scene: ArmScene) -> None:
        super().__init__(scene)
        self._arm_scene = scene
        self._reach = PandaReach(scene)
        self._paths: ArmPaths | None = None

    def run(self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"]) -> TrialResults:
        """Executes every grasp (world frame, table top z = 0) on the object at the given resting pose."""
        self._paths = self._reach.plan(grasps, T_world_object)
        return super().run(grasps, T_world_object)

    def free(self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"]) -> Bool[np.ndarray, " N"]:
        """Whether the arm reaches each palm pose and the open hand is free on its straight approach."""
        self._paths = self._reach.plan(grasps, T_world_object)
        return super().free(grasps, T_world_object)

    def _can_reach(self, grasps: Grasps, i: int) -> bool:
        assert self._paths is not None
        if not self._paths.reachable[i]:
            return False
        self._arm_scene.posture.branch = self._paths.approach[i, -1]
        return super()._can_reach(grasps, i)
