"""Which grasps a Panda reaches, and how often they end on the arm as they do with the floating hand.

    python benchmarks/arm_agreement.py [--objects 12] [--grasps 30] [--json FILE]

Heuristic grasps of both presets on held-out procedural objects that the open hand can take up. Those that the
arm reaches are executed with the floating hand and with the arm, whose lift is slower; with the floating hand
at the speed of the arm, which tells the speed from the arm; and with the floating hand moved by 3 mm, what
the calibration of a good robot leaves.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tyro
from jaxtyping import Bool
from rich.console import Console
from rich.progress import track
from rich.table import Table

from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.metrics import wilson_interval
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.procedural import make_object, split_seeds
from ffhnet.sampling.heuristic import PAPER, POWER, sample_heuristic
from ffhnet.simulation.panda.reach import PandaReach, Reach
from ffhnet.simulation.panda.scene import LIFT_DURATION, build_arm_scene
from ffhnet.simulation.panda.trial import ArmTrial
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial
from ffhnet.simulation.views import ViewMaker

SHIPPED, SLOW, ARM, SHIFTED = "floating", "floating, slow lift", "arm", "floating, moved by 3 mm"
PAIRS = ((SHIPPED, ARM), (SLOW, ARM), (SHIPPED, SLOW), (SHIPPED, SHIFTED))


@dataclass(frozen=True)
class Options:
    """What is measured.

    Attributes:
        objects: number of objects of the test split.
        grasps: executed grasps per object, at most.
        draws: proposals per object and preset.
        lift_duration: s of the arm's lift.
        seed: of views, proposals and shifts.
        json: where to write the figures, if anywhere.
    """

    objects: int = 12
    grasps: int = 30
    draws: int = 400
    lift_duration: float = LIFT_DURATION
    seed: int = 0
    json: Path | None = None


@dataclass(frozen=True)
class ObjectFigures:
    """Of one object: the reason of each candidate, the labels, and processor seconds.

    `hand_touches` counts reachable candidates whose open hand touches something in the arm's scene only.
    """

    reasons: np.ndarray
    hand_touches: int
    labels: dict[str, Bool[np.ndarray, " N"]]
    seconds_planning: float
    seconds_floating: float
    seconds_arm: float


def main(options: Options) -> None:
    hand = load_hand()
    parts = []
    for seed in track(split_seeds("procedural-test", options.objects), description="objects"):
        rng = np.random.default_rng([options.seed, seed])
        obj = make_object(seed)
        drawn = draw(obj, options.draws, rng)
        parts.append(measure(obj, drawn, options, rng))
    report = summarise(parts)
    report["protocol"] = {
        "hand": hand.name,
        "objects": options.objects,
        "grasps": options.grasps,
        "seed": options.seed,
        "lift_duration_arm_s": options.lift_duration,
        "physics": asdict(Physics()),
    }
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=2) + "\n")
    show(report)


def draw(obj: GraspObject, count: int, rng: np.random.Generator) -> Grasps:
    """Heuristic grasps of both presets from one view, shuffled."""
    cloud, normals = ViewMaker(obj, obj.resting_poses[0]).take(rng).cloud_and_normals_world
    hand = load_hand()
    parts = [sample_heuristic(cloud, normals, hand, count, rng, preset) for preset in (PAPER, POWER)]
    return Grasps.concatenate(parts)[rng.permutation(2 * count)]


def measure(obj: GraspObject, drawn: Grasps, options: Options, rng: np.random.Generator) -> ObjectFigures:
    """Plans all candidates that the open hand can take up, and executes the first reachable ones."""
    hand, pose = load_hand(), obj.resting_poses[0]
    floating = GraspTrial(build_scene(hand, obj))
    scene = build_arm_scene(hand, obj, Physics(lift_duration=options.lift_duration))
    candidates = drawn[floating.free(drawn, pose)]
    start = time.process_time()
    paths = PandaReach(scene).plan(candidates, pose)
    planned = time.process_time()
    arm = ArmTrial(scene)
    reachable = candidates[paths.reachable]
    free = arm.free(reachable, pose)
    grasps = reachable[np.flatnonzero(free)[: options.grasps]]

    before = time.process_time()
    shipped = floating.run(grasps, pose).success
    between = time.process_time()
    on_arm = arm.run(grasps, pose).success
    after = time.process_time()

    slow = GraspTrial(build_scene(hand, obj, Physics(lift_duration=options.lift_duration)))
    shift = rng.standard_normal(grasps.position.shape)
    shift *= 0.003 / np.linalg.norm(shift, axis=1, keepdims=True)
    labels = {
        SHIPPED: shipped,
        ARM: on_arm,
        SLOW: slow.run(grasps, pose).success,
        SHIFTED: floating.run(grasps.replace(position=grasps.position + shift), pose).success,
    }
    seconds = planned - start, between - before, after - between
    return ObjectFigures(paths.reason, int((~free).sum()), labels, *seconds)


def summarise(parts: list[ObjectFigures]) -> dict:
    """Counts over all objects, as written to JSON."""
    reasons = np.concatenate([part.reasons for part in parts])
    labels = {name: np.concatenate([part.labels[name] for part in parts]) for name in parts[0].labels}
    count = len(labels[SHIPPED])
    return {
        "candidates": len(reasons),
        "reasons": {reason.name: int((reasons == reason).sum()) for reason in Reach},
        "hand_touches_on_arm": sum(part.hand_touches for part in parts),
        "plan_ms_per_candidate": 1e3 * sum(part.seconds_planning for part in parts) / len(reasons),
        "floating_trials_per_s": count / sum(part.seconds_floating for part in parts),
        "arm_trials_per_s": count / sum(part.seconds_arm for part in parts),
        "executed": count,
        "pairs": [compare(labels, one, other) for one, other in PAIRS],
    }


def compare(labels: dict[str, Bool[np.ndarray, " N"]], one: str, other: str) -> dict:
    """The 2 x 2 counts of successes and the share of equal labels with its Wilson interval."""
    a, b = labels[one], labels[other]
    same = int((a == b).sum())
    interval = wilson_interval(same, len(a))
    return {
        "one": one,
        "other": other,
        "both": int((a & b).sum()),
        "only_one": int((a & ~b).sum()),
        "only_other": int((~a & b).sum()),
        "neither": int((~a & ~b).sum()),
        "agreement": same / len(a),
        "agreement_95": [interval.low, interval.high],
    }


def show(report: dict) -> None:
    console = Console(width=130)
    shares = ", ".join(
        f"{name} {count} ({count / report['candidates']:.1%})" for name, count in report["reasons"].items()
    )
    console.print(f"{report['candidates']} candidates: {shares}")
    console.print(
        f"planning {report['plan_ms_per_candidate']:.2f} ms per candidate; trials/s of one core: "
        f"floating {report['floating_trials_per_s']:.1f}, arm {report['arm_trials_per_s']:.1f}"
    )
    console.print(
        f"{report['executed']} executed; of the reachable, the open hand touches something only in the arm's "
        f"scene in {report['hand_touches_on_arm']}"
    )
    table = Table("one", "other", "both", "only one", "only other", "neither", "agreement")
    for row in report["pairs"]:
        low, high = row["agreement_95"]
        counts = [str(row[key]) for key in ("both", "only_one", "only_other", "neither")]
        agreement = f"{row['agreement']:.1%} ({low:.1%} to {high:.1%})"
        table.add_row(row["one"], row["other"], *counts, agreement)
    console.print(table)


if __name__ == "__main__":
    main(tyro.cli(Options))
