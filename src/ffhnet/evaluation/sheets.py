"""Contact sheets: a hand from several sides with its palm frame, and objects side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ffhnet.errors import OptionError
from ffhnet.evaluation.picture import save_png
from ffhnet.evaluation.render import Surface, camera_around, pixels_of, render, square_camera
from ffhnet.evaluation.shapes import frame_surfaces, hand_surfaces
from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject

MAX_OBJECTS = 60

_INK = (28, 34, 44)
_OBJECT = np.array([0.93, 0.60, 0.24])
_AXIS_LENGTH = 0.19
_FORESHORTENED = 0.9  # cosine between an axis and the line of sight from which its label says nothing


def hand_picture(hand: Hand, path: str | Path, size: int = 420) -> None:
    """Write a PNG of the hand at its eigengrasp origin with the palm axes, from front, side and top.

    The hand stands as its root frame does: root z up. Front is the side of root +x.

    Args:
        hand: the hand.
        path: the PNG file.
        size: side of each of the three panels, pixels.
    """
    surfaces = hand_surfaces(hand, hand.eigengrasp_origin, hand.T_root_palm)
    axes = frame_surfaces(hand.T_root_palm, _AXIS_LENGTH, radius=0.0025)
    points = np.concatenate([surface.mesh.vertices for surface in (*surfaces, *axes)])
    ends = hand.T_root_palm[:3, 3] + (_AXIS_LENGTH + 0.012) * hand.T_root_palm[:3, :3].T
    sheet = Image.new("RGB", (3 * size, size))
    draw = ImageDraw.Draw(sheet)
    camera = square_camera(size)
    views = (("from root +x", 0.0, 8.0), ("from root +x +y", 55.0, 25.0), ("from root +y", 90.0, 8.0))
    for column, (name, azimuth, elevation) in enumerate(views):
        T_root_camera = camera_around(points, azimuth, elevation, camera, margin=1.2)
        sheet.paste(Image.fromarray(render([*surfaces, *axes], T_root_camera, camera)), (column * size, 0))
        foreshortened = np.abs(hand.T_root_palm[:3, :3].T @ T_root_camera[:3, 2]) > _FORESHORTENED
        for letter, (x, y), short in zip(
            "xyz", pixels_of(ends, T_root_camera, camera), foreshortened, strict=True
        ):
            if not short:
                draw.text((column * size + x, y), letter, fill=_INK, font=_font(20), anchor="mm")
        draw.text((column * size + 10, size - 28), f"{hand.name}, {name}", fill=_INK, font=_font(16))
    save_png(sheet, path)


def objects_picture(objects: Sequence[GraspObject], path: str | Path, size: int = 260) -> None:
    """Write a PNG of objects in their most natural resting pose, all at the same scale.

    Args:
        objects: at least one, at most `MAX_OBJECTS`.
        path: the PNG file.
        size: side of each object's panel, pixels.

    Raises:
        OptionError: no objects or too many.
    """
    if not 0 < len(objects) <= MAX_OBJECTS:
        raise OptionError(f"a picture shows 1 to {MAX_OBJECTS} objects, got {len(objects)}")
    columns = min(len(objects), math.ceil(math.sqrt(1.6 * len(objects))))
    rows = math.ceil(len(objects) / columns)
    meshes = [obj.visual.copy().apply_transform(obj.resting_poses[0]) for obj in objects]
    reach = max(float(np.abs(mesh.bounds[:, :2]).max()) for mesh in meshes)
    top = max(float(mesh.bounds[1, 2]) for mesh in meshes)
    box = np.array([[x, y, z] for x in (-reach, reach) for y in (-reach, reach) for z in (0.0, top)])
    camera = square_camera(size)
    T_world_camera = camera_around(box, -60.0, 28.0, camera, margin=1.05)
    sheet = Image.new("RGB", (columns * size, rows * size), (255, 255, 255))
    draw = ImageDraw.Draw(sheet)
    for i, (obj, mesh) in enumerate(zip(objects, meshes, strict=True)):
        corner = (i % columns * size, i // columns * size)
        surface = Surface(mesh.smooth_shaded, _OBJECT)
        sheet.paste(Image.fromarray(render([surface], T_world_camera, camera, ground=0.0)), corner)
        draw.text((corner[0] + 8, corner[1] + 6), obj.name, fill=_INK, font=_font(14))
    save_png(sheet, path)


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)
