"""`ffhnet view`: grasps in the browser."""

from __future__ import annotations

import socket
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.capture_options import (
    INPUT_HELP,
    CaptureOptions,
    NetworkOptions,
    check_capture,
    load_network,
)
from ffhnet.apps.console import busy
from ffhnet.apps.extras import require
from ffhnet.errors import OptionError


@dataclass(frozen=True, kw_only=True)
class ViewOptions(NetworkOptions, CaptureOptions):
    """Look at grasps in the browser: choose, sort out, see them close, try them in physics."""

    input: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="INPUT", help=INPUT_HELP, help_behavior_hint="(default: an example)"),
    ] = None
    host: str = "127.0.0.1"
    """Address to serve; the default is reached from this machine only."""
    port: int = 8080
    """Port to serve."""


def run(options: ViewOptions) -> None:
    """Serve until Ctrl-C."""
    require("view", "viewer", "viser")
    if options.input is not None:
        check_capture(options.input, options)
    _check_address(options.host, options.port)
    with busy("loading"):
        import viser

        from ffhnet.apps.viewer.sight import Looker, example_names
        from ffhnet.apps.viewer.viewer import Viewer

        network, hand = load_network(options)
        looker = Looker(network, hand, options)
        sight = (
            looker.example(example_names()[-1])
            if options.input is None
            else looker.file(options.input, options)
        )
        server = viser.ViserServer(options.host, options.port, label="ffhnet", verbose=False)
        Viewer(server, hand, looker, options, options.threshold).show(sight)
    print(f"viewer at http://{options.host}:{server.get_port()} (Ctrl-C ends it)", flush=True)
    threading.Event().wait()


def _check_address(host: str, port: int) -> None:
    """Raises OptionError where the address cannot be served."""
    try:
        with socket.create_server((host, port)):
            pass
    except (OSError, OverflowError) as error:
        raise OptionError(f"cannot serve {host}:{port}: {error}; choose another --host or --port") from None
