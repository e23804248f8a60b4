"""Whether more noise of the camera raises what the networks promise, over many views.

    python benchmarks/noise.py --views 200 --json noise.json

Each view is taken with every amount of noise from the same place. Where no object is found any more nothing
is promised, which counts as 0. Leaves with status 1 where more noise than usual raised the mean by over 0.01.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.errors import FFHNetError
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.observation import observe_depth

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from scenes import depth_view

ALLOWED = 0.01
"""By which the mean may rise: no more than views differ by chance."""


@dataclass(frozen=True)
class Options:
    """Promises under more and more noise."""

    views: int = 200
    """Objects of the held-out split, one view each."""
    noise: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 8.0)
    """Factors of the usual noise, 1 among them."""
    num: int = 100
    """Grasps of each view."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


def main(options: Options) -> None:
    network = FFHNet.from_pretrained()
    names = [source.name for source in resolve_objects(f"procedural-test:{options.views}")]
    promised = np.zeros((len(names), len(options.noise), 2))
    with progress_bar("views", len(names)) as step:
        for i, name in enumerate(names):
            for j, noise in enumerate(options.noise):
                promised[i, j] = promise(network, name, i, noise, options.num)
            step()
    usual = promised[:, options.noise.index(1.0), 0]
    figures = [
        {
            "noise": noise,
            "views": len(names),
            "no_object": int((promised[:, j, 1] == 0).sum()),
            "mean_probability": round(float(promised[:, j, 0].mean()), 4),
            "against_usual": round(float((promised[:, j, 0] - usual).mean()), 4),
            "mean_of_best": round(float(promised[:, j, 1].mean()), 4),
        }
        for j, noise in enumerate(options.noise)
    ]
    columns = tuple(figures[0])
    print_table("Promises", columns, [[str(row[column]) for column in columns] for row in figures])
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    sys.exit(int(any(row["noise"] > 1 and row["against_usual"] > ALLOWED for row in figures)))


def promise(network: FFHNet, name: str, seed: int, noise: float, num: int) -> tuple[float, float]:
    """Mean and largest success probability of the grasps of a view; zeros where there is no object."""
    depth, _ = depth_view(name, seed, noise)
    try:
        observation = observe_depth(depth, REALSENSE_D415, np.random.default_rng(seed))
    except FFHNetError:
        return 0.0, 0.0
    probability = network.grasp(observation, num, seed=seed).probability
    return float(probability.mean()), float(probability.max())


if __name__ == "__main__":
    main(tyro.cli(Options))
