"""Whether reduced precision changes the answers: the same views, once exact and once reduced.

    python benchmarks/precision.py --views 200 --json docs/results/precision.json

Half of the views are of `procedural-test`, half of `varied-test`. Per view: rank correlation (Spearman) of
the scores, whether the same sample is best, and how far palms moved. Needs a processor that multiplies
bfloat16; on others nothing differs.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from scipy.stats import spearmanr

from ffhnet.apps.console import absent, print_table, progress_bar
from ffhnet.errors import FFHNetError
from ffhnet.inference import FFHNet
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.observation import Observation, observe_depth

sys.path.append(str(Path(__file__).parents[1] / "tests" / "robustness"))

from scenes import depth_view


@dataclass(frozen=True)
class Options:
    """Agreement of reduced with exact precision."""

    views: int = 200
    """Objects, one view each."""
    num: int = 400
    """Grasps of each view."""
    weights: Annotated[Path | None, absent("DIR", "the package's own")] = None
    """Folder of the weights."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


def main(options: Options) -> None:
    exact, reduced = (
        FFHNet.from_pretrained(options.weights, device="cpu", precision=precision)
        for precision in ("exact", "reduced")
    )
    half = options.views // 2
    names = [s.name for kind in ("procedural", "varied") for s in resolve_objects(f"{kind}-test:{half}")]
    rows = []
    with progress_bar("views", len(names)) as step:
        for seed, name in enumerate(names):
            try:
                depth, _ = depth_view(name, seed, 1.0)
                observation = observe_depth(depth, REALSENSE_D415, np.random.default_rng(seed))
            except FFHNetError:
                continue
            finally:
                step()
            rows.append(compare(exact, reduced, observation, options.num, seed))
    correlation, same, moved, lost = np.array(rows).T
    figures = {
        "views": len(rows),
        "rank_correlation_mean": round(float(correlation.mean()), 6),
        "rank_correlation_lowest": round(float(correlation.min()), 6),
        "same_best": int(same.sum()),
        "palm_moved_mm_mean": round(1e3 * float(moved.mean()), 3),
        "palm_moved_mm_worst_view": round(1e3 * float(moved.max()), 3),
        "score_lost_by_another_best": round(float(lost.max()), 6),
    }
    print_table("Reduced against exact", ("figure", "value"), [[k, str(v)] for k, v in figures.items()])
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


def compare(
    exact: FFHNet, reduced: FFHNet, observation: Observation, num: int, seed: int
) -> tuple[float, bool, float, float]:
    """Rank correlation, whether the best sample is the same, mean m moved, exact score lost."""
    samples = [
        network.generate(observation, num, torch.Generator().manual_seed(seed)).to_frame(
            observation.T_input_view, observation.frame
        )
        for network in (exact, reduced)
    ]
    rated = [exact.evaluate(observation, part) for part in samples]
    wanted, got = (part.score for part in rated)
    moved = np.linalg.norm(samples[0].position - samples[1].position, axis=1)
    best = int(np.argmax(got))
    lost = float(wanted.max() - wanted[best])
    return float(spearmanr(wanted, got)[0]), best == int(np.argmax(wanted)), float(moved.mean()), lost


if __name__ == "__main__":
    main(tyro.cli(Options))
