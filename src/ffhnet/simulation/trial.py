"""The grasp trial: reach, close, lift, hold (section IV-B, "closing primitive" and lifting attempt)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands.closing import closing_advances
from ffhnet.simulation.scene import HAND, OBJECT, TABLE, Scene

SWEEP_PERIODS = 2
"""Control periods between the finger poses at which first contact is looked for: 3 mm at the tips."""

LEFT_BEHIND = 0.10
"""m by which an object may lag behind the hand: further off it was left on the table or is falling."""

REST_PERIODS = 8
REST_SHARE = 0.25
"""An object off the table is held when it moves in the hand at less than this share of the allowed slip for
REST_PERIODS control periods: the hand stands still while the table sinks, so that nothing more can change."""


_BOTH_WAYS = np.concatenate([np.eye(3), -np.eye(3)])
NEIGHBOURS = np.concatenate(
    [
        make_transform(position=0.01 * _BOTH_WAYS),
        make_transform(matrix_from_rotation_vector(0.15 * _BOTH_WAYS)),
    ]
)
"""12 × 4 × 4: the palm moved by 1 cm along, and turned by 0.15 rad about, each of its axes, both ways."""


class Outcome(IntEnum):
    """What became of a trial. All but SUCCESS are failures."""

    SUCCESS = 0
    COLLISION = 1  # the hand touches object or table before closing, or on its way there
    MISSED = 2  # no contact with the object after closing
    SLIPPED = 3  # left behind, lost or still on the table during the lift
    DROPPED = 4  # lost, or moving in the hand, during the hold
    UNSTABLE = 5  # the simulation broke down; counted as a failure and kept visible


@dataclass(frozen=True)
class TrialResults:
    """One row per trial.

    Attributes:
        outcome: an `Outcome`.
        margin: share of twelve neighbouring palm poses (`NEIGHBOURS`) at which the open hand is free, too;
            0 for start collisions.
        closed_joints: measured joint angles after closing and squeezing, rad (the grasp's if not closed).
        contact_links: number of hand links that touch the object after closing.
        pushed: m that the object moved on the table while the fingers closed.
        rise: m that the object rose against the table by the end (0 if not lifted).
        hold_slip: m that the object moved in the hand during the hold (0 if not held).
    """

    outcome: Int[np.ndarray, " N"]
    margin: Float[np.ndarray, " N"]
    closed_joints: Float[np.ndarray, "N J"]
    contact_links: Int[np.ndarray, " N"]
    pushed: Float[np.ndarray, " N"]
    rise: Float[np.ndarray, " N"]
    hold_slip: Float[np.ndarray, " N"]

    @property
    def success(self) -> Bool[np.ndarray, " N"]:
        """Whether the object was lifted and held."""
        return self.outcome == Outcome.SUCCESS

    @property
    def executed(self) -> Bool[np.ndarray, " N"]:
        """Whether the hand could take up its pose, so that the grasp was tried at all."""
        return self.outcome != Outcome.COLLISION

    def __len__(self) -> int:
        return len(self.outcome)

    @staticmethod
    def concatenate(parts: list[TrialResults]) -> TrialResults:
        """One table from several."""
        return TrialResults(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(TrialResults))
        )


@dataclass
class _Row:
    outcome: Outcome
    closed_joints: Float[np.ndarray, " J"]
    margin: float = 0.0
    contact_links: int = 0
    pushed: float = 0.0
    rise: float = 0.0
    hold_slip: float = 0.0


class GraspTrial:
    """Executes grasps on one object; build once per object, run as many grasps as wanted.

    Attributes:
        hand: the hand of the scene.
        steps: simulation steps made so far.
    """

    def __init__(self, scene: Scene, watch: Callable[[], None] | None = None) -> None:
        """Makes trials in a scene; `watch` is called after every simulated control period."""
        self._scene = scene
        self._watch = watch
        self.hand = scene.hand
        self.steps = 0
        self._physics = scene.physics
        self._steps_per_period = round(scene.physics.control_period / scene.physics.timestep)
        # Contacts are few: looking them up one by one costs a fifth of what numpy takes to begin.
        self._owner: list[int] = scene.geom_owner.tolist()
        self._link: list[int] = scene.model.geom_bodyid.tolist()
        self._hand_geoms = frozenset(np.flatnonzero(scene.geom_owner == HAND).tolist())

    def run(self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"]) -> TrialResults:
        """Executes every grasp (world frame, table top z = 0) on the object at the given resting pose."""
        rows = [self._run_one(grasps, i, T_world_object) for i in range(len(grasps))]
        return TrialResults(
            outcome=np.array([row.outcome for row in rows], dtype=np.int8),
            margin=np.array([row.margin for row in rows]),
            closed_joints=np.array([row.closed_joints for row in rows]).reshape(-1, self.hand.num_joints),
            contact_links=np.array([row.contact_links for row in rows], dtype=np.int8),
            pushed=np.array([row.pushed for row in rows]),
            rise=np.array([row.rise for row in rows]),
            hold_slip=np.array([row.hold_slip for row in rows]),
        )

    def vary(self, mass: float = 1.0, friction: float | None = None) -> None:
        """Changes the object's mass (a factor) and all friction for the trials that follow (`Scene.vary`)."""
        self._scene.vary(mass, friction)

    def free(self, grasps: Grasps, T_world_object: Float[np.ndarray, "4 4"]) -> Bool[np.ndarray, " N"]:
        """Whether the open hand can reach each palm pose on a straight approach along the palm's x axis."""
        self._reset(T_world_object)
        return np.array([self._can_reach(grasps, i) for i in range(len(grasps))], dtype=bool)

    def _reset(self, T_world_object: Float[np.ndarray, "4 4"]) -> None:
        mujoco.mj_resetData(self._scene.model, self._scene.data)
        self._scene.place_object(T_world_object)

    def _can_reach(self, grasps: Grasps, i: int) -> bool:
        back = np.linspace(0, self._physics.approach_distance, self._physics.approach_steps)
        retreats = make_transform(position=-back[:, None] * grasps.rotation[i][:, 0])
        poses = retreats @ self.hand.root_pose(grasps.rotation[i], grasps.position[i])
        opened = self.hand.open(grasps.joints[i])
        # The grasp pose first: it is where most collisions are found.
        return not any(self._collides(pose, opened) for pose in poses)

    def _margin(self, grasps: Grasps, i: int) -> float:
        """Share of the neighbouring palm poses at which the open hand is free."""
        T_world_palm = make_transform(grasps.rotation[i], grasps.position[i])
        T_palm_root, opened = invert(self.hand.T_root_palm), self.hand.open(grasps.joints[i])
        poses = T_world_palm @ NEIGHBOURS @ T_palm_root
        return float(np.mean([not self._collides(pose, opened) for pose in poses]))

    def _collides(self, T_world_root: Float[np.ndarray, "4 4"], joints: Float[np.ndarray, " J"]) -> bool:
        self._scene.place_hand(T_world_root, joints)
        return self._hand_touches()

    def _hand_touches(self) -> bool:
        """Whether the hand, as it is placed, touches anything, itself included."""
        scene = self._scene
        mujoco.mj_kinematics(scene.model, scene.data)
        mujoco.mj_collision(scene.model, scene.data)
        return not self._hand_geoms.isdisjoint(scene.data.contact.geom.ravel().tolist())

    def _run_one(self, grasps: Grasps, i: int, T_world_object: Float[np.ndarray, "4 4"]) -> _Row:
        self._reset(T_world_object)
        joints = grasps.joints[i]
        if not self._can_reach(grasps, i):
            return _Row(Outcome.COLLISION, joints)
        margin = self._margin(grasps, i)
        self._reset(T_world_object)
        self._scene.place_hand(
            self.hand.root_pose(grasps.rotation[i], grasps.position[i]), self.hand.open(joints)
        )
        mujoco.mj_forward(self._scene.model, self._scene.data)
        row = self._execute(joints)
        row.margin = margin
        if self._scene.data.warning.number[mujoco.mjtWarning.mjWARN_BADQACC] > 0:
            row.outcome = Outcome.UNSTABLE
        return row

    def _execute(self, joints: Float[np.ndarray, " J"]) -> _Row:
        data, physics = self._scene.data, self._physics
        start = self._object_position()
        self._close(joints)
        links, _ = self._touching()
        closed = data.qpos[self._scene.joint_qpos].copy()
        row = _Row(Outcome.MISSED, closed, contact_links=links)
        row.pushed = float(np.linalg.norm(self._object_position() - start))
        if links == 0:
            return row

        row.outcome = Outcome.SLIPPED
        anchor = self._object_position()
        lift = quintic(physics.lift_duration, physics.control_period) * physics.lift_height
        for period, height in enumerate(lift, 1):
            self._scene.raise_hand(height)
            self._advance()
            row.rise = self._object_height() - start[2]
            if height - row.rise > LEFT_BEHIND or (height - row.rise > 0.01 and self._touching()[0] == 0):
                return row
            if period % REST_PERIODS == 0:
                if self._rests(row, anchor, still_to_rise=physics.lift_height - height):
                    return row
                anchor = self._object_position()
        if row.rise < physics.min_rise:
            return row

        row.outcome = Outcome.DROPPED
        held = anchor = self._object_position()
        for period in range(1, round(physics.hold_duration / physics.control_period) + 1):
            self._advance()
            row.rise = self._object_height() - start[2]
            if period % REST_PERIODS == 0:
                if self._rests(row, anchor):
                    return row
                anchor = self._object_position()
        row.hold_slip = float(np.linalg.norm(self._object_position() - held))
        if row.hold_slip <= physics.max_hold_slip and row.rise >= physics.min_rise and self._in_hand():
            row.outcome = Outcome.SUCCESS
        return row

    def _rests(self, row: _Row, anchor: Float[np.ndarray, 3], still_to_rise: float = 0.0) -> bool:
        """Ends the trial early where the object rests in the hand since it was at `anchor`."""
        physics = self._physics
        moved = float(np.linalg.norm(self._object_position() - anchor))
        slip = moved * physics.hold_duration / (REST_PERIODS * physics.control_period)
        rise = row.rise + still_to_rise
        if slip > REST_SHARE * physics.max_hold_slip or rise < physics.min_rise or not self._in_hand():
            return False
        row.outcome, row.rise, row.hold_slip = Outcome.SUCCESS, rise, slip
        return True

    def _in_hand(self) -> bool:
        links, on_table = self._touching()
        return links > 0 and not on_table

    def _close(self, joints: Float[np.ndarray, " J"]) -> None:
        """Closes from the open hand towards the grasp's joints, then on until contact or limit decides.

        Nothing happens before the fingers meet something, so the simulation starts shortly before they do,
        or at the end of their way if they never do.
        """
        closing, scene = self.hand.closing, self._scene
        advances = closing_advances(self.hand, joints, self._physics.control_period)
        path = self.hand.open(joints) + np.concatenate(
            [np.zeros((1, len(joints))), np.cumsum(advances, axis=0)]
        )
        path = np.minimum(path, self.hand.upper)
        start = self._last_free(path)
        target = path[start]
        scene.place_fingers(target)
        scene.data.ctrl[scene.actuators] = target
        mujoco.mj_forward(scene.model, scene.data)
        for advance in advances[start:]:
            limit = np.minimum(scene.data.qpos[scene.joint_qpos] + closing.lead, self.hand.upper)
            target = np.maximum(target, np.minimum(target + advance, limit))
            scene.data.ctrl[scene.actuators] = target
            self._advance()
        for _ in range(round(closing.squeeze / self._physics.control_period)):
            self._advance()

    def _last_free(self, path: Float[np.ndarray, "K J"]) -> int:
        """The place on the path from which the closing is simulated."""
        for k in range(0, len(path), SWEEP_PERIODS):
            self._scene.place_fingers(path[k])
            if self._hand_touches():
                # One interval in which contact begins, and one in which the fingers come up to speed.
                return max(k - 2 * SWEEP_PERIODS, 0)
        return len(path) - 1

    def _advance(self) -> None:
        mujoco.mj_step(self._scene.model, self._scene.data, self._steps_per_period)
        self.steps += self._steps_per_period
        if self._watch is not None:
            self._watch()

    def _object_position(self) -> Float[np.ndarray, 3]:
        """Centre of mass of the object, world frame."""
        return self._scene.data.xipos[self._scene.object_body].copy()

    def _object_height(self) -> float:
        """Height of the object's centre of mass over the table, m."""
        return float(self._object_position()[2]) - self._scene.table_z

    def _touching(self) -> tuple[int, bool]:
        """How many hand links touch the object, and whether the table does."""
        links: set[int] = set()
        on_table = False
        for one, other in self._scene.data.contact.geom.tolist():
            owners = self._owner[one], self._owner[other]
            if OBJECT in owners and HAND in owners:
                links.add(self._link[one if owners[0] == HAND else other])
            elif OBJECT in owners and TABLE in owners:
                on_table = True
        return len(links), on_table


def quintic(duration: float, period: float) -> Float[np.ndarray, " K"]:
    """Smooth path from 0 to 1 that starts and ends at rest, one value per control period."""
    s = np.linspace(0, 1, max(round(duration / period), 1) + 1)[1:]
    return s**3 * (10 - 15 * s + 6 * s**2)
