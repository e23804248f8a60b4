"""`ffhnet grasp`: a capture in, ranked grasps out."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.capture_options import (
    INPUT_HELP,
    CaptureOptions,
    File,
    NetworkOptions,
    check_capture,
    load_network,
    observe_all,
    observe_capture,
)
from ffhnet.apps.console import absent, busy, print_table
from ffhnet.apps.extras import require_arm
from ffhnet.errors import OptionError, WeightsError

if TYPE_CHECKING:
    from ffhnet.grasp_plan import GraspPlan
    from ffhnet.grasps import Grasps
    from ffhnet.hands import Hand
    from ffhnet.inference import FFHNet
    from ffhnet.perception.observation import Observation

_SHOWN = 10


@dataclass(frozen=True, kw_only=True)
class GraspOptions(NetworkOptions, CaptureOptions):
    """Grasps for one object, ranked by the probability that they hold."""

    input: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(help=INPUT_HELP)]
    all_objects: bool = False
    """Grasps for every object of a scene; those of object K are written to NAME_K."""
    feasibility: bool = True
    """Leave out grasps at which the hand hits the table or what was seen, where a table was found."""
    robot: Annotated[Literal["panda"] | None, absent("panda")] = None
    """Leave out grasps that this arm does not reach, too, and give its joint angles for the best others."""
    base: Annotated[tuple[float, float, float, float] | None, absent("X Y Z YAW")] = None
    """Where the arm's base stands, metres and radians: ahead and to the left of the point of the table below
    the camera, above the table; for a cloud with --world in its frame, but above the table."""
    max_failure: Annotated[float | None, absent("P")] = None
    """Abstain where the best grasp cannot be promised to fail at most this often, with 95 % confidence."""
    refuse_novel: bool = False
    """Abstain from an object unlike all that the networks were trained on, instead of only saying so."""
    out: File = None
    """Write all grasps to this .json or .npz, best first, in the frame of the input."""
    plot: File = None
    """Write a picture to this .png."""


def run(options: GraspOptions) -> None:
    """Observe, then grasp one object or all of them."""
    import numpy as np

    from ffhnet.files import check_output
    from ffhnet.grasps_file import SUFFIXES

    check_capture(options.input, options)
    _check_robot(options)
    if options.out is not None:
        check_output(options.out, SUFFIXES)
    if options.plot is not None:
        check_output(options.plot, (".png",))
    with busy("loading"):
        rng = np.random.default_rng(options.seed)
        if options.all_objects:
            seen = observe_all(options.input, options, rng)
        else:
            seen = [observe_capture(options.input, options, rng)]
        network, hand = load_network(options)
    for number, observation in enumerate(seen):
        if options.all_objects:
            print(f"object {number} of {len(seen)}")
        _grasp_one(_numbered(options, number), observation, network, hand)


def _numbered(options: GraspOptions, number: int) -> GraspOptions:
    """The options for one object, whose files are numbered where there are several objects."""

    def numbered(path: Path | None) -> Path | None:
        return path if path is None else path.with_stem(f"{path.stem}_{number}")

    if not options.all_objects:
        return options
    return dataclasses.replace(options, out=numbered(options.out), plot=numbered(options.plot))


def _grasp_one(options: GraspOptions, observation: Observation, network: FFHNet, hand: Hand) -> None:
    """Sample, check, rank for one object; then show and write what was asked for."""
    from ffhnet.grasps_file import save_plan

    with busy("sampling, checking and ranking grasps"):
        plan = _plan(options, observation, network, hand)
    plan, warning = _judge_novelty(plan, observation, network, options.refuse_novel)
    message = _summary(plan)
    if options.max_failure is not None and len(plan.grasps):
        refusal = network.control_risk(options.max_failure).refusal(plan.grasps.score)
        if refusal is not None:
            plan, message = plan.refused("risk"), refusal
    # Files before anything is printed: a reader that closes the pipe early must not cost them.
    if options.out is not None:
        save_plan(plan, options.out)
    if options.plot is not None and len(plan.grasps) == 0 and not options.all_objects:
        raise OptionError(f"nothing to plot: {message}")
    plot = options.plot if len(plan.grasps) else None
    if plot is not None:
        with busy("drawing"):
            from ffhnet.evaluation.picture import grasp_picture

            grasp_picture(observation, plan.grasps, hand, plot, title=options.input.name)
    if len(plan.grasps):
        _show(plan.grasps, hand)
    print(message)
    if warning is not None:
        print(warning)
    if options.out is not None:
        print(f"{len(plan.grasps)} grasps written to {options.out}")
    if plot is not None:
        print(f"picture written to {plot}")


def _judge_novelty(
    plan: GraspPlan, observation: Observation, network: FFHNet, refuse: bool
) -> tuple[GraspPlan, str | None]:
    """The plan with the object's novelty, without grasps where that is refused, and a line that says so."""
    limit = None if network.calibration is None else network.calibration.novelty
    relative = network.novelty(observation)
    if limit is None or relative is None:
        if refuse:
            raise WeightsError("these weights do not know what is novel to them: run `ffhnet calibrate`")
        return plan, None
    plan, warning = dataclasses.replace(plan, novelty=relative), limit.warning(relative)
    if warning is not None and refuse:
        return plan.refused("novelty"), f"abstained: {warning}"
    return plan, warning


def _check_robot(options: GraspOptions) -> None:
    """Raises where the options of the arm do not go together, or what it needs is not installed."""
    if (options.robot is None) != (options.base is None):
        raise OptionError("--robot and --base X Y Z YAW go together")
    if options.robot is not None:
        if not options.feasibility:
            raise OptionError("--robot is a check of feasibility: not with --no-feasibility")
        require_arm("grasp --robot")


def _plan(options: GraspOptions, observation: Observation, network: FFHNet, hand: Hand) -> GraspPlan:
    """The feasible grasps, or all of them where nothing is to be checked."""
    from ffhnet.feasibility.planner import Planner, plan_unchecked

    if options.base is not None:
        from ffhnet.feasibility.arm import ArmCheck, Base

        planner = Planner(network, hand, ArmCheck(hand, Base(*options.base)))
    elif options.feasibility and observation.plane is not None:
        planner = Planner(network, hand)
    else:
        return plan_unchecked(network.grasp(observation, options.num, options.seed, options.threshold), hand)
    return planner.plan(observation, options.num, options.seed, options.threshold)


def _summary(plan: GraspPlan) -> str:
    """One line of how many grasps are feasible and why the others are not."""
    from ffhnet.feasibility.reasons import Reason

    counts = plan.counts
    untried = counts.pop(Reason.NOT_TRIED.word, 0)
    tried = len(plan.grasps) + len(plan.dropped) - untried
    if tried == 0:
        return "no grasp reaches the threshold"
    parts = [f"{len(plan.grasps)} of {tried} grasps are feasible"]
    parts += [f"dropped: {', '.join(f'{count} {reason}' for reason, count in counts.items())}"] * bool(counts)
    parts += [f"{untried} not tried with the arm"] * (untried > 0)
    return "; ".join(parts)


def _show(grasps: Grasps, hand: Hand) -> None:
    """The best grasps as a table."""
    import numpy as np

    assert grasps.probability is not None
    flexion = np.degrees(grasps.joints[:, hand.closing.moves > 0].mean(axis=1))
    rows = [
        [
            str(i + 1),
            f"{grasps.probability[i]:.3f}",
            "-" if grasps.robustness is None else f"{grasps.robustness[i]:.3f}",
            " ".join(f"{value:+.3f}" for value in grasps.position[i]),
            " ".join(f"{value:+.2f}" for value in grasps.rotation[i, :, 0]),
            f"{flexion[i]:.0f}",
        ]
        for i in range(min(_SHOWN, len(grasps)))
    ]
    print_table(
        f"{len(grasps)} grasps of {grasps.hand}, the best {len(rows)}, in the {grasps.frame} frame",
        ["rank", "probability", "robust", "palm position (m)", "approach direction", "mean flexion (°)"],
        rows,
    )
