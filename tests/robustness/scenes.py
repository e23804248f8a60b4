"""Views of objects on a table, the noise of the camera to one's liking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffhnet.geometry.transforms import apply
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, random_camera, render_depth
from ffhnet.perception.observation import observe_depth
from ffhnet.perception.sensor_noise import StereoNoise


def depth_view(name: str, seed: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A depth image (m) of an object that stands on the table, and T_world_camera.

    Args:
        name: of a procedural object.
        seed: decides where the camera stands, and the noise.
        noise: factor of the usual noise of depth; 0 for a perfect camera.
    """
    rng = np.random.default_rng(seed)
    obj = resolve_objects(name)[0].load()
    mesh = obj.visual.copy().apply_transform(obj.resting_poses[0])
    T_world_camera = random_camera(rng, mesh.bounds.mean(axis=0), tilt_degrees=(30.0, 60.0))
    depth = render_depth([mesh], T_world_camera, REALSENSE_D415)
    if noise > 0:
        usual = StereoNoise()
        camera = replace(usual, white_sd=noise * usual.white_sd, correlated_sd=noise * usual.correlated_sd)
        depth = camera.apply(depth, REALSENSE_D415, rng)
    return depth, T_world_camera


def object_view(name: str, seed: int, noise: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The points of the object alone, as found on the table, and where the camera stands (world frame, m)."""
    depth, T_world_camera = depth_view(name, seed, noise)
    found = observe_depth(depth, REALSENSE_D415, np.random.default_rng(seed))
    return apply(T_world_camera, found.cloud), T_world_camera[:3, 3]
