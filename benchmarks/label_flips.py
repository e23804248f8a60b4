"""How many labels change at a four times finer time step, and how fast trials run.

    python benchmarks/label_flips.py [--objects 12] [--grasps 40]

Heuristic grasps of both presets on held-out procedural objects, executed with the shipped physics, with a
quarter of its time step, and again with the object moved by a micrometre: the last row is the floor, what
rounding alone does to grasps on the edge.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass

import numpy as np
import tyro
from rich.progress import track

from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.metrics import wilson_interval
from ffhnet.objects.procedural import make_object, procedural_split
from ffhnet.sampling.heuristic import PAPER, POWER, sample_heuristic
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.views import ViewMaker


@dataclass(frozen=True)
class Options:
    objects: int = 12
    grasps: int = 40
    seed: int = 0


def main(options: Options) -> None:
    shipped = Physics()
    fine = dataclasses.replace(shipped, timestep=shipped.timestep / 4)
    labels: dict[str, list[np.ndarray]] = {"shipped": [], "fine": [], "moved by 1 µm": []}
    seconds, hand = 0.0, load_hand()
    for seed in track(procedural_split("test", options.objects), description="objects"):
        obj, rng = make_object(seed), np.random.default_rng([options.seed, seed])
        pose = obj.resting_poses[0]
        cloud, normals = ViewMaker(obj, pose).take(rng).cloud_and_normals_world
        trial = GraspTrial(build_scene(hand, obj, shipped))
        drawn = Grasps.concatenate(
            [
                sample_heuristic(cloud, normals, hand, 15 * options.grasps, rng, preset)
                for preset in (PAPER, POWER)
            ]
        )[rng.permutation(30 * options.grasps)]
        grasps = drawn[np.flatnonzero(trial.free(drawn, pose))[: options.grasps]]
        start = time.process_time()
        labels["shipped"].append(trial.run(grasps, pose).success)
        seconds += time.process_time() - start
        labels["fine"].append(GraspTrial(build_scene(hand, obj, fine)).run(grasps, pose).success)
        moved = pose.copy()
        moved[0, 3] += 1e-6
        labels["moved by 1 µm"].append(trial.run(grasps, moved).success)
    joined = {name: np.concatenate(parts) for name, parts in labels.items()}
    count = len(joined["shipped"])
    print(f"{count} executed grasps, {count / seconds:.1f} trials/s of one core")
    for name, label in joined.items():
        flips = int((label != joined["shipped"]).sum())
        interval = wilson_interval(flips, count)
        print(
            f"{name:14s} success {label.mean():.3f}, differs from shipped on {flips}/{count} = "
            f"{flips / count:.2%} (95 % {interval.low:.2%} to {interval.high:.2%})"
        )


if __name__ == "__main__":
    main(tyro.cli(Options))
