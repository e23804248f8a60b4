"""The paper's figures 5, 6 and 7 from our own evaluation: contact sheets of grasps on objects and clouds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from PIL import Image, ImageDraw, ImageFont

from ffhnet.evaluation.outcomes import Samples, ViewOutcome
from ffhnet.evaluation.picture import clearest_azimuth
from ffhnet.evaluation.render import Surface, camera_around, render, square_camera
from ffhnet.evaluation.shapes import approach_arrows, cloud_surface, color_scale, hand_surfaces
from ffhnet.geometry.transforms import make_transform
from ffhnet.hands import Hand, load_hand
from ffhnet.objects.grasp_object import GraspObject

LIKELY = 0.75
"""Predicted probability from which figure 5 shows a grasp as filtered."""

FIGURE5_OBJECTS, FIGURE6_OBJECTS, FIGURE7_OBJECTS = 3, 8, 4
"""Objects in the paper's figures."""

CAPTIONS = {
    "5": (
        "All palms that the generator proposed, coloured by predicted probability (dark low, yellow high); "
        "those rated 0.75 or more; and those that held in physics. Left and middle: the points the camera "
        "saw."
    ),
    "6": (
        "The best-ranked top grasp and, below it, side grasp that held, on each object. The hand is drawn at "
        "the grasp's joint angles, from which the fingers close on until contact."
    ),
    "7": (
        "The side grasp (first row) and top grasp (second row) with the highest predicted probability, on "
        "the points the camera saw, and what became of them. The paper shows camera data of real objects "
        "here; these are simulated views."
    ),
}
"""What the figures show, by the paper's number."""

_TOP, _SIDE = -0.8, 0.45
"""A palm whose approach axis points down more steeply than the first is a top grasp (cosine); one whose
axis is more level than the second is a side grasp."""

_OBJECT = np.array([0.93, 0.60, 0.24])
_HELD = np.array([0.18, 0.55, 0.34])
_INK = (28, 34, 44)
_GAP = 6
_COLUMNS = 4
_CAPTION = 26
_ELEVATION = 22.0
_AZIMUTHS = [float(azimuth) for azimuth in range(0, 360, 30)]


@dataclass(frozen=True)
class _Panel:
    """A square of a sheet: surfaces in the world frame, and the side from which they are seen (degrees)."""

    surfaces: list[Surface]
    azimuth: float
    caption: str


def choose_views(views: Sequence[ViewOutcome], count: int) -> list[ViewOutcome]:
    """The first full view of up to `count` objects, in the order of the evaluation."""
    first: dict[str, ViewOutcome] = {}
    for view in views:
        if view.view is not None:
            first.setdefault(view.object_name, view)
    return list(first.values())[:count]


def draw_figures(
    views: Sequence[ViewOutcome],
    objects: Mapping[str, Callable[[], GraspObject]],
    hand: str | None = None,
) -> dict[str, Image.Image]:
    """All figures by the paper's number; none without a full view.

    Args:
        views: of the evaluation, all of the same hand.
        objects: builds each object by its name.
        hand: name or TOML file of the hand, or None for the one by the name in the grasps.
    """
    loaded = load_hand(hand or views[0].samples.grasps.hand)
    drawn = {"5": figure5(views, objects), "6": figure6(views, objects, loaded), "7": figure7(views, loaded)}
    return {number: image for number, image in drawn.items() if image is not None}


def figure5(
    views: Sequence[ViewOutcome], objects: Mapping[str, Callable[[], GraspObject]], size: int = 300
) -> Image.Image | None:
    """Palms of all samples, of those rated likely, and of those that held, a row per object.

    The paper's third column is the data's distribution; ours is what physics says of the same samples.

    Args:
        views: of the evaluation; None is returned where none of them is full.
        objects: builds each object by its name.
        size: side of a panel, pixels.
    """
    rows = []
    for view in choose_views(views, FIGURE5_OBJECTS):
        assert view.view is not None
        samples, azimuth = view.samples, _observer(view)
        likely, held = samples.probability >= LIKELY, samples.tries.success
        cloud = cloud_surface(view.view.cloud_and_normals_world[0])
        rows.append(
            [
                _Panel([cloud, *_palms(samples)], azimuth, f"{view.object_name}: all {len(samples)}"),
                _Panel(
                    [cloud, *_palms(samples, likely)], azimuth, f"{likely.sum()} rated {LIKELY:g} or more"
                ),
                _Panel(
                    [_body(objects[view.object_name](), view), *_palms(samples, held, _HELD)],
                    azimuth,
                    f"{held.sum()} that held",
                ),
            ]
        )
    return _sheet(rows, size)


def figure6(
    views: Sequence[ViewOutcome],
    objects: Mapping[str, Callable[[], GraspObject]],
    hand: Hand,
    size: int = 270,
) -> Image.Image | None:
    """The best-ranked top grasp and, below it, side grasp that held, of each object.

    Args:
        views: of the evaluation; None is returned where none of them is full.
        objects: builds each object by its name.
        hand: whose grasps they are.
        size: side of a panel, pixels.
    """
    columns = []
    for view in choose_views(views, FIGURE6_OBJECTS):
        body, held = _body(objects[view.object_name](), view), view.samples.tries.success
        top, side = (_first(kind & held) for kind in _top_and_side(view.samples))
        columns.append(
            [
                _grasp(view.samples, top, hand, body, f"{view.object_name}, top"),
                _grasp(view.samples, side, hand, body, f"{view.object_name}, side"),
            ]
        )
    lines = [columns[i : i + _COLUMNS] for i in range(0, len(columns), _COLUMNS)]
    return _sheet([row for line in lines for row in zip(*line, strict=True)], size)


def figure7(views: Sequence[ViewOutcome], hand: Hand, size: int = 270) -> Image.Image | None:
    """The side grasp (first row) and top grasp (second row) rated highest, on what the camera saw.

    Args:
        views: of the evaluation; None is returned where none of them is full.
        hand: whose grasps they are.
        size: side of a panel, pixels.
    """
    columns = []
    for view in choose_views(views, FIGURE7_OBJECTS):
        assert view.view is not None
        cloud = cloud_surface(view.view.cloud_and_normals_world[0])
        top, side = (_most_probable(view.samples, kind) for kind in _top_and_side(view.samples))
        columns.append([_rated(view.samples, i, hand, cloud, view.object_name) for i in (side, top)])
    return _sheet([*zip(*columns, strict=True)], size)


def _observer(view: ViewOutcome) -> float:
    """Azimuth of the camera that took the view, degrees, a little to its side."""
    assert view.view is not None
    x, y = view.view.T_world_camera[:2, 3]
    return float(np.degrees(np.arctan2(y, x))) + 25.0


def _body(obj: GraspObject, view: ViewOutcome) -> Surface:
    mesh = obj.visual.copy().apply_transform(view.T_world_object)
    return Surface(mesh.smooth_shaded, _OBJECT)


def _palms(
    samples: Samples, chosen: Bool[np.ndarray, " N"] | None = None, color: np.ndarray | None = None
) -> list[Surface]:
    """Arrows along the approach axes, in one colour or by predicted probability; no surface for none."""
    keep = np.flatnonzero(np.ones(len(samples), bool) if chosen is None else chosen)
    if len(keep) == 0:
        return []
    grasps = samples.grasps[keep]
    colors = color_scale(samples.probability[keep]) if color is None else np.tile(color, (len(keep), 1))
    return [approach_arrows(grasps.rotation, grasps.position, colors)]


def _top_and_side(samples: Samples) -> tuple[Bool[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    down = samples.grasps.rotation[:, 2, 0]
    return down < _TOP, np.abs(down) < _SIDE


def _first(chosen: Bool[np.ndarray, " N"]) -> int | None:
    """Index of the best-ranked of the chosen."""
    found = np.flatnonzero(chosen)
    return int(found[0]) if len(found) else None


def _most_probable(samples: Samples, chosen: Bool[np.ndarray, " N"]) -> int | None:
    found = np.flatnonzero(chosen)
    return int(found[samples.probability[found].argmax()]) if len(found) else None


def _rated(samples: Samples, index: int | None, hand: Hand, cloud: Surface, name: str) -> _Panel:
    if index is None:
        return _Panel([cloud], 0.0, f"{name}: none")
    fate = "held" if samples.tries.success[index] else "failed"
    return _grasp(samples, index, hand, cloud, f"{name}, p = {samples.probability[index]:.2f}, {fate}")


def _grasp(samples: Samples, index: int | None, hand: Hand, thing: Surface, caption: str) -> _Panel:
    """A hand on a thing, seen from the clearest side; only the thing where there is no grasp."""
    if index is None:
        return _Panel([thing], 0.0, f"{caption}: none")
    grasps = samples.grasps
    T_world_palm = make_transform(grasps.rotation[index], grasps.position[index])
    parts = hand_surfaces(hand, grasps.joints[index], T_world_palm)
    points = np.concatenate([surface.mesh.vertices for surface in (thing, *parts)])
    return _Panel([thing, *parts], clearest_azimuth(thing, parts, points, _AZIMUTHS), caption)


def _sheet(rows: Sequence[Sequence[_Panel]], size: int) -> Image.Image | None:
    """Panels in rows with their captions above; None without panels."""
    if not rows or not rows[0]:
        return None
    high = size + _CAPTION + _GAP
    columns = max(len(row) for row in rows)
    sheet = Image.new("RGB", (columns * (size + _GAP) - _GAP, len(rows) * high - _GAP), (255, 255, 255))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=15)
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            corner = (j * (size + _GAP), i * high)
            draw.text((corner[0] + 2, corner[1] + 5), panel.caption, fill=_INK, font=font)
            sheet.paste(Image.fromarray(_draw(panel, size)), (corner[0], corner[1] + _CAPTION))
    return sheet


def _draw(panel: _Panel, size: int) -> np.ndarray:
    camera = square_camera(size)
    points: Float[np.ndarray, "N 3"] = np.concatenate([s.mesh.vertices for s in panel.surfaces])
    T_world_camera = camera_around(points, panel.azimuth, _ELEVATION, camera, margin=1.12)
    return render(panel.surfaces, T_world_camera, camera, ground=0.0)
