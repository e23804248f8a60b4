"""The viewer's panel: its widgets, and what an upload is taken for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import viser

from ffhnet.apps.capture_options import CaptureOptions
from ffhnet.apps.viewer.texts import legend
from ffhnet.errors import OptionError
from ffhnet.perception.camera import REALSENSE_D415

NO_EXAMPLE = "-"
NO_GRASP = "none"
MOST_HANDS = 60

_DEPTH = "depth image"
_AS_STARTED = "as the command line says"
_CLOUDS = {
    "whole scene, camera frame": CaptureOptions(),
    "cut-out object, z up": CaptureOptions(world=True),
    "cut-out object, -y up": CaptureOptions(up=(0.0, -1.0, 0.0)),
}


@dataclass(frozen=True)
class Panel:
    """The widgets that the viewer listens to and writes to, from top to bottom."""

    example: viser.GuiDropdownHandle[str]
    upload: viser.GuiUploadButtonHandle
    shows: viser.GuiDropdownHandle[str]
    intrinsics: viser.GuiTextHandle
    status: viser.GuiHtmlHandle
    threshold: viser.GuiSliderHandle[float]
    count: viser.GuiSliderHandle[int]
    distinct: viser.GuiCheckboxHandle
    shown: viser.GuiHtmlHandle
    grasp: viser.GuiDropdownHandle[str]
    numbers: viser.GuiHtmlHandle
    close: viser.GuiButtonHandle
    trial: viser.GuiButtonHandle
    outcome: viser.GuiHtmlHandle


def build_panel(gui: viser.GuiApi, examples: list[str], capture: CaptureOptions, threshold: float) -> Panel:
    """Lays out the panel.

    Args:
        gui: where.
        examples: names to choose from.
        capture: options of the command line; uploads start from them.
        threshold: where its slider stands at first.
    """
    gui.configure_theme(show_logo=False, show_share_button=False)
    gui.main_panel.dock_right()
    gui.set_panel_label("ffhnet")
    d415 = REALSENSE_D415
    camera = capture.intrinsics or (d415.fx, d415.fy, d415.cx, d415.cy)
    cut_out = capture.up is not None or capture.world
    with gui.add_folder("Capture"):
        example = gui.add_dropdown("example", [NO_EXAMPLE, *examples])
        upload = gui.add_upload_button("Open a file", hint=".ply .pcd .npy .npz, or a depth image .png")
        shows = gui.add_dropdown(
            "files show",
            [*([_AS_STARTED] if cut_out else []), *_CLOUDS, _DEPTH],
            hint="for the next file; a .png is always a depth image",
        )
        intrinsics = gui.add_text(
            "depth camera", " ".join(f"{value:g}" for value in camera), hint="fx fy cx cy, pixels"
        )
        status = gui.add_html("")
    with gui.add_folder("Grasps"):
        threshold_slider = gui.add_slider("threshold", 0.0, 1.0, 0.01, threshold)
        count = gui.add_slider("at most", 1, MOST_HANDS, 1, 5)
        distinct = gui.add_checkbox("no near-duplicates", True)
        shown = gui.add_html("")
        gui.add_html(legend())
    with gui.add_folder("One grasp"):
        grasp = gui.add_dropdown("grasp", [NO_GRASP], hint="or click a hand")
        numbers = gui.add_html("")
        close = gui.add_button("Close the hand", disabled=True)
        trial = gui.add_button("Try it in physics", disabled=True)
        outcome = gui.add_html("")
    return Panel(
        example=example,
        upload=upload,
        shows=shows,
        intrinsics=intrinsics,
        status=status,
        threshold=threshold_slider,
        count=count,
        distinct=distinct,
        shown=shown,
        grasp=grasp,
        numbers=numbers,
        close=close,
        trial=trial,
        outcome=outcome,
    )


def upload_options(panel: Panel, name: str, capture: CaptureOptions) -> CaptureOptions:
    """What an uploaded file shows.

    Args:
        panel: where the user says so.
        name: of the file.
        capture: options of the command line.

    Raises:
        OptionError: a depth image, and the panel's camera is not four numbers.
    """
    if Path(name).suffix.lower() == ".png" or panel.shows.value == _DEPTH:
        return CaptureOptions(intrinsics=_numbers(panel.intrinsics.value), depth_scale=capture.depth_scale)
    return capture if panel.shows.value == _AS_STARTED else _CLOUDS[panel.shows.value]


def _numbers(text: str) -> tuple[float, float, float, float]:
    try:
        fx, fy, cx, cy = (float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise OptionError(
            f"the depth camera wants four numbers, fx fy cx cy in pixels, got '{text}'"
        ) from None
    return fx, fy, cx, cy
