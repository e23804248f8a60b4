"""The texts and the legend in the viewer's panel, as HTML."""

from __future__ import annotations

import html

import numpy as np

from ffhnet.evaluation.shapes import color_scale
from ffhnet.grasps import Grasps

_STOPS = 9


def note(text: str, error: bool = False) -> str:
    """A paragraph of text, in red where it says what went wrong."""
    color = "#c92a2a" if error else "#495057"
    return (
        f'<div style="padding:2px 12px 8px;font-size:13px;line-height:1.4;color:{color};'
        f'overflow-wrap:anywhere">{html.escape(text)}</div>'
    )


def legend() -> str:
    """The colour scale with its ends named."""
    stops = ",".join(_css(share) for share in np.linspace(0, 1, _STOPS))
    return (
        '<div style="padding:0 12px 10px;font-size:12px;color:#495057">'
        f'<div style="height:12px;border-radius:6px;background:linear-gradient(90deg,{stops})"></div>'
        '<div style="display:flex;justify-content:space-between;padding-top:2px">'
        "<span>0</span><span>probability that it holds</span><span>1</span></div></div>"
    )


def grasp_label(grasps: Grasps, index: int) -> str:
    """A grasp by its rank and probability."""
    assert grasps.probability is not None
    return f"rank {index + 1}, {grasps.probability[index]:.3f}"


def grasp_numbers(grasp: Grasps) -> str:
    """All numbers of a batch of one grasp, as a table."""
    assert grasp.probability is not None
    rows = [("probability", f"{grasp.probability[0]:.3f}")]
    if grasp.robustness is not None:
        rows.append(("robust", f"{grasp.robustness[0]:.3f}"))
    rows += [
        (f"palm, {grasp.frame} frame (m)", _row(grasp.position[0], 3)),
        ("approach direction", _row(grasp.rotation[0][:, 0], 2)),
    ]
    degrees = np.degrees(grasp.joints[0])
    fingers: dict[str, list[float]] = {}
    for name, angle in zip(grasp.joint_names, degrees, strict=True):
        fingers.setdefault(name.partition("_")[0], []).append(float(angle))
    rows += [(f"{finger} (°)", _row(np.array(angles), 0)) for finger, angles in fingers.items()]
    cells = "".join(
        f'<tr><td style="padding:1px 8px 1px 0;color:#868e96">{html.escape(name)}</td>'
        f'<td style="text-align:right;font-variant-numeric:tabular-nums">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="margin:0 12px 8px;width:calc(100% - 24px);font-size:12.5px">{cells}</table>'


def _row(values: np.ndarray, digits: int) -> str:
    return "  ".join(f"{value:+.{digits}f}" for value in values)


def _css(share: float) -> str:
    red, green, blue = np.rint(255 * color_scale(np.array([share]))[0]).astype(int)
    return f"rgb({red},{green},{blue})"
