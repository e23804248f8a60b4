"""How fast trials run and how far labels depend on the time step, on the mix of grasps of a data set."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ffhnet.dataset.object_trials import GenerateConfig, try_object
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand, load_hand
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, TrialResults

FINER = 4
"""The reference's time step is this many times shorter."""

SHIFT = 1e-6
"""m by which the object is moved to see what rounding alone does to labels."""

BARE_STEPS = 5000


@dataclass(frozen=True)
class ObjectMeasurement:
    """One object: N executed grasps of the training mix, and C start collisions.

    Attributes:
        object_name: the object.
        pieces: number of its convex pieces.
        proposer: of each executed grasp.
        label, fine_label, moved_label: success with the shipped physics, at the finer step, and with the
            object moved by `SHIFT`.
        collisions: number of start collisions among the trials, C.
        seconds: CPU time of the shipped trials, start collisions included.
        steps: simulation steps in them.
        bare_step: s of CPU time per step of a bare `mj_step` loop, open hand far from the object at rest.
    """

    object_name: str
    pieces: int
    proposer: np.ndarray
    label: Bool[np.ndarray, " N"]
    fine_label: Bool[np.ndarray, " N"]
    moved_label: Bool[np.ndarray, " N"]
    collisions: int
    seconds: float
    steps: int
    bare_step: float


def measure_object(job: tuple[ObjectSource, GenerateConfig]) -> ObjectMeasurement:
    """Makes one object's trials as the generation job does, then runs them again in three ways."""
    source, config = job
    obj, hand = source.load(), load_hand(config.hand)
    trial, moving = (GraspTrial(build_scene(hand, obj, config.physics)) for _ in range(2))
    finer = dataclasses.replace(config.physics, timestep=config.physics.timestep / FINER)
    reference = GraspTrial(build_scene(hand, obj, finer))
    seconds, proposer = 0.0, []
    shipped: list[TrialResults] = []
    fine: list[TrialResults] = []
    moved: list[TrialResults] = []
    for pose, grasps, proposers in _mix(obj, config):
        start = time.process_time()
        shipped.append(trial.run(grasps, pose))
        seconds += time.process_time() - start
        fine.append(reference.run(grasps, pose))
        nudged = pose.copy()
        nudged[0, 3] += SHIFT
        moved.append(moving.run(grasps, nudged))
        proposer.append(proposers)
    results = TrialResults.concatenate(shipped)
    executed = results.executed
    return ObjectMeasurement(
        object_name=obj.name,
        pieces=len(obj.pieces),
        proposer=np.concatenate(proposer)[executed],
        label=results.success[executed],
        fine_label=TrialResults.concatenate(fine).success[executed],
        moved_label=TrialResults.concatenate(moved).success[executed],
        collisions=int((~executed).sum()),
        seconds=seconds,
        steps=trial.steps,
        bare_step=_bare_step(hand, obj, config.physics),
    )


def _mix(
    obj: GraspObject, config: GenerateConfig
) -> Iterator[tuple[Float[np.ndarray, "4 4"], Grasps, np.ndarray]]:
    """Resting pose, grasps and their proposers of each placement."""
    blocks, _ = try_object(obj, config)
    for placement in sorted({block.placement for block in blocks}):
        mine = [block for block in blocks if block.placement == placement]
        proposers = np.concatenate([np.full(len(block.grasps), block.proposer) for block in mine])
        yield obj.resting_poses[placement], Grasps.concatenate([block.grasps for block in mine]), proposers


def _bare_step(hand: Hand, obj: GraspObject, physics: Physics) -> float:
    """CPU time per step, s, with nothing but the open hand, far away, and the object at rest."""
    scene = build_scene(hand, obj, physics)
    scene.place_object(obj.resting_poses[0])
    far = np.eye(4)
    far[:3, 3] = [0.5, 0.5, 0.5]
    scene.place_hand(far, hand.open(np.zeros(hand.num_joints)))
    start = time.process_time()
    mujoco.mj_step(scene.model, scene.data, BARE_STEPS)
    return (time.process_time() - start) / BARE_STEPS
