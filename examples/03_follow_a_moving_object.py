"""One grasp that stays with an object while it is pushed and turned.

python examples/03_follow_a_moving_object.py               prints the chosen grasp
python examples/03_follow_a_moving_object.py moving.gif    draws it as well
"""

import sys
from collections.abc import Iterator

import numpy as np
import trimesh
from PIL import Image

from ffhnet.evaluation.render import Surface, render, square_camera
from ffhnet.evaluation.shapes import hand_surfaces
from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import GraspTracker
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.observation import observe_depth
from ffhnet.perception.sensor_noise import StereoNoise

FRAMES = 6
DRAWN_FRAMES = 36
T_WORLD_CAMERA = look_at([-0.55, 0.0, 0.45], [0.0, 0.0, 0.05])


def track(frames: int) -> Iterator[tuple[trimesh.Trimesh, Grasps]]:
    """The object in every frame and the grasp to go for, in the world frame."""
    tracker = GraspTracker(FFHNet.from_pretrained(), num=100)
    obj = resolve_objects("spray_flask_2000005")[0].load()
    rng = np.random.default_rng(0)
    for number, along in enumerate(np.linspace(-1, 1, frames)):
        T_world_object = make_transform(about_z(0.9 * along), np.array([0.05 * along**2, 0.12 * along, 0.0]))
        mesh = obj.visual.copy().apply_transform(T_world_object @ obj.resting_poses[0])
        # On a robot the depth image comes from the camera.
        depth = render_depth([mesh], T_WORLD_CAMERA, REALSENSE_D415)
        depth = StereoNoise().apply(depth, REALSENSE_D415, rng)
        grasps = tracker.update(observe_depth(depth, REALSENSE_D415, rng), seed=number)
        yield mesh, grasps[0].to_frame(T_WORLD_CAMERA, "world")


def draw(mesh: trimesh.Trimesh, grasp: Grasps) -> Image.Image:
    """The object and the hand."""
    T_world_palm = make_transform(grasp.rotation[0], grasp.position[0])
    surfaces = [Surface(mesh, np.array([0.95, 0.6, 0.2]))]
    surfaces += hand_surfaces(load_hand(), grasp.joints[0], T_world_palm)
    camera = square_camera(300, field_of_view_degrees=24)
    view = look_at([-0.2, -0.95, 0.55], [0.0, 0.0, 0.12])
    return Image.fromarray(render(surfaces, view, camera, ground=0.0))


def main(gif: str | None = None) -> None:
    pictures = []
    for number, (mesh, grasp) in enumerate(track(FRAMES if gif is None else DRAWN_FRAMES)):
        towards = np.round(grasp.position[0] - mesh.bounds.mean(axis=0), 3)
        print(f"frame {number}: palm at {towards} m from the object's middle, score {grasp.score[0]:.2f}")
        if gif is not None:
            pictures.append(draw(mesh, grasp).quantize(64))
    if gif is not None:
        back_and_forth = [*pictures, *pictures[-2:0:-1]]
        back_and_forth[0].save(gif, save_all=True, append_images=back_and_forth[1:], duration=60, loop=0)


if __name__ == "__main__":
    main(*sys.argv[1:2])
