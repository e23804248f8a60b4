"""The generator's own samples on unseen objects with what became of them: what a calibration is fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from ffhnet.hands import load_hand
from ffhnet.inference.ffhnet import FFHNet
from ffhnet.inference.novelty import novelty
from ffhnet.model.checkpoint import load_checkpoint
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.variation import held_under_variation
from ffhnet.simulation.views import seeded_views


@dataclass(frozen=True)
class OwnSamplesJob:
    """One object: a unit of work for a process.

    Attributes:
        source: the object.
        weights: folder of weights; a calibration in it is not used.
        hand: name or TOML file of their hand.
        views: views of the object, its resting poses in turn.
        samples: grasps sampled and rated per view.
        executed: random ones among them that are executed.
        seed: of all randomness.
    """

    source: ObjectSource
    weights: str
    hand: str
    views: int
    samples: int
    executed: int
    seed: int


@dataclass(frozen=True)
class OwnSamples:
    """What one view gave.

    Attributes:
        object_name: the object.
        probability, robustness: predicted, of the executed samples; `robustness` is NaN if not predicted.
        success: in nominal physics.
        held: in one repeat under varied pose, mass and friction.
        top_score: score of the best of all samples.
        top_held: success of one repeat of it under varied physics.
        novelty: how unlike the training views this one is; NaN where the networks cannot tell.
    """

    object_name: str
    probability: Float[np.ndarray, " N"]
    robustness: Float[np.ndarray, " N"]
    success: Float[np.ndarray, " N"]
    held: Float[np.ndarray, " N"]
    top_score: float
    top_held: float
    novelty: float


def try_own_samples(job: OwnSamplesJob) -> list[OwnSamples]:
    """All views of one object; a view on which nothing can be told from the table is left out."""
    torch.set_num_threads(1)
    network, obj = _load_network(job.weights), job.source.load()
    trial = GraspTrial(build_scene(load_hand(job.hand), obj))
    found = []
    for view, T_world_object, rng in seeded_views(obj, job.views, job.seed):
        ranked = network.grasp(view.observation, job.samples, seed=int(rng.integers(2**31)))
        ranked = ranked.to_frame(view.T_world_camera, "world")
        strange = novelty(network.evaluator.condition, view.observation.bps)
        drawn = ranked[rng.permutation(len(ranked))[: job.executed]]
        assert drawn.probability is not None
        found.append(
            OwnSamples(
                object_name=obj.name,
                probability=drawn.probability,
                robustness=np.full(len(drawn), np.nan) if drawn.robustness is None else drawn.robustness,
                success=trial.run(drawn, T_world_object).success.astype(float),
                held=held_under_variation(trial, drawn, T_world_object, 1, rng).astype(float),
                top_score=float(ranked.score[0]),
                top_held=float(held_under_variation(trial, ranked[0], T_world_object, 1, rng)[0]),
                novelty=np.nan if strange is None else strange,
            )
        )
    return found


@lru_cache(maxsize=1)
def _load_network(weights: str) -> FFHNet:
    """Networks of a worker process, loaded once, as they are without calibration."""
    return FFHNet(load_checkpoint(Path(weights)))
