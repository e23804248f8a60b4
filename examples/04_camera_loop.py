"""A camera loop: one grasp that stays with an object while it is pushed and turned.

python examples/04_camera_loop.py
"""

import time
from collections.abc import Iterator

import numpy as np
import trimesh

from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import make_transform
from ffhnet.inference import FFHNet
from ffhnet.inference.tracking import GraspTracker
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.observation import observe_depth
from ffhnet.perception.sensor_noise import StereoNoise

FRAMES = 6
T_WORLD_CAMERA = look_at([-0.55, 0.0, 0.45], [0.0, 0.0, 0.05])


def camera(frames: int) -> Iterator[tuple[trimesh.Trimesh, np.ndarray]]:
    """Depth images (m) of a moving object, and the object in the world. Put your camera here."""
    obj = resolve_objects("spray_flask_2000005")[0].load()
    rng = np.random.default_rng(0)
    for along in np.linspace(-1, 1, frames):
        T_world_object = make_transform(about_z(0.9 * along), np.array([0.05 * along**2, 0.12 * along, 0.0]))
        mesh = obj.visual.copy().apply_transform(T_world_object @ obj.resting_poses[0])
        depth = render_depth([mesh], T_WORLD_CAMERA, REALSENSE_D415)
        yield mesh, StereoNoise().apply(depth, REALSENSE_D415, rng)


def main() -> None:
    # Changes its mind only for a grasp that is better by more than the evaluator's noise.
    tracker = GraspTracker(FFHNet.from_pretrained(), num=100)
    rng = np.random.default_rng(1)
    for number, (mesh, depth) in enumerate(camera(FRAMES)):
        start = time.perf_counter()
        grasps = tracker.update(observe_depth(depth, REALSENSE_D415, rng), seed=number)
        milliseconds = 1000 * (time.perf_counter() - start)
        best = grasps[0].to_frame(T_WORLD_CAMERA, "world")
        towards = np.round(best.position[0] - mesh.bounds.mean(axis=0), 3)
        print(f"frame {number}: palm at {towards} m from the object's middle, ", end="")
        print(f"score {best.score[0]:.2f}, {milliseconds:.0f} ms")


if __name__ == "__main__":
    main()
