"""What the viewer shows: an object from one view and its ranked grasps, in a world with the table at 0."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ffhnet.apps.capture_options import CaptureOptions, NetworkOptions, check_capture, observe_capture
from ffhnet.feasibility.planner import Planner
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.perception.observation import Observation
from ffhnet.simulation.views import ViewMaker

_EXAMPLES_AMONG = 40
"""Held-out objects of which the first of each family is an example."""


@dataclass(frozen=True)
class KnownObject:
    """The whole object, and its pose in the world."""

    obj: GraspObject
    T_world_object: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class Sight:
    """One object from one view, and the grasps for it.

    Attributes:
        title: name of a file or of an example.
        cloud: visible points of the object (m) in the world frame.
        forward: horizontal direction of length 1 in which the camera looked, world frame.
        grasps: ranked, best first, in the world frame.
        in_input: the same grasps in the frame of the input, as `ffhnet grasp` gives them.
        dropped: how many more were sampled that the hand cannot take up in the scene.
        known: the whole object, where it is an example.
    """

    title: str
    cloud: Float[np.ndarray, "N 3"]
    forward: Float[np.ndarray, " 3"]
    grasps: Grasps
    in_input: Grasps
    dropped: int = 0
    known: KnownObject | None = None


class Looker:
    """Makes sights: one pair of networks and one way of sampling for all of them."""

    def __init__(self, network: FFHNet, hand: Hand, sampling: NetworkOptions) -> None:
        """The threshold of `sampling` is not applied: the viewer has a slider for it."""
        self._network, self._planner = network, Planner(network, hand)
        self._sampling = sampling

    def file(self, path: Path, capture: CaptureOptions) -> Sight:
        """Grasps for what a file shows; raises what `observe_capture` raises."""
        check_capture(path, capture)
        observation = observe_capture(path, capture, self._rng())
        T_world_view = make_transform(position=np.array([0.0, 0.0, -observation.table_height]))
        return self._sight(path.name, observation, T_world_view @ invert(observation.T_input_view))

    def example(self, name: str) -> Sight:
        """Grasps for a procedural object, as a simulated camera sees it from somewhere."""
        obj = resolve_objects(name)[0].load()
        known = KnownObject(obj, obj.resting_poses[0])
        view = ViewMaker(obj, known.T_world_object).take(self._rng())
        return self._sight(name, view.observation, view.T_world_camera, known)

    def _rng(self) -> np.random.Generator:
        return np.random.default_rng(self._sampling.seed)

    def _sight(
        self,
        title: str,
        observation: Observation,
        T_world_input: Float[np.ndarray, "4 4"],
        known: KnownObject | None = None,
    ) -> Sight:
        num, seed = self._sampling.num, self._sampling.seed
        if observation.plane is None:
            in_input, dropped = self._network.grasp(observation, num, seed), 0
        else:
            plan = self._planner.plan(observation, num, seed)
            in_input, dropped = plan.grasps, len(plan.dropped)
        return Sight(
            title=title,
            cloud=apply(T_world_input, observation.cloud),
            forward=(T_world_input @ observation.T_input_view)[:3, 0],
            grasps=in_input.to_frame(T_world_input, "world"),
            in_input=in_input,
            dropped=dropped,
            known=known,
        )


def example_names() -> list[str]:
    """Objects that no network was trained on, one of each family."""
    first: dict[str, str] = {}
    for source in resolve_objects(f"procedural-test:{_EXAMPLES_AMONG}"):
        first.setdefault(source.name.rpartition("_")[0], source.name)
    return sorted(first.values())
