"""`ffhnet grasp`: a capture in, ranked grasps out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ffhnet.apps.capture_options import (
    INPUT_HELP,
    CaptureOptions,
    File,
    NetworkOptions,
    check_capture,
    load_network,
    observe_capture,
)
from ffhnet.apps.console import absent, busy, print_table
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    from ffhnet.grasps import Grasps
    from ffhnet.hands import Hand

_SHOWN = 10


@dataclass(frozen=True, kw_only=True)
class GraspOptions(NetworkOptions, CaptureOptions):
    """Grasps for one object, ranked by the probability that they hold."""

    input: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(help=INPUT_HELP)]
    max_failure: Annotated[float | None, absent("P")] = None
    """Abstain where the best grasp cannot be promised to fail at most this often, with 95 % confidence."""
    out: File = None
    """Write all grasps to this .json or .npz, best first, in the frame of the input."""
    plot: File = None
    """Write a picture to this .png."""


def run(options: GraspOptions) -> None:
    """Observe, sample, rank; then show and write what was asked for."""
    import numpy as np

    from ffhnet.files import check_output
    from ffhnet.grasps_file import SUFFIXES, save_grasps

    check_capture(options.input, options)
    if options.out is not None:
        check_output(options.out, SUFFIXES)
    if options.plot is not None:
        check_output(options.plot, (".png",))
    with busy("loading"):
        observation = observe_capture(options.input, options, np.random.default_rng(options.seed))
        network, hand = load_network(options)
    with busy("sampling and ranking grasps"):
        grasps = network.grasp(observation, options.num, options.seed, options.threshold)
    refusal = None
    if options.max_failure is not None:
        refusal = network.control_risk(options.max_failure).refusal(grasps.score)
        grasps = grasps if refusal is None else grasps[:0]
    # Files before anything is printed: a reader that closes the pipe early must not cost them.
    if options.out is not None:
        save_grasps(grasps, options.out)
    if options.plot is not None:
        if len(grasps) == 0:
            raise OptionError(
                f"nothing to plot: {refusal or f'no grasp reaches the threshold {options.threshold:g}'}"
            )
        with busy("drawing"):
            from ffhnet.evaluation.picture import grasp_picture

            grasp_picture(observation, grasps, hand, options.plot, title=options.input.name)
    if refusal is None:
        _show(grasps, hand)
    else:
        print(refusal)
    if options.out is not None:
        print(f"{len(grasps)} grasps written to {options.out}")
    if options.plot is not None:
        print(f"picture written to {options.plot}")


def _show(grasps: Grasps, hand: Hand) -> None:
    """The best grasps as a table."""
    import numpy as np

    if len(grasps) == 0 or grasps.probability is None:
        print("no grasp reaches the threshold")
        return
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
