"""How often what is an object is called novel, and how often what is none is not.

    python benchmarks/novelty.py --captures ../shared/data/captures --meshes ../shared/data/meshes

Objects are those of the test splits, and where their folders are given registered scans and objects of real
captures by their masks. The limit is that of the weights' calibration (`ffhnet calibrate`).
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import trimesh
import tyro

from ffhnet.apps.console import absent, print_table
from ffhnet.errors import FFHNetError
from ffhnet.evaluation.captures import find_captures, read_capture
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, random_camera, render_depth
from ffhnet.perception.observation import Observation, observe_depth, observe_object
from ffhnet.perception.sensor_noise import StereoNoise
from ffhnet.simulation.views import ViewMaker

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from scenes import LIKE_OBJECTS, STRANGE

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Options:
    """What is called novel."""

    objects: tuple[str, ...] = ("procedural-test:100", "varied-test:100")
    """Objects that trained and calibrated nothing."""
    views: int = 2
    """Of each object, its resting poses in turn."""
    captures: Annotated[Path | None, absent("DIR")] = None
    """Folder of real captures with masks."""
    meshes: Annotated[Path | None, absent("DIR")] = None
    """Folder of scanned meshes GROUP/NAME.obj that rest on z = 0, metres."""
    num: int = 100
    """Grasps sampled of each strange cloud."""
    weights: Annotated[Path | None, absent("DIR")] = None
    """Calibrated weights; those of the package if none."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


def main(options: Options) -> None:
    network = FFHNet.from_pretrained(options.weights)
    if network.calibration is None or network.calibration.novelty is None:
        sys.exit("these weights do not know what is novel to them: run `ffhnet calibrate`")
    limit = network.calibration.novelty
    sources = {spec: simulated(spec, options.views) for spec in options.objects}
    if options.meshes is not None:
        sources["scanned meshes"] = scanned(options.meshes)
    if options.captures is not None:
        sources["real captures, by mask"] = captured(options.captures)
    familiar = {name: rates(network, views) for name, views in sources.items()}
    strange = {name: judge(network, cloud, options.num) for name, cloud in (STRANGE | LIKE_OBJECTS).items()}
    print(f"limit {limit.limit:.3f} for {limit.false_alarms:.1%} of {limit.views} views")
    for title, figures in (("Objects", familiar), ("What is no object", strange)):
        columns = tuple(next(iter(figures.values())))
        rows = [[name, *(f"{row[column]:g}" for column in columns)] for name, row in figures.items()]
        print_table(title, ("", *columns), rows)
    if options.json is not None:
        content = {"limit": limit.to_json(), "objects": familiar, "strange": strange}
        options.json.write_text(json.dumps(content, indent=1) + "\n")
    sys.exit(int(any(strange[name]["novelty"] <= 1 for name in STRANGE)))


def simulated(spec: str, views: int) -> Iterator[Observation]:
    for source in resolve_objects(spec):
        obj = source.load()
        for number in range(views):
            pose = obj.resting_poses[number % len(obj.resting_poses)]
            try:
                yield ViewMaker(obj, pose).take(np.random.default_rng(number)).observation
            except FFHNetError:
                continue


def scanned(folder: Path) -> Iterator[Observation]:
    for number, path in enumerate(sorted(folder.glob("*/*.obj"))):
        mesh = trimesh.load(path, force="mesh")
        rng = np.random.default_rng(number)
        T_world_camera = random_camera(rng, np.array([0.0, 0.0, mesh.bounds[1, 2] / 2]))
        depth = render_depth([mesh], T_world_camera, REALSENSE_D415)
        try:
            yield observe_depth(StereoNoise().apply(depth, REALSENSE_D415, rng), REALSENSE_D415, rng)
        except FFHNetError:
            continue


def captured(folder: Path) -> Iterator[Observation]:
    for place in find_captures(folder):
        capture = read_capture(place)
        for number in capture.objects:
            try:
                yield capture.observe_masked(number)
            except FFHNetError:
                continue


def rates(network: FFHNet, views: Iterator[Observation]) -> dict[str, float]:
    """How many views there are, how many of them are novel, and quantiles of their novelty."""
    scores = np.array([network.novelty(view) for view in views], dtype=float)
    return {
        "views": len(scores),
        "novel": int((scores > 1).sum()),
        "median": round(float(np.median(scores)), 3),
        "high": round(float(np.quantile(scores, 0.99)), 3),
    }


def judge(network: FFHNet, cloud: np.ndarray, num: int) -> dict[str, float]:
    """Novelty, and what the networks promise all the same."""
    observation = observe_object(cloud, UP, "world")
    probability = network.grasp(observation, num).probability
    score = network.novelty(observation)
    figures = {"novelty": score, "mean": probability.mean(), "best": probability.max()}
    return {name: round(float(value), 3) for name, value in figures.items()}


if __name__ == "__main__":
    main(tyro.cli(Options))
