"""What the check of feasibility finds, what it costs in grasps, and what it costs in time.

    python benchmarks/feasibility.py [--objects 24] [--json FILE]

On one noisy view of each held-out procedural object: the verdict on the network's samples, and on the same
palms shaken by 2 cm and 0.25 rad, against start collisions in physics, which know the whole object; how many
feasible grasps a Panda 0.6 m from the object reaches, by where it stands as the camera sees it; and the time
of a processor from the depth image to the ranked list, the stages taking turns.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro

from ffhnet.feasibility.arm import ArmCheck, Base, observed_level_frame
from ffhnet.feasibility.hand_check import HandCheck, Margins
from ffhnet.feasibility.planner import Planner
from ffhnet.feasibility.reasons import Reason
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import invert
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.perception.camera import REALSENSE_D415, random_camera, render_depth
from ffhnet.perception.observation import Observation, observe_depth
from ffhnet.perception.sensor_noise import StereoNoise
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial

SIDES = {"with the camera": 0.0, "beside the camera": np.pi / 2, "opposite the camera": np.pi}
"""Direction from the object to the arm's base, seen from above; 0 = towards the camera."""

DISTANCE = 0.6
"""m from the object to the arm's base."""


@dataclass(frozen=True)
class Options:
    """What is measured.

    Attributes:
        objects: number of objects of the test split, one view each.
        reached: feasible grasps of each view, drawn at random, for which the arm's ways are planned.
        object_margin: m, of the hand to the object.
        seed: of views and samples.
        json: where to write the figures, if anywhere.
    """

    objects: int = 24
    reached: int = 40
    object_margin: float = Margins.object
    seed: int = 0
    json: Path | None = None


def main(options: Options) -> None:
    torch.set_num_threads(1)
    network = FFHNet.from_pretrained(device="cpu")
    hand = load_hand(network.info.hand)
    check = HandCheck(hand, Margins(object=options.object_margin))
    verdicts = {"samples": np.zeros(4, int), "shaken samples": np.zeros(4, int)}
    reached = {side: np.zeros(2, int) for side in SIDES}
    seconds: dict[str, list[float]] = {}
    for number, source in enumerate(resolve_objects(f"procedural-test:{options.objects}")):
        obj, rng = source.load(), np.random.default_rng([options.seed, number])
        depth, T_world_camera = look_at_object(obj, rng)
        observation = observe_depth(depth, REALSENSE_D415, rng)
        grasps = network.grasp(observation, seed=number)
        shake = rng.normal(size=(2, len(grasps), 3))
        turn = matrix_from_rotation_vector(0.25 * shake[1])
        shaken = grasps.replace(position=grasps.position + 0.02 * shake[0], rotation=grasps.rotation @ turn)
        trial, scene = GraspTrial(build_scene(hand, obj)), check.look(observation)
        for name, batch in (("samples", grasps), ("shaken samples", shaken)):
            feasible = check(batch, scene) == Reason.FEASIBLE
            free = trial.free(batch.to_frame(T_world_camera, "world"), obj.resting_poses[0])
            verdicts[name] += [np.sum(f & t) for f in (~feasible, feasible) for t in (~free, free)]
        able = np.flatnonzero(check(grasps, scene) == Reason.FEASIBLE)
        drawn = grasps[np.sort(rng.permutation(able)[: options.reached])]
        for side, angle in SIDES.items():
            arm = ArmCheck(hand, base_at(observation, angle))
            reason, _ = arm.plan(drawn, observation, arm.look(observation))
            reached[side] += [np.sum(reason == Reason.FEASIBLE), len(drawn)]
        of_hand, of_arm = Planner(network, hand), Planner(network, hand, arm)
        stages: dict[str, Callable[[], Any]] = {
            "observe": lambda: observe_depth(depth, REALSENSE_D415, np.random.default_rng(0)),  # noqa: B023
            "network": lambda: network.grasp(observation),  # noqa: B023
            "plan, hand": lambda: of_hand.plan(observation),  # noqa: B023
            "plan, arm": lambda: of_arm.plan(observation),  # noqa: B023
        }
        for _ in range(3):
            for name, stage in stages.items():
                begin = time.process_time()
                stage()
                seconds.setdefault(name, []).append(time.process_time() - begin)
        print(obj.name, {side: counts.tolist() for side, counts in reached.items()}, flush=True)
    report = {
        "options": {"objects": options.objects, "object_margin": options.object_margin, "seed": options.seed},
        "verdicts": {name: describe(counts) for name, counts in verdicts.items()},
        "reached": {side: {"reached": int(a), "of": int(b)} for side, (a, b) in reached.items()},
        "median_ms": {name: round(1000 * float(np.median(values)), 1) for name, values in seconds.items()},
        "fastest_ms": {name: round(1000 * min(values), 1) for name, values in seconds.items()},
    }
    print(json.dumps(report, indent=1))
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")


def look_at_object(obj: GraspObject, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A noisy depth image and the camera's pose."""
    T_world_camera = random_camera(rng, np.array([0.0, 0.0, 0.08]))
    mesh = obj.visual.copy().apply_transform(obj.resting_poses[0])
    depth = render_depth([mesh], T_world_camera, REALSENSE_D415)
    return StereoNoise().apply(depth, REALSENSE_D415, rng), T_world_camera


def base_at(observation: Observation, angle: float) -> Base:
    """A base that looks at the object from an angle to the direction towards the camera."""
    middle = (invert(observed_level_frame(observation)) @ observation.T_input_view)[:3, 3]
    towards = np.arctan2(-middle[1], -middle[0]) + angle
    x, y = middle[:2] + DISTANCE * np.array([np.cos(towards), np.sin(towards)])
    return Base(float(x), float(y), 0.0, float(towards + np.pi))


def describe(counts: np.ndarray) -> dict[str, Any]:
    """Of dropped and kept, which collide in physics."""
    caught, free_dropped, missed, free_kept = (int(n) for n in counts)
    return {
        "dropped, colliding": caught,
        "dropped, free": free_dropped,
        "kept, colliding": missed,
        "kept, free": free_kept,
        "recall": round(caught / max(caught + missed, 1), 4),
        "precision": round(caught / max(caught + free_dropped, 1), 4),
        "kept_free_share": round(free_kept / max(missed + free_kept, 1), 4),
    }


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
