"""One picture of an observation and its ranked grasps: the first thing a user looks at."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw, ImageFont

from ffhnet.errors import HandError, OptionError
from ffhnet.evaluation.render import Surface, camera_around, render, square_camera
from ffhnet.evaluation.shapes import (
    PALM,
    approach_arrows,
    cloud_surface,
    color_scale,
    frame_surfaces,
    hand_surfaces,
)
from ffhnet.files import write_atomically
from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand
from ffhnet.perception.observation import Observation
from ffhnet.perception.raycast import RayScene

_BIG = 720
_GAP = 8
_SMALL = (_BIG - _GAP) // 2
_HEADER = 64
_FOOTER = 34
_PAPER = (255, 255, 255)
_INK = (28, 34, 44)
_FAINT = (96, 106, 120)

_OBSERVER = 180.0
"""Degrees: the observer stands at -x of the view frame."""

_SIDES = (-85.0, -55.0, -25.0, 25.0, 55.0, 85.0)
"""Degrees from the observer's side from which a grasp may be shown: the observed surface stays in sight."""

_ELEVATION = 24.0


@dataclass(frozen=True)
class _Cloud:
    """The observed points in the view frame, and what is drawn of them."""

    points: Float[np.ndarray, "N 3"]
    surface: Surface


@dataclass(frozen=True)
class _Panel:
    """One square of the picture: its surfaces (view frame), the points that must be seen, its caption."""

    surfaces: list[Surface]
    points: Float[np.ndarray, "N 3"]
    azimuth: float
    caption: str
    margin: float = 1.18


def distinct(grasps: Grasps, num: int, distance: float = 0.04, angle_degrees: float = 35.0) -> list[int]:
    """Indices of up to `num` grasps, best first, that are no near-duplicates of a better one.

    Args:
        grasps: ranked, best first.
        num: how many are wanted.
        distance: metres between palms from which grasps are distinct.
        angle_degrees: rotation between palms from which grasps are distinct.
    """
    chosen: list[int] = []
    for i in range(len(grasps)):
        far = np.linalg.norm(grasps.position[chosen] - grasps.position[i], axis=1) > distance
        turned = geodesic_angle(grasps.rotation[chosen], grasps.rotation[i]) > np.radians(angle_degrees)
        if np.all(far | turned):
            chosen.append(i)
        if len(chosen) == num:
            break
    return chosen


def grasp_picture(
    observation: Observation,
    grasps: Grasps,
    hand: Hand,
    path: str | Path,
    title: str = "Grasps from one view",
) -> None:
    """Write a PNG of the observed points with the best grasps, other distinct ones, and all palms.

    Args:
        observation: what the camera saw.
        grasps: ranked, best first, in the observation's frame, with probabilities; at least one.
        hand: the hand that the grasps are for.
        path: the PNG file.
        title: the picture's first line.

    Raises:
        OptionError: no grasps, no probabilities, or grasps in another frame.
        HandError: grasps of another hand.
    """
    if len(grasps) == 0 or grasps.probability is None:
        raise OptionError(f"a picture wants at least one grasp with a probability, got {len(grasps)} grasps")
    if grasps.frame != observation.frame:
        raise OptionError(f"wanted grasps in frame {observation.frame!r}, got {grasps.frame!r}")
    if grasps.hand != hand.name:
        raise HandError(f"wanted grasps of {hand.name}, got grasps of {grasps.hand}")
    points = observation.cloud_view
    cloud = _Cloud(points, cloud_surface(points))
    ranked = grasps.to_frame(invert(observation.T_input_view), "view")
    ground = observation.table_height

    shown = distinct(ranked, 3)
    best = _grasp_panel(cloud, ranked, shown[0], hand, _SIDES, "best grasp")
    others = [_grasp_panel(cloud, ranked, i, hand, _SIDES, f"rank {i + 1}") for i in shown[1:]]
    across = tuple(side for side in _SIDES if side * (best.azimuth - _OBSERVER) < 0)
    others.append(_grasp_panel(cloud, ranked, shown[0], hand, across, "best grasp, other side"))
    palms = _palms_panel(cloud, ranked)

    width = _BIG + 2 * _SMALL + 4 * _GAP
    canvas = Image.new("RGB", (width, _HEADER + _BIG + _FOOTER), _PAPER)
    draw = ImageDraw.Draw(canvas)
    _paste(canvas, best, ground, (_GAP, _HEADER), _BIG)
    corners = [
        (_BIG + (2 + i) * _GAP + i * _SMALL, _HEADER + j * (_SMALL + _GAP)) for j in (0, 1) for i in (0, 1)
    ]
    for panel, corner in zip([*others, palms], [*corners[: len(others)], corners[3]], strict=True):
        _paste(canvas, panel, ground, corner, _SMALL)
    _color_bar(draw, corners[3])
    draw.text((_GAP + 4, 32), title, fill=_INK, font=_font(26), anchor="lm")
    summary = f"{len(grasps)} grasps of {hand.name} · {len(points)} points observed"
    draw.text((width - _GAP - 4, 32), summary, fill=_FAINT, font=_font(18), anchor="rm")
    note = (
        "The hand at the grasp's joint angles, to which it closes once the palm is in place. "
        "Palm axes: x red (approach), y green, z blue. Squares: 5 cm."
    )
    draw.text((_GAP + 4, _HEADER + _BIG + _FOOTER // 2), note, fill=_FAINT, font=_font(16), anchor="lm")
    save_png(canvas, path)


def save_png(picture: Image.Image, path: str | Path) -> None:
    """Write a picture as PNG, whole or not at all; raises OptionError where that cannot be done."""
    buffer = io.BytesIO()
    picture.save(buffer, format="PNG")
    write_atomically(path, buffer.getvalue())


def _grasp_panel(
    cloud: _Cloud, grasps: Grasps, index: int, hand: Hand, sides: tuple[float, ...], name: str
) -> _Panel:
    """A grasp on the cloud, from the clearest of `sides` (degrees from the observer)."""
    T_view_palm = make_transform(grasps.rotation[index], grasps.position[index])
    parts = hand_surfaces(hand, grasps.joints[index], T_view_palm)
    axes = frame_surfaces(T_view_palm, length=0.12, radius=0.0022)
    points = np.concatenate([cloud.points, *(surface.mesh.vertices for surface in (*parts, *axes))])
    assert grasps.probability is not None
    return _Panel(
        surfaces=[cloud.surface, *parts, *axes],
        points=points,
        azimuth=clearest_azimuth(cloud.surface, parts, points, [_OBSERVER + side for side in sides]),
        caption=f"{name}   p = {grasps.probability[index]:.2f}",
    )


def clearest_azimuth(
    thing: Surface, parts: list[Surface], points: Float[np.ndarray, "N 3"], azimuths: Sequence[float]
) -> float:
    """The side from which much of a thing and much of the fingers at it is seen.

    Args:
        thing: a cloud or an object.
        parts: of the hand, as `hand_surfaces` gives them.
        points: that fill the picture.
        azimuths: to choose from, degrees as in `camera_around`.
    """
    scene = RayScene([thing.mesh, *(part.mesh for part in parts)])
    fingers = [1 + i for i, part in enumerate(parts) if part.color is not PALM]
    camera = square_camera(64)
    x, y = np.meshgrid(*camera.rays())
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)

    def seen(azimuth: float) -> int:
        T_view_camera = camera_around(points, azimuth, _ELEVATION, camera)
        hits = scene.cast(T_view_camera[None, :3, 3], directions @ T_view_camera[:3, :3].T)
        return int((1 + (hits.mesh == 0).sum()) * (1 + np.isin(hits.mesh, fingers).sum()))

    return max(azimuths, key=seen)


def _palms_panel(cloud: _Cloud, grasps: Grasps) -> _Panel:
    """All palms as arrows along their approach axes, coloured by probability."""
    assert grasps.probability is not None
    arrows = approach_arrows(grasps.rotation, grasps.position, color_scale(grasps.probability))
    return _Panel(
        surfaces=[cloud.surface, arrows],
        points=np.concatenate([cloud.points, arrows.mesh.vertices]),
        azimuth=_OBSERVER - 40.0,
        caption=f"all {len(grasps)} palms",
        margin=1.32,
    )


def _paste(canvas: Image.Image, panel: _Panel, ground: float, corner: tuple[int, int], size: int) -> None:
    """Render a panel into the canvas and write its caption."""
    camera = square_camera(size)
    T_view_camera = camera_around(panel.points, panel.azimuth, _ELEVATION, camera, panel.margin)
    canvas.paste(Image.fromarray(render(panel.surfaces, T_view_camera, camera, ground)), corner)
    draw = ImageDraw.Draw(canvas)
    large = size == _BIG
    at = (corner[0] + (16 if large else 10), corner[1] + (14 if large else 8))
    draw.text(at, panel.caption, fill=_INK, font=_font(26 if large else 17))


def _color_bar(draw: ImageDraw.ImageDraw, corner: tuple[int, int]) -> None:
    """The scale of the palms panel: success probability 0 to 1."""
    width, height = 130, 10
    left, top = corner[0] + _SMALL - width - 14, corner[1] + _SMALL - 40
    for column, color in enumerate(np.round(255 * color_scale(np.linspace(0, 1, width))).astype(int)):
        draw.line([(left + column, top), (left + column, top + height)], fill=tuple(color.tolist()))
    draw.text((left, top + height + 4), "0", fill=_INK, font=_font(14))
    draw.text((left + width, top + height + 4), "1", fill=_INK, font=_font(14), anchor="ra")
    draw.text((left + width / 2, top + height + 4), "probability", fill=_INK, font=_font(14), anchor="ma")


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)
