"""Makes the depth images in examples/data: held-out procedural objects seen by the simulated camera.

Run it from the repository root: python examples/make_example_views.py
"""

from pathlib import Path

import numpy as np
from PIL import Image

from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import make_transform
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.sensor_noise import StereoNoise

DATA = Path(__file__).parent / "data"
YAW_DEGREES = {"spray_flask_2000005": 60.0, "jar_2000004": 0.0, "thin_box_2000008": 35.0}
"""How each object stands. All are from the test split: no training run sees them."""

CAMERA_FROM_OBJECT = np.array([-0.52, 0.08, 0.36])
"""m: looks down by 35 degrees."""

SEED = 0


def main() -> None:
    for name, yaw in YAW_DEGREES.items():
        obj = resolve_objects(name)[0].load()
        T_world_object = make_transform(about_z(np.radians(yaw))) @ obj.resting_poses[0]
        mesh = obj.visual.copy().apply_transform(T_world_object)
        middle = mesh.bounds.mean(axis=0)
        T_world_camera = look_at(middle + CAMERA_FROM_OBJECT, middle)
        depth = render_depth([mesh], T_world_camera, REALSENSE_D415)
        depth = StereoNoise().apply(depth, REALSENSE_D415, np.random.default_rng(SEED))
        path = DATA / f"{name}_depth.png"
        Image.fromarray(np.rint(1000 * depth).astype(np.uint16)).save(path, optimize=True)
        print(path)


if __name__ == "__main__":
    main()
