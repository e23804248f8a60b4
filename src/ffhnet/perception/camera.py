"""A pinhole depth camera: intrinsics, where it stands, and what it would measure without noise."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ffhnet.errors import OptionError
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.perception.raycast import RayScene

if TYPE_CHECKING:
    import trimesh

TABLE_SIZE = 1.2
"""m: side of the square table around the world origin that `render_depth` shows."""

_NEAR = 0.05
"""m: with an object's bounding box nearer than this, or behind the camera, every pixel's ray is cast."""


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion; all lengths in pixels.

    A pixel (u, v) of depth d is the point ((u - cx) d / fx, (v - cy) d / fy, d) of the camera frame
    (optical: x right, y down, z forward).

    Raises:
        OptionError: a focal length or an image side is not positive, or a value is not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int = 640
    height: int = 480

    def __post_init__(self) -> None:
        if not (self.fx > 0 and self.fy > 0 and self.width > 0 and self.height > 0):
            raise OptionError(f"intrinsics must have positive fx, fy, width and height, got {self}")
        if not np.all(np.isfinite([self.fx, self.fy, self.cx, self.cy])):
            raise OptionError(f"intrinsics must be finite, got {self}")

    def rays(self) -> tuple[Float[np.ndarray, " W"], Float[np.ndarray, " H"]]:
        """Direction (x, y, 1) of the pixels: x of every column and y of every row."""
        return (np.arange(self.width) - self.cx) / self.fx, (np.arange(self.height) - self.cy) / self.fy


REALSENSE_D415 = Intrinsics(fx=615.0, fy=615.0, cx=320.0, cy=240.0)
"""Depth aligned to colour; single cameras differ by about 1 %."""

REALSENSE_D435 = Intrinsics(fx=383.0, fy=383.0, cx=320.0, cy=240.0)
"""Depth stream, whose field of view is wider than that of the colour camera."""

KINECT_V1 = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5)
"""Also the PrimeSense Carmine and the Asus Xtion."""

PRESETS = {"realsense_d415": REALSENSE_D415, "realsense_d435": REALSENSE_D435, "kinect_v1": KINECT_V1}
"""The known cameras by name."""


def look_at(
    eye: Float[np.ndarray, " 3"], target: Float[np.ndarray, " 3"], roll: float = 0.0
) -> Float[np.ndarray, "4 4"]:
    """T_world_camera of a camera at `eye` (m, world) whose optical axis goes through `target`.

    Without roll the image's x axis is level. Looking straight up or down, world y is up in the image.

    Args:
        eye: position of the camera.
        target: a point on the optical axis.
        roll: rotation about the optical axis in radians.

    Raises:
        OptionError: eye and target are the same point.
    """
    eye, target = np.asarray(eye, dtype=float), np.asarray(target, dtype=float)
    forward = target - eye
    length = np.linalg.norm(forward)
    if length < 1e-9:
        raise OptionError(f"a camera at {eye} cannot look at its own position")
    z = forward / length
    x = np.cross(z, [0.0, 0.0, 1.0])
    if np.linalg.norm(x) < 1e-6:
        x = np.cross(z, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    c, s = np.cos(roll), np.sin(roll)
    return make_transform(np.column_stack([c * x + s * y, c * y - s * x, z]), eye)


def random_camera(
    rng: np.random.Generator,
    target: Float[np.ndarray, " 3"],
    distance: tuple[float, float] = (0.5, 1.0),
    tilt_degrees: tuple[float, float] = (15.0, 75.0),
    roll_sd_degrees: float = 3.0,
) -> Float[np.ndarray, "4 4"]:
    """T_world_camera of a camera that looks down at `target` (m, world) from any side.

    Args:
        rng: source of randomness.
        target: the point looked at.
        distance: metres from the target, drawn uniformly.
        tilt_degrees: of the optical axis below the horizontal, drawn uniformly.
        roll_sd_degrees: standard deviation of the roll.
    """
    azimuth = rng.uniform(0, 2 * np.pi)
    tilt = np.radians(rng.uniform(*tilt_degrees))
    back = np.array([np.cos(tilt) * np.cos(azimuth), np.cos(tilt) * np.sin(azimuth), np.sin(tilt)])
    eye = np.asarray(target, dtype=float) + rng.uniform(*distance) * back
    return look_at(eye, target, roll=np.radians(roll_sd_degrees * rng.standard_normal()))


def render_depth(
    scene_meshes: RayScene | Sequence[trimesh.Trimesh],
    T_world_camera: Float[np.ndarray, "4 4"],
    intrinsics: Intrinsics,
    table: bool = True,
) -> Float[np.ndarray, "H W"]:
    """Noise-free depth in metres (along the optical axis) of meshes in the world frame; 0 = nothing.

    Args:
        scene_meshes: the meshes, or a `RayScene` of them that is used for several views.
        T_world_camera: pose of the camera.
        intrinsics: the camera.
        table: whether the table is seen: the square z = 0 with sides of `TABLE_SIZE` around the origin.
    """
    scene = scene_meshes if isinstance(scene_meshes, RayScene) else RayScene(scene_meshes)
    if table:
        depth = _table_depth(T_world_camera, intrinsics)
    else:
        depth = np.full((intrinsics.height, intrinsics.width), np.inf)
    rows, columns = _window(scene, T_world_camera, intrinsics)
    x, y = intrinsics.rays()
    window_x, window_y = np.meshgrid(x[columns], y[rows])
    directions = np.stack([window_x, window_y, np.ones_like(window_x)], axis=-1).reshape(-1, 3)
    # The directions have z = 1 in the camera frame, so the distance along the ray is the depth.
    found = scene.distances(T_world_camera[None, :3, 3], directions @ T_world_camera[:3, :3].T)
    depth[rows, columns] = np.minimum(depth[rows, columns], found.reshape(window_x.shape))
    depth[np.isinf(depth)] = 0.0
    return depth


def _table_depth(
    T_world_camera: Float[np.ndarray, "4 4"], intrinsics: Intrinsics
) -> Float[np.ndarray, "H W"]:
    """Depth of the table's plane in each pixel, inf beside and behind the table."""
    x, y = intrinsics.rays()
    rotation, eye = T_world_camera[:3, :3], T_world_camera[:3, 3]
    in_world = [rotation[i, 0] * x + (rotation[i, 1] * y + rotation[i, 2])[:, None] for i in range(3)]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -eye[2] / in_world[2]
        seen = depth > 0
        for axis in (0, 1):
            seen &= np.abs(eye[axis] + depth * in_world[axis]) <= TABLE_SIZE / 2
    return np.where(seen, depth, np.inf)


def _window(
    scene: RayScene, T_world_camera: Float[np.ndarray, "4 4"], intrinsics: Intrinsics
) -> tuple[slice, slice]:
    """Rows and columns of the image outside of which no ray can hit a mesh."""
    if scene.bounds is None:
        return slice(0, 0), slice(0, 0)
    corners = np.array(list(itertools.product(*scene.bounds.T)))
    in_camera = apply(invert(T_world_camera), corners)
    if in_camera[:, 2].min() < _NEAR:
        return slice(0, intrinsics.height), slice(0, intrinsics.width)
    u = in_camera[:, 0] / in_camera[:, 2] * intrinsics.fx + intrinsics.cx
    v = in_camera[:, 1] / in_camera[:, 2] * intrinsics.fy + intrinsics.cy

    def span(pixels: Float[np.ndarray, " 8"], size: int) -> slice:
        low, high = np.clip([np.floor(pixels.min()), np.ceil(pixels.max()) + 1], 0, size)
        return slice(int(low), int(high))

    return span(v, intrinsics.height), span(u, intrinsics.width)
