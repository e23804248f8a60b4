"""From a depth image to ranked grasps, stage by stage, and encodings of growing clouds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ffhnet.apps.extras import require_arm
from ffhnet.apps.speed import scene
from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.errors import MissingExtraError
from ffhnet.feasibility.planner import Planner
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import GraspTracker
from ffhnet.perception import bps
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.observation import Observation, observe_depth, observe_object
from ffhnet.perception.segment import segment_objects
from ffhnet.perception.table import fit_table

UP = np.array([0.0, 0.0, 1.0])
TRACKED = (25, 50, 100, 400)
"""Samples of a tracker for each cloud."""
BASE = (0.0, 0.35, 0.0, 0.0)
"""Where an arm stands beside the camera: x, y, z (m) and yaw (rad) in the level frame."""
CLOUD = 2000
"""Points of the cloud whose encoding and whole way count."""


def segmented(count: int = CLOUD) -> Observation:
    """The can, already cut out."""
    return observe_object(scene.visible_side(count), UP, "world")


def use_compiled_encoder() -> str:
    """Compile the encoder where that is possible; the name of the one that is in use."""
    try:
        bps.compile_encoder()
    except MissingExtraError:
        return "k-d tree"
    return "compiled"


def measure_pipeline(networks: Mapping[str, FFHNet], num: int, clock: Clock) -> dict[str, Times]:
    """Times of each stage by itself, and with each of the networks of whole ways.

    From a segmented cloud to ranked grasps, and from a depth image to those that the hand can do, without and
    with an arm.
    """
    image, rng = scene.depth_image(), np.random.default_rng
    cloud, _ = depth_to_cloud(image, scene.INTRINSICS)
    plane, observation = fit_table(cloud, rng(0)), segmented()

    def observe() -> Observation:
        return observe_depth(image, scene.INTRINSICS, rng(0))

    ways: dict[str, Callable[[], object]] = {
        "depth_to_cloud": lambda: depth_to_cloud(image, scene.INTRINSICS),
        "plane": lambda: fit_table(cloud, rng(0)),
        "segment": lambda: segment_objects(cloud, plane),
        "depth_to_observation": observe,
        "bps": lambda: bps.encode(observation.cloud_view),
        "rank": networks["engine"].grasp(observation, num).ranked,
    }
    for name, network in networks.items():
        ways[f"{name}: whole"] = partial(_grasp, network, num)
        for way, planner in _planners(network).items():
            ways[f"{name}: {way}"] = partial(_plan, planner, observe, num)
    return clock.in_turns(ways)


def _planners(network: FFHNet) -> dict[str, Planner]:
    """Without an arm, and with one where what it needs is installed."""
    hand = load_hand(network.info.hand)
    planners = {"depth_to_feasible": Planner(network, hand)}
    try:
        require_arm("benchmark")
    except MissingExtraError:
        return planners
    from ffhnet.feasibility.arm import ArmCheck, Base

    return {**planners, "depth_to_reachable": Planner(network, hand, ArmCheck(hand, Base(*BASE)))}


def _grasp(network: FFHNet, num: int) -> None:
    network.grasp(segmented(), num)


def _plan(planner: Planner, observe: Callable[[], Observation], num: int) -> None:
    planner.plan(observe(), num)


def measure_tracking(networks: Mapping[str, FFHNet], clock: Clock) -> list[dict[str, Any]]:
    """From a segmented cloud to the grasp to go for, once per cloud of a stream."""
    trackers = {
        (name, num): GraspTracker(network, num) for name, network in networks.items() for num in TRACKED
    }
    times = clock.in_turns({f"{key}": partial(_follow, tracker) for key, tracker in trackers.items()})
    return [
        {"weights": key[0], "grasps": key[1], "ms": (ms := times[f"{key}"].median), "per_second": 1e3 / ms}
        for key in trackers
    ]


def _follow(tracker: GraspTracker) -> None:
    tracker.update(segmented())


def measure_encodings(counts: Sequence[int], clock: Clock) -> list[dict[str, float | None]]:
    """Encoding of growing clouds by the k-d tree, and by compiled code where numba is installed."""
    compiled = use_compiled_encoder() == "compiled"
    rows: list[dict[str, float | None]] = []
    for count in counts:
        cloud = segmented(count).cloud_view
        ways = {"tree": partial(bps.encode, cloud, bps.basis_points())}
        if compiled:
            ways["compiled"] = partial(bps.encode, cloud)
        times = clock.in_turns(ways)
        rows.append(
            {
                "points": count,
                "tree_ms": times["tree"].median,
                "compiled_ms": times["compiled"].median if compiled else None,
            }
        )
    return rows
