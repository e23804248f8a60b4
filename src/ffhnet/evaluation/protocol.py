"""The protocol (section V-A, extended): which views are taken, which grasps are executed, in which worlds.

The paper executes every generated grasp whatever its probability. Here a random subset may stand for all, and
beside the paper's counts the same grasps and two blind controls are tried in other worlds (`stress.py`). What
a threshold would have kept is then a matter of counting (`tables.py`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal
from zlib import crc32

import numpy as np
import torch
from jaxtyping import Bool, Float

from ffhnet.errors import SceneError
from ffhnet.evaluation.outcomes import Condition, Coverage, Samples, Tries, UnseenView, ViewOutcome
from ffhnet.evaluation.stress import Groups, try_stressed, try_strict
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand, load_hand
from ffhnet.inference.ffhnet import FFHNet
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.sampling.blind import blind_random_yaw, blind_short_side
from ffhnet.sampling.heuristic import DRAWS_PER_TRIAL, PAPER, sample_heuristic
from ffhnet.simulation.distinct import is_distinct
from ffhnet.simulation.grasp_types import entropy_bits, grasp_types
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.strict_trial import StrictTrial
from ffhnet.simulation.trial import GraspTrial, TrialResults
from ffhnet.simulation.views import View, ViewMaker

TOP = 5
"""Best grasps of each view that are always executed."""

STRESSED = 5
"""Drawn samples of each view that are tried under stress."""

STRICT_BEST, STRICT_OF = 10, 100
"""The strict protocol takes the best 10 of 100 samples (the first of the drawn ones)."""

Poses = Literal["standing", "all"]


@dataclass(frozen=True)
class Protocol:
    """How grasps are evaluated.

    Attributes:
        weights: folder of weights, or None for the shipped ones.
        hand: name or TOML file of the hand, or None for the one by the name in the weights.
        placements: random views per object; turning the camera and turning the object are the same.
        poses: "standing" puts every object down as modelled; "all" puts it into its other resting poses on
            the last third of its views (`pose_of_view`).
        samples: grasps sampled and rated per view.
        executed: random samples executed per view; all of them if None or more than there are.
        full_views: views of each object, the first ones, on which all samples are executed.
        heuristic: grasps of the paper's sampler executed per view, after its collision filter.
        stress: whether grasps are tried under stress, too.
        strict: whether they are tried by the strict protocol, too.
        seed: of views, samples and all that is random.
        density: kg/m³ of every object, or None to leave each as it is built (500, mass clipped).
        physics: of the trials.
    """

    weights: str | None = None
    hand: str | None = None
    placements: int = 3
    poses: Poses = "standing"
    samples: int = 400
    executed: int | None = None
    full_views: int = 1
    heuristic: int = 60
    stress: bool = False
    strict: bool = False
    seed: int = 0
    density: float | None = None
    physics: Physics = field(default_factory=Physics)


@dataclass(frozen=True)
class ViewJob:
    """One view of one object: a unit of work for a process.

    Attributes:
        source: the object.
        placement: number of the view among the object's.
        protocol: how it is evaluated.
    """

    source: ObjectSource
    placement: int
    protocol: Protocol


def view_jobs(sources: list[ObjectSource], protocol: Protocol) -> list[ViewJob]:
    """All views of all objects, object by object."""
    return [ViewJob(source, k, protocol) for source in sources for k in range(protocol.placements)]


def pose_of_view(placement: int, placements: int, num_poses: int, poses: Poses) -> int:
    """Index of the resting pose on a view: the first pose, then, on the last third, the others in turn."""
    others = -(-placements // 3) if poses == "all" and num_poses > 1 else 0
    turn = placement - (placements - others)
    return 0 if turn < 0 else 1 + turn % (num_poses - 1)


def evaluate_view(job: ViewJob) -> ViewOutcome | UnseenView:
    """Everything that is tried on one view; decided by the object's name, the view's number and the seed."""
    torch.set_num_threads(1)
    protocol = job.protocol
    obj = with_density(job.source.load(), protocol.density)
    pose = pose_of_view(job.placement, protocol.placements, len(obj.resting_poses), protocol.poses)
    streams = _Streams.of([protocol.seed, crc32(obj.name.encode()), job.placement])
    try:
        view = ViewMaker(obj, obj.resting_poses[pose]).take(streams.view)
    except SceneError:
        return UnseenView(obj.name, obj.pose_names[pose])
    worker = _ViewTrials(obj, obj.resting_poses[pose], view, protocol, streams)
    return worker.run(obj.pose_names[pose], full=job.placement < protocol.full_views)


def with_density(obj: GraspObject, density: float | None) -> GraspObject:
    """The object with the mass of a solid of that density (kg/m³); as it is if None."""
    if density is None:
        return obj
    return dataclasses.replace(obj, mass=density * sum(float(piece.volume) for piece in obj.pieces))


@lru_cache(maxsize=1)
def load_network(weights: str | None) -> FFHNet:
    """Networks of a worker process, loaded once."""
    return FFHNet.from_pretrained(weights, device="cpu")


@dataclass(frozen=True)
class _Streams:
    """Randomness of one view, a stream for each purpose, so that doing more of one thing changes no other."""

    view: np.random.Generator
    sample: np.random.Generator
    draw: np.random.Generator
    groups: np.random.Generator
    stress: np.random.Generator
    heuristic: np.random.Generator

    @classmethod
    def of(cls, seed: list[int]) -> _Streams:
        return cls(*np.random.default_rng(seed).spawn(len(dataclasses.fields(cls))))


class _ViewTrials:
    """The grasps and trials of one view."""

    def __init__(
        self,
        obj: GraspObject,
        T_world_object: Float[np.ndarray, "4 4"],
        view: View,
        protocol: Protocol,
        streams: _Streams,
    ) -> None:
        self._obj, self._T_world_object, self._view = obj, T_world_object, view
        self._protocol, self._streams = protocol, streams
        self._network = load_network(protocol.weights)
        self._hand: Hand = load_hand(protocol.hand or self._network.info.hand)
        self._trial = GraspTrial(build_scene(self._hand, obj, protocol.physics))

    def run(self, pose_name: str, full: bool) -> ViewOutcome:
        grasps = self._generate()
        order = self._streams.draw.permutation(len(grasps))
        chosen, drawn = self._choose(len(grasps), order, full)
        results = self._execute(grasps[chosen])
        samples = Samples(
            rank=chosen,
            score=grasps.score[chosen],
            drawn=drawn,
            grasps=grasps[chosen],
            tries=Tries.of(results),
        )
        T = self._T_world_object
        corners = self._obj.visual.vertices @ T[2, :3] + T[2, 3]
        groups, nominal = self._groups(samples)
        stressed = try_stressed(self._trial, groups, T, self._streams.stress) if self._protocol.stress else []
        return ViewOutcome(
            object_name=self._obj.name,
            pose_name=pose_name,
            height=float(corners.max()),
            samples=samples,
            heuristic=self._heuristic(),
            conditions=(nominal, *stressed),
            strict=self._strict(grasps, order, groups) if self._protocol.strict else (),
            coverage=self._coverage(samples, results) if full else None,
            T_world_object=T,
            view=self._view if full else None,
        )

    def _generate(self) -> Grasps:
        """All samples in the world frame, in the network's order."""
        seed = int(self._streams.sample.integers(2**31))
        grasps = self._network.grasp(self._view.observation, self._protocol.samples, seed=seed)
        return grasps.to_frame(self._view.T_world_camera, "world")

    def _choose(self, count: int, order: np.ndarray, full: bool) -> tuple[np.ndarray, Bool[np.ndarray, " N"]]:
        """Ranks that are executed, ascending, and which of them are drawn."""
        wanted = count if self._protocol.executed is None else min(self._protocol.executed, count)
        ranks = np.arange(count)
        drawn = np.isin(ranks, order[:wanted])
        chosen = ranks[drawn | (ranks < TOP) | full]
        return chosen, drawn[chosen]

    def _execute(self, grasps: Grasps) -> TrialResults:
        return self._trial.run(grasps, self._T_world_object)

    def _groups(self, samples: Samples) -> tuple[Groups, Condition]:
        """The grasps that meet other worlds, and what became of them in the nominal one."""
        cloud = self._view.cloud_and_normals_world[0]
        top = np.flatnonzero(samples.rank < TOP)
        free = np.flatnonzero(samples.drawn & samples.tries.executed)
        random = self._streams.groups.permutation(free)[:STRESSED]
        groups = Groups(
            top=samples.grasps[top],
            random=samples.grasps[random],
            blind_random_yaw=blind_random_yaw(cloud, self._hand, 1, self._streams.groups),
            blind_short_side=blind_short_side(cloud, self._hand, 1, self._streams.groups),
        )
        nominal = Condition(
            name="nominal",
            top=samples.tries[top],
            random=samples.tries[random],
            blind_random_yaw=Tries.of(self._execute(groups.blind_random_yaw)),
            blind_short_side=Tries.of(self._execute(groups.blind_short_side)),
        )
        return groups, nominal

    def _strict(self, grasps: Grasps, order: np.ndarray, groups: Groups) -> tuple[Condition, ...]:
        """The best of the first so many samples in random order, and some of these at random."""
        first = order[:STRICT_OF]
        strict = dataclasses.replace(
            groups, top=grasps[np.sort(first)[:STRICT_BEST]], random=grasps[first[:STRESSED]]
        )
        return try_strict(StrictTrial(self._hand, self._obj), strict, self._T_world_object)

    def _coverage(self, samples: Samples, results: TrialResults) -> Coverage:
        stable = results.success
        grasps, closed = samples.grasps[stable], results.closed_joints[stable]
        codes = grasp_types(closed, results.contact_links[stable], self._hand).code
        return Coverage(
            stable=int(stable.sum()),
            distinct=int(is_distinct(grasps.position, grasps.rotation, closed).sum()),
            types=len(np.unique(codes)),
            type_entropy=entropy_bits(codes),
        )

    def _heuristic(self) -> Tries:
        """The paper's sampler on the same view, after its collision filter (Table II)."""
        wanted, rng = self._protocol.heuristic, self._streams.heuristic
        cloud, normals = self._view.cloud_and_normals_world
        grasps = sample_heuristic(cloud, normals, self._hand, DRAWS_PER_TRIAL * wanted, rng, PAPER)
        free = np.flatnonzero(self._trial.free(grasps, self._T_world_object))[:wanted]
        return Tries.of(self._execute(grasps[free]))
