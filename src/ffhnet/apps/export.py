"""`ffhnet export`: the networks for other runtimes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import absent, busy
from ffhnet.apps.extras import require


@dataclass(frozen=True)
class ExportOptions:
    """Write generator and evaluator as ONNX, with a description of what goes in and what comes out."""

    weights: Annotated[Path | None, tyro.conf.Positional, absent("WEIGHTS", "the package's own")] = None
    """Folder of trained weights."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("onnx")
    """Folder for the files."""


def run(options: ExportOptions) -> None:
    """Export, and say what was written."""
    require("export", "onnx", "onnx")

    from ffhnet.inference.ffhnet import find_weights
    from ffhnet.inference.onnx_export import export_onnx

    with busy("exporting"):
        files = export_onnx(find_weights(options.weights), options.out)
    for file in (files.generator, files.evaluator, files.description):
        print(f"{file} ({file.stat().st_size / 1e6:.1f} MB)")
