"""The paper's protocol (section V-A): every generated grasp is tried in physics, whatever its probability.

For each object and each of a few random views, grasps are sampled from the generator, rated by the
evaluator, and all executed. What a threshold would have kept is then a matter of counting (`tables.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Bool, Float

from ffhnet.hands import load_hand
from ffhnet.inference.ffhnet import FFHNet
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.sampling.heuristic import DRAWS_PER_TRIAL, PAPER, sample_heuristic
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.views import View, ViewMaker


@dataclass(frozen=True)
class Protocol:
    """How grasps are evaluated.

    Attributes:
        weights: folder of weights, or None for the shipped ones.
        placements: random views per object; turning the camera and turning the object are the same.
        samples: grasps sampled, and executed, per view.
        heuristic: grasps of the paper's sampler executed per view, after its collision filter.
        all_poses: cycle through the object's resting poses instead of the first one only.
        seed: of views and samples.
        physics: of the trials.
    """

    weights: str | None = None
    placements: int = 3
    samples: int = 400
    heuristic: int = 60
    all_poses: bool = False
    seed: int = 0
    physics: Physics = field(default_factory=Physics)


@dataclass(frozen=True)
class ViewOutcome:
    """What became of the grasps of one view.

    Attributes:
        object_name, pose_name: what was looked at.
        probability: predicted for each sample.
        success: whether it lifted the object. A start collision counts as a failure.
        executed: False where the hand collided before it could close.
        heuristic_success: of the executed heuristic grasps.
    """

    object_name: str
    pose_name: str
    probability: Float[np.ndarray, " N"]
    success: Bool[np.ndarray, " N"]
    executed: Bool[np.ndarray, " N"]
    heuristic_success: Bool[np.ndarray, " H"]


def evaluate_object(job: tuple[ObjectSource, int, Protocol]) -> list[ViewOutcome]:
    """All views of one object; `job` holds the object, its number in the evaluation, and the protocol."""
    source, number, protocol = job
    torch.set_num_threads(1)
    network = FFHNet.from_pretrained(protocol.weights, device="cpu")
    obj = source.load()
    trial = GraspTrial(build_scene(load_hand(network.info.hand), obj, protocol.physics))
    outcomes = []
    for placement in range(protocol.placements):
        rng = np.random.default_rng([protocol.seed, number, placement])
        pose = placement % len(obj.resting_poses) if protocol.all_poses else 0
        T_world_object = obj.resting_poses[pose]
        view = ViewMaker(obj, T_world_object).take(rng)
        grasps = network.grasp(view.observation, protocol.samples, seed=int(rng.integers(2**31)))
        results = trial.run(grasps.to_frame(view.T_world_camera, "world"), T_world_object)
        assert grasps.probability is not None
        outcomes.append(
            ViewOutcome(
                object_name=obj.name,
                pose_name=obj.pose_names[pose],
                probability=grasps.probability,
                success=results.success,
                executed=results.executed,
                heuristic_success=_heuristic(view, trial, T_world_object, protocol.heuristic, rng),
            )
        )
    return outcomes


def _heuristic(
    view: View,
    trial: GraspTrial,
    T_world_object: Float[np.ndarray, "4 4"],
    wanted: int,
    rng: np.random.Generator,
) -> Bool[np.ndarray, " H"]:
    """Success of the paper's sampler on the same view, after its collision filter (Table II)."""
    count = DRAWS_PER_TRIAL * wanted
    grasps = sample_heuristic(*view.cloud_and_normals_world, trial.hand, count, rng, PAPER)
    free = np.flatnonzero(trial.free(grasps, T_world_object))[:wanted]
    return trial.run(grasps[free], T_world_object).success
