"""Makes docs/images/moving.gif: the hand stays with the moving object of the fourth example.

Run it from the repository root: python docs/make_moving_picture.py
"""

import runpy
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from ffhnet.evaluation.render import Surface, render, square_camera
from ffhnet.evaluation.shapes import hand_surfaces
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import GraspTracker
from ffhnet.perception.camera import REALSENSE_D415, look_at
from ffhnet.perception.observation import observe_depth

ROOT = Path(__file__).parents[1]
FRAMES = 36


def draw(mesh: trimesh.Trimesh, grasp: Grasps) -> Image.Image:
    """The object and the hand, in the world."""
    T_world_palm = make_transform(grasp.rotation[0], grasp.position[0])
    surfaces = [Surface(mesh, np.array([0.95, 0.6, 0.2]))]
    surfaces += hand_surfaces(load_hand(), grasp.joints[0], T_world_palm)
    camera = square_camera(300, field_of_view_degrees=24)
    view = look_at([-0.2, -0.95, 0.55], [0.0, 0.0, 0.12])
    return Image.fromarray(render(surfaces, view, camera, ground=0.0))


def main() -> None:
    """Track, draw, and play it back and forth."""
    example = runpy.run_path(str(ROOT / "examples" / "04_camera_loop.py"))
    tracker = GraspTracker(FFHNet.from_pretrained(), num=100)
    rng = np.random.default_rng(1)
    pictures = []
    for number, (mesh, depth) in enumerate(example["camera"](FRAMES)):
        grasps = tracker.update(observe_depth(depth, REALSENSE_D415, rng), seed=number)
        pictures.append(draw(mesh, grasps[0].to_frame(example["T_WORLD_CAMERA"], "world")).quantize(64))
    back_and_forth = [*pictures, *pictures[-2:0:-1]]
    back_and_forth[0].save(
        ROOT / "docs" / "images" / "moving.gif",
        save_all=True,
        append_images=back_and_forth[1:],
        duration=60,
        loop=0,
    )


if __name__ == "__main__":
    main()
