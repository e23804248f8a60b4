"""The command `ffhnet`: which subcommands there are, and how errors reach the terminal.

A subcommand is a frozen dataclass of options and a function that runs it, both in a file of their own.
Those files import what they need inside the function, so that `ffhnet --help` loads neither torch nor MuJoCo.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Union, cast

import tyro

from ffhnet.apps import (
    benchmark,
    calibrate,
    data,
    distil,
    evaluate,
    export,
    generate,
    grasp,
    hand,
    objects,
    refine,
    train,
    view,
)
from ffhnet.apps.ros2 import command as ros2
from ffhnet.errors import FFHNetError


@dataclass(frozen=True)
class Command:
    """A subcommand: its name, its options (whose docstring is the help text), and what it does."""

    name: str
    options: type
    run: Callable[[Any], None]


COMMANDS = (
    Command("grasp", grasp.GraspOptions, grasp.run),
    Command("view", view.ViewOptions, view.run),
    Command("objects", objects.ObjectsOptions, objects.run),
    Command("hand", hand.HandOptions, hand.run),
    Command("generate", generate.GenerateOptions, generate.run),
    Command("data", data.DataOptions, data.run),
    Command("train", train.TrainOptions, train.run),
    Command("refine", refine.RefineOptions, refine.run),
    Command("distil", distil.DistilOptions, distil.run),
    Command("calibrate", calibrate.CalibrateOptions, calibrate.run),
    Command("evaluate", evaluate.EvaluateOptions, evaluate.run),
    Command("benchmark", benchmark.BenchmarkOptions, benchmark.run),
    Command("export", export.ExportOptions, export.run),
    Command("ros", ros2.RosOptions, ros2.run),
)

ERROR_STATUS = 2
INTERRUPTED_STATUS = 130


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: run one subcommand and leave with its exit status.

    0 = done, 2 = an error that the user can mend (one line on standard error), 130 = Ctrl-C.
    """
    try:
        options = _parse(sys.argv[1:] if arguments is None else arguments)
        next(command for command in COMMANDS if isinstance(options, command.options)).run(options)
        sys.stdout.flush()
    except FFHNetError as error:
        _fail(str(error))
    except BrokenPipeError:
        # The reader of our output (`| head`) has gone: nothing is wrong, and nothing is left to flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED_STATUS)


def _parse(arguments: Sequence[str]) -> Any:
    """The options of the subcommand that was named; leaves with status 2 where they cannot be parsed."""
    subcommands = tuple(
        Annotated[
            c.options, tyro.conf.subcommand(c.name, description=(c.options.__doc__ or "").split("\n")[0])
        ]
        for c in COMMANDS
    )
    if arguments[:1] == ["ros"]:
        # What follows is for ROS, which reads the command line itself.
        arguments = list(itertools.takewhile(lambda argument: argument != "--ros-args", arguments))
    messages = io.StringIO()
    try:
        with contextlib.redirect_stderr(messages):
            return tyro.cli(
                cast(Any, Union[subcommands]),  # noqa: UP007 (built at run time)
                prog="ffhnet",
                description="Five-finger grasps for unknown objects from one depth view.",
                args=arguments,
                config=(
                    tyro.conf.OmitArgPrefixes,
                    tyro.conf.OmitSubcommandPrefixes,
                    tyro.conf.PositionalMetavarFromFieldName,
                    tyro.conf.FlagCreatePairsOff,
                    tyro.conf.DisallowNone,
                ),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        _fail(_plain(messages.getvalue()))


def _fail(message: str) -> None:
    print(f"ffhnet: error: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(ERROR_STATUS)


def _plain(boxed: str) -> str:
    """The text of tyro's framed and coloured message, without its title."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", boxed)
    return re.sub(r"╭.*╮|[│╰╯─]", " ", text)
