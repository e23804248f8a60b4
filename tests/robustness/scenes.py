"""Views of objects on a table, the noise of the camera to one's liking, and clouds of what is no object."""

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


def uniform(low: list[float], high: list[float], number: int = 4000) -> np.ndarray:
    """Points (m) drawn from a box."""
    return np.random.default_rng(0).uniform(low, high, (number, 3))


def shell(points: np.ndarray, radius: float) -> np.ndarray:
    """Points moved to a sphere around the origin."""
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


def room(width: float, depth: float, height: float) -> np.ndarray:
    """Four walls and a floor (m)."""
    points = uniform([-width / 2, -depth / 2, 0], [width / 2, depth / 2, height])
    face = np.arange(len(points)) % 5
    for number, (axis, place) in enumerate(
        [(0, -width / 2), (0, width / 2), (1, -depth / 2), (1, depth / 2), (2, 0)]
    ):
        points[face == number, axis] = place
    return points


STRANGE = {
    "table top, 60 cm": uniform([-0.3, -0.3, -0.001], [0.3, 0.3, 0.001]),
    "wall, 80 cm": uniform([-0.001, -0.4, 0], [0.001, 0.4, 0.6]),
    "wall, 2 m": uniform([-0.001, -1, 0], [0.001, 1, 2]),
    "car": uniform([-2, -0.9, 0], [2, 0.9, 1.5]),
    "person": uniform([-0.2, -0.3, 0], [0.2, 0.3, 1.75]),
    "empty room": room(4, 5, 2.5),
    "crate from within": room(0.5, 0.4, 0.3),
    "ball of 40 cm": shell(uniform([-1, -1, -1], [1, 1, 1]), 0.2),
    "noise, 40 cm": uniform([-0.2, -0.2, -0.2], [0.2, 0.2, 0.2]),
    "noise, 1 m": uniform([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]),
    "two cans 40 cm apart": np.concatenate(
        [uniform([-0.03, -0.03, 0], [0.03, 0.03, 0.12]), uniform([0.37, -0.03, 0], [0.43, 0.03, 0.12])]
    ),
}
"""Clouds (m, z up) that no hand takes up, by name."""

LIKE_OBJECTS = {
    "wire, 40 cm": uniform([-0.2, -0.001, 0.019], [0.2, 0.001, 0.021]),
    "noise, 20 cm": uniform([-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]),
    "speck, 1 cm": uniform([-0.005, -0.005, 0], [0.005, 0.005, 0.01]),
}
"""Clouds that are none either, but look like one at a hand's scale."""
