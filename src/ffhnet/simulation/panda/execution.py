"""A planned grasp done by the arm: straight approach, closing, lift, nothing but the plan being known."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from ffhnet.errors import OptionError
from ffhnet.grasp_plan import GraspPlan
from ffhnet.hands.closing import JointTrajectory
from ffhnet.simulation.panda.scene import NEIGHBOUR, ArmScene
from ffhnet.simulation.scene import ARM, HAND, OBJECT, TABLE
from ffhnet.simulation.trial import GraspTrial, Outcome, quintic

APPROACH_DURATION = 2.0
"""s for the 10 cm of straight approach."""


@dataclass(frozen=True)
class Execution:
    """What became of a planned grasp.

    Attributes:
        outcome: of the lift; never COLLISION, because contacts do not stop the arm.
        table: whether the hand touched the table before it closed.
        object: whether it touched the object before it closed.
        neighbour: whether the hand touched another object before it closed.
        arm: whether the arm touched anything until the end.
        rise: m that the object rose.
        moved: m that the other object that moved most has moved in the end.
    """

    outcome: Outcome
    table: bool
    object: bool
    neighbour: bool
    arm: bool
    rise: float
    moved: float

    @property
    def clean(self) -> bool:
        """Whether neither table nor neighbours were touched before closing, and nothing by the arm."""
        return not (self.table or self.neighbour or self.arm)

    @property
    def success(self) -> bool:
        """Whether the object was lifted and held without touching what is not to be touched."""
        return self.clean and self.outcome == Outcome.SUCCESS


class ArmExecution(GraspTrial):
    """Does planned grasps in a scene; from the pre-grasp pose on, whatever the hand touches on its way."""

    def __init__(self, scene: ArmScene) -> None:
        super().__init__(scene, watch=self._note_contacts)
        self._arm_scene = scene
        self._closing: JointTrajectory | None = None
        self._index = 0
        self._closed = False
        self._touched: set[int] = set()
        self._arm_touched = False

    def execute(
        self,
        plan: GraspPlan,
        index: int,
        T_world_object: Float[np.ndarray, "4 4"],
        T_world_neighbours: Float[np.ndarray, "K 4 4"],
    ) -> Execution:
        """Does one grasp of a plan, with the objects at these poses (table top z = 0).

        Raises:
            OptionError: a plan without an arm.
        """
        if plan.arm is None:
            raise OptionError("wanted a plan with an arm: plan with `ArmCheck`")
        self._closing, self._index = plan.closing, index
        self._closed, self._arm_touched = False, False
        self._touched.clear()
        self._reset(T_world_object)
        for k, pose in enumerate(T_world_neighbours):
            self._arm_scene.place_neighbour(k, pose)
        self._arm_scene.place_arm(plan.arm.approach[index, 0], plan.preshape[index])
        self._scene.data.ctrl[self._scene.actuators] = plan.preshape[index]
        mujoco.mj_forward(self._scene.model, self._scene.data)
        before = self._neighbour_positions()
        self._approach(plan.arm.approach[index])
        touched = frozenset(self._touched)
        self._closed = True
        row = self._execute(plan.grasps.joints[index])
        if self._scene.data.warning.number[mujoco.mjtWarning.mjWARN_BADQACC] > 0:
            row.outcome = Outcome.UNSTABLE
        moved = np.linalg.norm(self._neighbour_positions() - before, axis=1)
        return Execution(
            outcome=row.outcome,
            table=TABLE in touched,
            object=OBJECT in touched,
            neighbour=NEIGHBOUR in touched,
            arm=self._arm_touched,
            rise=row.rise,
            moved=float(moved.max(initial=0.0)),
        )

    def _approach(self, waypoints: Float[np.ndarray, "A 7"]) -> None:
        """Drives the arm through the joint angles of the straight approach, from rest to rest."""
        path = CubicSpline(np.linspace(0, 1, len(waypoints)), waypoints)
        for progress in quintic(APPROACH_DURATION, self._physics.control_period):
            self._arm_scene.drive_arm(path(progress))
            self._advance()

    def _close(self, joints: Float[np.ndarray, " J"]) -> None:
        """Follows the plan's closing motion as a controller does: targets never far ahead of the joints."""
        assert self._closing is not None
        scene, closing, period = self._scene, self.hand.closing, self._physics.control_period
        times = self._closing.times[self._index]
        targets = self._closing.at(self._index, np.arange(round(np.nanmax(times) / period) + 1) * period)
        target = targets[0]
        for advance in np.diff(targets, axis=0):
            limit = np.minimum(scene.data.qpos[scene.joint_qpos] + closing.lead, self.hand.upper)
            target = np.maximum(target, np.minimum(target + advance, limit))
            scene.data.ctrl[scene.actuators] = target
            self._advance()

    def _note_contacts(self) -> None:
        for one, other in self._scene.data.contact.geom.tolist():
            owners = {self._owner[one], self._owner[other]}
            self._arm_touched |= ARM in owners
            if HAND in owners and not self._closed:
                self._touched |= owners - {HAND}

    def _neighbour_positions(self) -> Float[np.ndarray, "K 3"]:
        index = self._arm_scene.neighbour_qpos[:, None] + np.arange(3)
        return self._scene.data.qpos[index].copy()
