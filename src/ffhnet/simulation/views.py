"""Simulated views of one placed object: camera, sensor noise, table removal, observation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from zlib import crc32

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.errors import CloudError, SceneError
from ffhnet.geometry.transforms import apply
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.perception.camera import PRESETS, random_camera, render_depth
from ffhnet.perception.cloud import estimate_normals
from ffhnet.perception.observation import Observation, observe_depth
from ffhnet.perception.raycast import RayScene
from ffhnet.perception.sensor_noise import StereoNoise

MAX_ATTEMPTS = 10


@dataclass(frozen=True)
class View:
    """What a simulated camera sees of an object.

    Attributes:
        observation: in the camera frame, as a real camera would give it.
        T_world_camera: where the camera stands.
    """

    observation: Observation
    T_world_camera: Float[np.ndarray, "4 4"]

    @property
    def T_world_view(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the view frame in the world."""
        return self.T_world_camera @ self.observation.T_input_view

    @cached_property
    def cloud_and_normals_world(self) -> tuple[Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"]]:
        """Visible points (m) and outward normals in the world frame."""
        cloud = apply(self.T_world_camera, self.observation.cloud)
        return cloud, estimate_normals(cloud, self.T_world_camera[:3, 3])


class ViewMaker:
    """Takes random noisy views of one object at one resting pose."""

    def __init__(self, obj: GraspObject, T_world_object: Float[np.ndarray, "4 4"]) -> None:
        placed: trimesh.Trimesh = obj.visual.copy()
        placed.apply_transform(T_world_object)
        self._scene = RayScene([placed])
        self._name = obj.name
        self._target = np.array([0.0, 0.0, placed.bounds[1, 2] / 2])

    def take(self, rng: np.random.Generator) -> View:
        """One view: random camera pose and sensor; the object's points come from table removal.

        Raises:
            SceneError: the object could not be seen from any of several random poses.
        """
        for _ in range(MAX_ATTEMPTS):
            T_world_camera = random_camera(rng, self._target)
            intrinsics = list(PRESETS.values())[rng.integers(len(PRESETS))]
            depth = render_depth(self._scene, T_world_camera, intrinsics)
            depth = StereoNoise().apply(depth, intrinsics, rng)
            try:
                observation = observe_depth(depth, intrinsics, rng)
            except (CloudError, SceneError):
                continue
            return View(observation, T_world_camera)
        raise SceneError(f"{self._name} could not be segmented in {MAX_ATTEMPTS} simulated views")


def seeded_views(
    obj: GraspObject, count: int, seed: int
) -> Iterator[tuple[View, Float[np.ndarray, "4 4"], np.random.Generator]]:
    """Random views of an object, its resting poses in turn; one that cannot be taken is left out.

    Yields:
        The view, the object's pose in the world, and randomness for what is done with it, all decided by
        seed, name and the number of the view.
    """
    makers = [ViewMaker(obj, pose) for pose in obj.resting_poses[:count]]
    for number in range(count):
        rng = np.random.default_rng([seed, crc32(obj.name.encode()), number])
        turn = number % len(makers)
        try:
            view = makers[turn].take(rng)
        except SceneError:
            continue
        yield view, obj.resting_poses[turn], rng
