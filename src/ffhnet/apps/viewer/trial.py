"""The physics trial of one grasp, recorded so that it can be played. Needs the extra `sim`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffhnet.apps.viewer.motion import FRAMES_PER_SECOND, Frame, approach, closing, palm_pose
from ffhnet.apps.viewer.sight import KnownObject
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome


@dataclass(frozen=True)
class Recording:
    """A trial and how it ended.

    Attributes:
        frames: approach, closing and lift.
        outcome: of the trial.
        rise: m that the object rose.
    """

    frames: list[Frame]
    outcome: Outcome
    rise: float


def record_trial(hand: Hand, known: KnownObject, grasp: Grasps) -> Recording:
    """Tries a grasp on an object, with the same constants as every trial of the package.

    Args:
        hand: the hand.
        known: the object and its pose.
        grasp: a batch of one, in the world frame.
    """
    scene = build_scene(hand, known.obj)
    pose, period = palm_pose(grasp), scene.physics.control_period
    moments: list[Frame] = []

    def watch() -> None:
        # In the trial the hand stands and the table sinks; seen from the table, hand and object rise.
        up = make_transform(position=np.array([0.0, 0.0, -scene.table_z]))
        body = scene.data.body(scene.object_body)
        T_world_object = make_transform(body.xmat.reshape(3, 3), body.xpos)
        moments.append(Frame(up @ pose, scene.data.qpos[scene.joint_qpos].copy(), up @ T_world_object))

    results = GraspTrial(scene, watch).run(grasp, known.T_world_object)
    outcome = Outcome(results.outcome[0])
    frames = approach(hand, grasp)
    if moments:
        # Before the first contact nothing is simulated: the fingers move freely until there.
        frames += closing(hand, grasp, moments[0].joints)
        if outcome == Outcome.SUCCESS:
            moments += _rest_of_lift(moments[-1], -scene.table_z, scene.physics.lift_height, period)
        frames += moments[:: max(round(1 / FRAMES_PER_SECOND / period), 1)]
    return Recording(frames, outcome, float(results.rise[0]))


def _rest_of_lift(last: Frame, height: float, lift_height: float, period: float) -> list[Frame]:
    """The trial ends as soon as the object rests in the hand; hand and object go on to the top together."""
    speed = 0.4  # m/s
    count = round((lift_height - height) / (speed * period))
    frames = []
    for up in np.linspace(0, lift_height - height, count + 1)[1:]:
        raised = make_transform(position=np.array([0.0, 0.0, up]))
        assert last.T_world_object is not None
        frames.append(Frame(raised @ last.T_world_palm, last.joints, raised @ last.T_world_object))
    return frames


def describe(recording: Recording) -> str:
    """The outcome in words."""
    rose = f"{100 * recording.rise:.1f} cm"
    return {
        Outcome.SUCCESS: f"held: the object rose {rose} with the hand",
        Outcome.COLLISION: "not executed: the open hand touches the object or the table on its way",
        Outcome.MISSED: "failed: the fingers closed without touching the object",
        Outcome.SLIPPED: f"failed: the object slipped out of the hand, after {rose}",
        Outcome.DROPPED: f"failed: the object did not stay still in the lifted hand, after {rose}",
        Outcome.UNSTABLE: "failed: the simulation broke down",
    }[recording.outcome]
