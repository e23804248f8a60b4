"""What is tried on one object: views, proposals and trials at each resting pose (section IV-B)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from ffhnet.dataset.records import TrialBlock, ViewBlock, ViewRow, as_stored
from ffhnet.errors import SceneError
from ffhnet.grasps import Grasps
from ffhnet.hands import DEFAULT_HAND, load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.sampling.heuristic import DRAWS_PER_TRIAL, PAPER, POWER, HeuristicConfig, sample_heuristic
from ffhnet.sampling.perturb import perturb
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.variation import Variation, held_under_variation
from ffhnet.simulation.views import View, ViewMaker

if TYPE_CHECKING:
    from ffhnet.inference.ffhnet import FFHNet


@dataclass(frozen=True)
class GenerateConfig:
    """What is tried on each object.

    Attributes:
        hand: name of the hand, or path of its TOML.
        seed: of all randomness, together with the object's seed.
        placements: resting poses per object, at most.
        views: simulated views per placement.
        heuristic: executed trials per placement of the paper's sampler.
        power: executed trials per placement of the power-grasp preset of the sampler.
        perturb_rounds: rounds of perturb-and-keep.
        perturb: trials per round and placement.
        max_collisions: start collisions kept as negatives per proposer and placement.
        learned: executed trials per placement of a trained generator; with `weights`.
        rounds: how often all proposers are asked, at most; again only where too few grasps held.
        enough: successes of a placement after which they are not asked again.
        repeated_share: share of the trials that touched the object which are repeated under variation.
        repeats: how often.
        weights: folder of weights, or None for no learned proposals.
    """

    hand: str = DEFAULT_HAND
    seed: int = 0
    placements: int = 2
    views: int = 4
    heuristic: int = 20
    power: int = 35
    perturb_rounds: int = 2
    perturb: int = 40
    max_collisions: int = 20
    learned: int = 0
    rounds: int = 1
    enough: int = 20
    weights: str | None = None
    repeated_share: float = 0.05
    repeats: int = 5
    variation: Variation = field(default_factory=Variation)
    physics: Physics = field(default_factory=Physics)


def try_object(obj: GraspObject, config: GenerateConfig) -> tuple[list[TrialBlock], list[ViewBlock]]:
    """All trials and views of one object, decided by its name and the configuration alone.

    A resting pose at which nothing can be observed (too flat to be told from the table) is left out.
    """
    trials: list[TrialBlock] = []
    views: list[ViewBlock] = []
    for placement in range(min(config.placements, len(obj.resting_poses))):
        rng = np.random.default_rng([config.seed, crc32(obj.name.encode()), placement])
        try:
            worker = _Placement(obj, placement, config, rng)
        except SceneError:
            continue
        trials += worker.try_all()
        views.append(ViewBlock(placement, worker.view_rows()))
    return trials, views


class _Placement:
    """One object at rest, its views, and the trials on it."""

    def __init__(
        self, obj: GraspObject, placement: int, config: GenerateConfig, rng: np.random.Generator
    ) -> None:
        self._config, self._placement, self._rng = config, placement, rng
        self._hand = load_hand(config.hand)
        self._T_world_object = obj.resting_poses[placement]
        self._trial = GraspTrial(build_scene(self._hand, obj, config.physics))
        maker = ViewMaker(obj, self._T_world_object)
        self._views: list[View] = [maker.take(rng) for _ in range(config.views)]

    def view_rows(self) -> list[ViewRow]:
        return [
            ViewRow(view.observation.bps, view.observation.table_height, view.T_world_view)
            for view in self._views
        ]

    def try_all(self) -> list[TrialBlock]:
        config = self._config
        proposers: list[tuple[str, int, Callable[[View, int], Grasps]]] = [
            ("heuristic", config.heuristic, partial(self._sample, PAPER)),
            ("power", config.power, partial(self._sample, POWER)),
        ]
        if config.weights is not None:
            network = _load_network(config.weights)
            proposers.append(("learned", config.learned, partial(self._generate, network)))
        blocks: list[TrialBlock] = []
        for _ in range(config.rounds):
            blocks += self._try_round(proposers, blocks)
            if sum(np.count_nonzero(block.results.success) for block in blocks) >= config.enough:
                break
        return [block for block in blocks if len(block.grasps)]

    def _try_round(
        self, proposers: list[tuple[str, int, Callable[[View, int], Grasps]]], before: list[TrialBlock]
    ) -> list[TrialBlock]:
        """What each proposer proposes, then rounds of perturb-and-keep around the successes so far."""
        config = self._config
        blocks = [self._try(name, wanted, propose) for name, wanted, propose in proposers if wanted > 0]
        for _ in range(config.perturb_rounds if config.perturb > 0 else 0):
            good = [
                (block.grasps[block.results.success], block.results.closed_joints[block.results.success])
                for block in before + blocks
            ]
            parents = Grasps.concatenate([grasps for grasps, _ in good])
            if len(parents) == 0:
                break
            chosen = self._rng.integers(len(parents), size=config.perturb)
            closed = np.concatenate([joints for _, joints in good])[chosen]
            children = perturb(parents[chosen], closed, self._hand, self._rng)
            blocks.append(self._block("perturb", children))
        return blocks

    def _block(self, proposer: str, grasps: Grasps) -> TrialBlock:
        grasps = as_stored(grasps)
        results = self._trial.run(grasps, self._T_world_object)
        chosen = (results.contact_links > 0) & (self._rng.random(len(grasps)) < self._config.repeated_share)
        repeats, held = np.where(chosen, self._config.repeats, 0), np.zeros(len(grasps), dtype=int)
        held[chosen] = held_under_variation(
            self._trial,
            grasps[chosen],
            self._T_world_object,
            self._config.repeats,
            self._rng,
            self._config.variation,
        )
        return TrialBlock(self._placement, proposer, grasps, results, repeats, held)

    def _try(self, name: str, wanted: int, propose: Callable[[View, int], Grasps]) -> TrialBlock:
        """Draws from all views; runs grasps that can be executed, and some that collide as negatives."""
        per_view = -(-wanted * DRAWS_PER_TRIAL // len(self._views))
        drawn = Grasps.concatenate([propose(view, per_view) for view in self._views])
        drawn = as_stored(drawn[self._rng.permutation(len(drawn))])
        free: list[int] = []
        colliding: list[int] = []
        for i in range(len(drawn)):
            reached = bool(self._trial.free(drawn[i : i + 1], self._T_world_object)[0])
            (free if reached else colliding).append(i)
            if len(free) == wanted:
                break
        chosen = free + colliding[: self._config.max_collisions]
        return self._block(name, drawn[np.array(chosen, dtype=np.intp)])

    def _sample(self, preset: HeuristicConfig, view: View, count: int) -> Grasps:
        """The heuristic sampler on what a view shows, in the world frame."""
        return sample_heuristic(*view.cloud_and_normals_world, self._hand, count, self._rng, preset)

    def _generate(self, network: FFHNet, view: View, count: int) -> Grasps:
        """Raw samples of a trained generator, in the world frame."""
        import torch

        source = torch.Generator().manual_seed(int(self._rng.integers(2**31)))
        return network.generate(view.observation, count, source).to_frame(view.T_world_view, "world")


@lru_cache(maxsize=1)
def _load_network(weights: str) -> FFHNet:
    """Networks of a worker process, loaded once."""
    import torch

    from ffhnet.inference.ffhnet import FFHNet

    torch.set_num_threads(1)
    return FFHNet.from_pretrained(weights, device="cpu")
