"""The strict trial: a light, slippery object in a floating hand is pushed six ways and must stay in place.

The rules are those of DexGraspBench's force-closure setting, under which the field's multi-finger learners
are compared: friction 0.6 (torsional 0.02), an object of 100 g whatever it is, neither gravity nor table
while pushes of 10 N per kg of mass act for up to 2 s along the six axes of the world, each begun with the
hand just closed, and limits of 5 cm and 15 degrees. Two counts come of it:

- `StrictResults.held`: the limits count from where the object was when pushing began. This asks what the
  pushes are there to ask, whether the closed hand holds the object.
- `StrictResults.success`: they count from before the hand closed, as the bench has it. An object that is
  drawn into the closing hand has then used up its allowance before the first push. The bench's grasps are
  planned on the full shape and replayed as three near poses, which hardly move the object; ours close from
  the open hand until contact stops them, as `GraspTrial` does, and move it by centimetres.

The object rests on the table under gravity while the hand closes, which is where these grasps are meant to
work, and both are taken away before the pushes; "floating" has neither from the start, as the bench does.
The start is stricter than there: the bench allows 1 cm of penetration, here the open hand may touch neither
object nor table, nor on its straight way there.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial

PUSHES = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
"""Directions in the world frame, in the order in which they are tried."""

CHECK_PERIODS = 8
"""Control periods between two looks at the object: 96 ms."""

REST_SHARE = 0.05
"""A push ends early where the object, at its present speed, would use up less than this share of its
allowance by the end; that much is then added. Nothing but the object moves, so that what rests stays."""

_OUT_OF_REACH = 100.0
"""m that the table is lowered by to be gone."""

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""All that the next step depends on."""


class Verdict(IntEnum):
    """What became of a strict trial. All but HELD are failures."""

    HELD = 0
    COLLISION = 1  # the open hand touches object or table at its pose or on the way there
    MISSED = 2  # no contact with the object after closing
    MOVED = 3  # further than allowed, during closing or a push
    TURNED = 4  # by more than allowed, during closing or a push
    UNSTABLE = 5  # the simulation broke down


@dataclass(frozen=True)
class StrictRules:
    """The rules of the strict trial.

    Attributes:
        mass: kg of every object.
        friction: sliding, torsional (m), rolling (m) coefficients of every contact.
        push: N per kg of the object.
        push_duration: s of each push.
        max_displacement: m that the centre of mass may move.
        max_angle: rad that the object may turn.
        closing: "resting" has gravity and the table until the hand is closed, "floating" has neither.
    """

    mass: float = 0.1
    friction: tuple[float, float, float] = (0.6, 0.02, 0.0001)
    push: float = 10.0
    push_duration: float = 2.0
    max_displacement: float = 0.05
    max_angle: float = np.radians(15.0)
    closing: Literal["resting", "floating"] = "resting"


@dataclass(frozen=True)
class StrictResults:
    """One row per grasp.

    Attributes:
        verdict: a `Verdict`.
        held: whether all six pushes left the object within the limits, counted from when pushing began.
        push: index into `PUSHES` of the push that was not held; -1 where all were or none began.
        closing_displacement, closing_angle: m and rad from before the hand closed to after.
        displacement, angle: the largest seen, m and rad, from before the hand closed.
        push_displacement, push_angle: the largest seen, m and rad, from when pushing began.
        steps: simulation steps made.
    """

    verdict: Int[np.ndarray, " N"]
    held: Bool[np.ndarray, " N"]
    push: Int[np.ndarray, " N"]
    closing_displacement: Float[np.ndarray, " N"]
    closing_angle: Float[np.ndarray, " N"]
    displacement: Float[np.ndarray, " N"]
    angle: Float[np.ndarray, " N"]
    push_displacement: Float[np.ndarray, " N"]
    push_angle: Float[np.ndarray, " N"]
    steps: Int[np.ndarray, " N"]

    @property
    def success(self) -> Bool[np.ndarray, " N"]:
        """Whether the object stayed within the limits from before the hand closed through all six pushes."""
        return self.verdict == Verdict.HELD

    def __len__(self) -> int:
        return len(self.verdict)


@dataclass
class _Row:
    verdict: Verdict
    held: bool = False
    push: int = -1
    closing_displacement: float = 0.0
    closing_angle: float = 0.0
    displacement: float = 0.0
    angle: float = 0.0
    push_displacement: float = 0.0
    push_angle: float = 0.0
    steps: int = 0


@dataclass(frozen=True)
class _Pose:
    """Centre of mass (m) and orientation of the object in the world."""

    position: Float[np.ndarray, " 3"]
    rotation: Float[np.ndarray, "3 3"]

    def __sub__(self, other: _Pose) -> Float[np.ndarray, " 2"]:
        """Distance (m) and angle (rad) between two poses."""
        moved = np.linalg.norm(self.position - other.position)
        return np.array([moved, geodesic_angle(other.rotation, self.rotation)])


class StrictTrial(GraspTrial):
    """Executes grasps on one object under the strict rules; build once per object."""

    def __init__(self, hand: Hand, obj: GraspObject, rules: StrictRules | None = None) -> None:
        """Builds the scene.

        Args:
            hand: the hand.
            obj: the object; its own mass is not used.
            rules: the rules.
        """
        self.rules = rules or StrictRules()
        light = dataclasses.replace(obj, mass=self.rules.mass)
        super().__init__(build_scene(hand, light, Physics(friction=self.rules.friction)))
        self._gravity = self._scene.model.opt.gravity.copy()

    def run_strict(self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"]) -> StrictResults:
        """Executes every grasp (world frame, table top z = 0) on the object at the given resting pose."""
        free = self.free(grasps, T_world_object)
        rows = [
            self._try(grasps, i, T_world_object) if free[i] else _Row(Verdict.COLLISION)
            for i in range(len(grasps))
        ]
        return StrictResults(
            *(np.array([getattr(row, f.name) for row in rows]) for f in dataclasses.fields(StrictResults))
        )

    def _reset(self, T_world_object: Float[np.ndarray, "4 4"]) -> None:
        super()._reset(T_world_object)
        self._scene.model.opt.gravity[:] = self._gravity

    def _leave_the_ground(self) -> None:
        self._scene.raise_hand(_OUT_OF_REACH)
        self._scene.model.opt.gravity[:] = 0

    def _try(self, grasps: Grasps, i: int, T_world_object: Float[np.ndarray, "4 4"]) -> _Row:
        scene, before = self._scene, self.steps
        self._reset(T_world_object)
        if self.rules.closing == "floating":
            self._leave_the_ground()
        joints = grasps.joints[i]
        scene.place_hand(self.hand.root_pose(grasps.rotation[i], grasps.position[i]), self.hand.open(joints))
        mujoco.mj_forward(scene.model, scene.data)
        start = self._object_pose()
        self._close(joints)
        self._leave_the_ground()
        row = self._push_six_ways(start) if self._touching()[0] > 0 else _Row(Verdict.MISSED)
        if scene.data.warning.number[mujoco.mjtWarning.mjWARN_BADQACC] > 0:
            row.verdict, row.held = Verdict.UNSTABLE, False
        row.steps = self.steps - before
        return row

    def _push_six_ways(self, start: _Pose) -> _Row:
        """Pushes until one push is not held; every push begins with the hand as it closed."""
        scene, rules = self._scene, self.rules
        row, begun = _Row(Verdict.HELD, held=True), self._object_pose()
        row.closing_displacement, row.closing_angle = row.displacement, row.angle = begun - start
        closed = np.empty(mujoco.mj_stateSize(scene.model, _STATE))
        mujoco.mj_getState(scene.model, scene.data, closed, _STATE)
        for number, direction in enumerate(PUSHES):
            mujoco.mj_setState(scene.model, scene.data, closed, _STATE)
            scene.data.xfrc_applied[scene.object_body, :3] = rules.push * rules.mass * direction
            if not self._holds(row, start, begun):
                row.push, row.held = number, False
                break
        if max(row.displacement, row.push_displacement) >= rules.max_displacement:
            row.verdict = Verdict.MOVED
        elif max(row.angle, row.push_angle) >= rules.max_angle:
            row.verdict = Verdict.TURNED
        return row

    def _holds(self, row: _Row, start: _Pose, begun: _Pose) -> bool:
        """Lets the force act, looks at the object now and then, and notes how far it went."""
        rules = self.rules
        limits = np.array([rules.max_displacement, rules.max_angle])
        periods, last = round(rules.push_duration / self._physics.control_period), begun
        for done in range(1, periods + 1):
            self._advance()
            if done % CHECK_PERIODS and done < periods:
                continue
            now = self._object_pose()
            still_to_go = (now - last) * (periods - done) / CHECK_PERIODS
            rests = bool((still_to_go < REST_SHARE * limits).all())
            ahead = still_to_go if rests else 0.0
            moved, turned = now - start + ahead
            row.displacement, row.angle = max(row.displacement, moved), max(row.angle, turned)
            moved, turned = now - begun + ahead
            row.push_displacement = max(row.push_displacement, moved)
            row.push_angle = max(row.push_angle, turned)
            if moved >= rules.max_displacement or turned >= rules.max_angle:
                return False
            if rests:
                return True
            last = now
        return True

    def _object_pose(self) -> _Pose:
        rotation = self._scene.data.xmat[self._scene.object_body].reshape(3, 3).copy()
        return _Pose(self._object_position(), rotation)
