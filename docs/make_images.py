"""Renders the pictures of docs/images. Run it from the repository root: python docs/make_images.py."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ffhnet.evaluation.picture import save_png
from ffhnet.evaluation.render import Surface, camera_around, pixels_of, render, square_camera
from ffhnet.evaluation.shapes import cloud_surface, frame_surfaces, hand_surfaces
from ffhnet.evaluation.sheets import hand_picture
from ffhnet.geometry.transforms import invert
from ffhnet.hands import Hand, load_hand
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.capture import read_depth
from ffhnet.perception.observation import observe_depth

IMAGES = Path(__file__).parent / "images"
EXAMPLE = Path(__file__).parents[1] / "examples" / "data" / "spray_flask_2000005_depth.png"
INK = (28, 34, 44)


def label(draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, size: int = 20) -> None:
    """Text centred at a pixel."""
    draw.text(at, text, fill=INK, font=ImageFont.load_default(size=size), anchor="mm")


def view_frame_picture(path: Path) -> None:
    """The camera's and the view frame of the example, on the observed points."""
    observation = observe_depth(read_depth(EXAMPLE), REALSENSE_D415, np.random.default_rng(0))
    surfaces: list[Surface] = [cloud_surface(observation.cloud_view)]
    ends, letters = [], []
    frames = {"view": (np.eye(4), 0.2), "camera": (invert(observation.T_input_view), 0.15)}
    for T_view_frame, length in frames.values():
        surfaces += frame_surfaces(T_view_frame, length, radius=0.0035)
        ends += list(T_view_frame[:3, 3] + (length + 0.02) * T_view_frame[:3, :3].T)
        letters += list("xyz")
    points = np.concatenate([*(surface.mesh.vertices for surface in surfaces), ends])
    camera = square_camera(560)
    T_view_camera = camera_around(points, -105.0, 16.0, camera, margin=1.15)
    picture = Image.fromarray(render(surfaces, T_view_camera, camera, ground=observation.table_height))
    draw = ImageDraw.Draw(picture)
    for letter, at in zip(letters, pixels_of(np.array(ends), T_view_camera, camera), strict=True):
        label(draw, tuple(at), letter)
    origins = np.array([T[:3, 3] for T, _ in frames.values()])
    for name, (x, y) in zip(frames, pixels_of(origins, T_view_camera, camera), strict=True):
        # Beside the object, and above the camera.
        label(draw, (x + 95, y + 24) if name == "view" else (x + 20, y - 24), f"{name} frame", size=22)
    save_png(picture, path)


def joint_signs_picture(hand: Hand, path: Path) -> None:
    """Straight fingers, spread fingers and bent fingers, seen from the palm's side."""
    straight = np.zeros(hand.num_joints)
    spread, bent = straight.copy(), straight.copy()
    for finger, angle in {"index": -0.26, "middle": -0.08, "ring": 0.08, "little": 0.26}.items():
        spread[hand.joint_names.index(f"{finger}_abduction")] = angle
    bent[hand.closing.moves > 0] = 0.6
    size = 420
    camera = square_camera(size)
    sheet = Image.new("RGB", (3 * size, size))
    poses = {"all joints 0": straight, "index abduction -, little abduction +": spread, "mcp and pip +": bent}
    for column, (name, joints) in enumerate(poses.items()):
        surfaces = hand_surfaces(hand, joints, hand.T_root_palm)
        points = np.concatenate([surface.mesh.vertices for surface in surfaces])
        T_root_camera = camera_around(points, 20.0, 15.0, camera, margin=1.25)
        sheet.paste(Image.fromarray(render(surfaces, T_root_camera, camera)), (column * size, 0))
        label(ImageDraw.Draw(sheet), (column * size + size / 2, size - 18), name, size=17)
    save_png(sheet, path)


def main() -> None:
    """All pictures."""
    hand = load_hand()
    hand_picture(hand, IMAGES / "palm_frame.png")
    joint_signs_picture(hand, IMAGES / "joint_signs.png")
    view_frame_picture(IMAGES / "view_frame.png")


if __name__ == "__main__":
    main()
