"""From a depth image to ranked grasps, stage by stage, and encodings of growing clouds."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from ffhnet.apps.speed import scene
from ffhnet.apps.speed.clock import Clock, Times
from ffhnet.errors import MissingExtraError
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


def measure_pipeline(network: FFHNet, num: int, clock: Clock) -> dict[str, Times]:
    """Times of each stage by itself, and of the whole way from a segmented cloud to ranked grasps."""
    image, rng = scene.depth_image(), np.random.default_rng
    cloud, _ = depth_to_cloud(image, scene.INTRINSICS)
    plane = fit_table(cloud, rng(0))
    observation, rated = segmented(), network.grasp(segmented(), num)
    return clock.in_turns(
        {
            "depth_to_cloud": lambda: depth_to_cloud(image, scene.INTRINSICS),
            "plane": lambda: fit_table(cloud, rng(0)),
            "segment": lambda: segment_objects(cloud, plane),
            "depth_to_observation": lambda: observe_depth(image, scene.INTRINSICS, rng(0)),
            "bps": lambda: bps.encode(observation.cloud_view),
            "networks_and_rank": lambda: network.grasp(observation, num),
            "rank": rated.ranked,
            "whole": lambda: network.grasp(segmented(), num),
        }
    )


def measure_tracking(network: FFHNet, clock: Clock) -> list[dict[str, float]]:
    """From a segmented cloud to the grasp to go for, once per cloud of a stream."""
    trackers = {num: GraspTracker(network, num) for num in TRACKED}
    times = clock.in_turns({f"{num}": partial(_follow, tracker) for num, tracker in trackers.items()})
    return [
        {"grasps": num, "ms": times[f"{num}"].median, "per_second": 1e3 / times[f"{num}"].median}
        for num in TRACKED
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
