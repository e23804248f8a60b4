"""A small ray-casting renderer for pictures of grasps: no display, no OpenGL, the same image everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, UInt8

from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.perception.camera import Intrinsics, look_at
from ffhnet.perception.raycast import RayScene

BACKGROUND = np.array([0.945, 0.955, 0.97])
"""sRGB of what no ray hits."""

_GROUND = np.array([0.905, 0.91, 0.92])
_CHECK = 0.05  # m, side of the ground's squares
_SUN = 0.85
_SKY = 0.42
_SUN_WIDTH = 0.05  # rad, half the angle that the light's disc fills: how soft shadows are
_GAMMA = 2.2
_OFF_SURFACE = 3e-5  # m, start of a shadow ray above its surface
_RAYS_AT_ONCE = 1 << 18  # keeps the arrays of one pass in the cache


@dataclass(frozen=True)
class Surface:
    """A mesh and its colour.

    Attributes:
        mesh: in the world frame of the picture (metres, z up); shaded with its vertex normals.
        color: sRGB in 0..1, one for all or one per face.
    """

    mesh: trimesh.Trimesh
    color: Float[np.ndarray, "*F 3"]


def square_camera(pixels: int, field_of_view_degrees: float = 28.0) -> Intrinsics:
    """The camera of a square picture. A narrow field of view keeps the proportions of near things."""
    focal = pixels / 2 / np.tan(np.radians(field_of_view_degrees) / 2)
    return Intrinsics(focal, focal, (pixels - 1) / 2, (pixels - 1) / 2, pixels, pixels)


def camera_around(
    points: Float[np.ndarray, "N 3"],
    azimuth_degrees: float,
    elevation_degrees: float,
    camera: Intrinsics,
    margin: float = 1.1,
) -> Float[np.ndarray, "4 4"]:
    """T_world_camera from which all points just fill the picture.

    Args:
        points: what must be seen, in the world frame (m).
        azimuth_degrees: of the camera about world z, counted from +x.
        elevation_degrees: of the camera above the horizontal.
        camera: intrinsics of the picture.
        margin: how much larger than the points the picture is.
    """
    azimuth, elevation = np.radians([azimuth_degrees, elevation_degrees])
    back = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    rotation = look_at(back, np.zeros(3))[:3, :3]
    x, y, depth = (points @ rotation).T
    slope = np.array([camera.width / camera.fx, camera.height / camera.fy]) / 2 / margin
    # Centre and distance come one axis at a time: |x - x0| <= slope (depth - depth0) for all points.
    centre, distance = np.zeros(2), 0.0
    for axis, across in enumerate((x, y)):
        right, left = (across - slope[axis] * depth).max(), (-across - slope[axis] * depth).max()
        centre[axis] = (right - left) / 2
        distance = max(distance, (right + left) / 2 / slope[axis])
    return make_transform(rotation, rotation @ np.array([*centre, -distance]))


def render(
    surfaces: Sequence[Surface],
    T_world_camera: Float[np.ndarray, "4 4"],
    camera: Intrinsics,
    ground: float | None = None,
    supersampling: int = 2,
) -> UInt8[np.ndarray, "H W 3"]:
    """An sRGB picture of surfaces, with one light, its shadows, and a ground that fades out.

    Args:
        surfaces: what is seen, in the world frame.
        T_world_camera: pose of the camera.
        camera: its intrinsics; the picture has their size.
        ground: height (world z) of the ground, or None for no ground.
        supersampling: rays per pixel and axis.
    """
    scene = _Scene(surfaces, T_world_camera, ground)
    s = supersampling
    fine = (np.arange(max(camera.width, camera.height) * s) + 0.5) / s - 0.5
    x = (fine[: camera.width * s] - camera.cx) / camera.fx
    y = (fine[: camera.height * s] - camera.cy) / camera.fy
    rows_at_once = max(s, _RAYS_AT_ONCE // len(x) // s * s)
    bands = []
    for start in range(0, len(y), rows_at_once):
        rows = y[start : start + rows_at_once]
        color = scene.colors(x, rows, s).reshape(len(rows) // s, s, camera.width, s, 3)
        bands.append(color.mean(axis=(1, 3)))
    picture = np.clip(np.concatenate(bands), 0, 1) ** (1 / _GAMMA)
    return np.asarray(np.round(picture * 255), dtype=np.uint8)


class _Scene:
    """Surfaces, light and ground of one picture; colours are linear inside."""

    def __init__(
        self, surfaces: Sequence[Surface], T_world_camera: Float[np.ndarray, "4 4"], ground: float | None
    ) -> None:
        self._rays = RayScene([surface.mesh for surface in surfaces])
        self._ground = ground
        self._rotation, self._eye = T_world_camera[:3, :3], T_world_camera[:3, 3]
        right, forward = self._rotation[:, 0], self._rotation[:, 2]
        # Over the viewer's left shoulder, so that shadows fall to the right and away.
        self._light = _unit(np.array([0.0, 0.0, 1.0]) - 0.5 * right - 0.45 * _level(forward))
        meshes = [surface.mesh for surface in surfaces]
        self._first_face = np.concatenate([[0], np.cumsum([len(mesh.faces) for mesh in meshes])])
        self._corners = np.concatenate([mesh.triangles for mesh in meshes])
        self._normals = np.concatenate([mesh.vertex_normals[mesh.faces] for mesh in meshes])
        self._colors = np.concatenate(
            [np.broadcast_to(s.color, (len(s.mesh.faces), 3)) for s in surfaces]
        ) ** (_GAMMA)
        low, high = self._rays.bounds if self._rays.bounds is not None else np.zeros((2, 3))
        self._middle = (low + high) / 2
        self._reach = max(0.15, float(np.linalg.norm((high - low)[:2])) / 2)

    def colors(
        self, x: Float[np.ndarray, " W"], y: Float[np.ndarray, " H"], supersampling: int
    ) -> Float[np.ndarray, "N 3"]:
        """Linear colours of the rays (x, y, 1) in the camera frame, row by row."""
        grid_x, grid_y = np.meshgrid(x, y)
        directions = np.stack([grid_x, grid_y, np.ones_like(grid_x)], axis=-1).reshape(-1, 3)
        directions = _unit(directions @ self._rotation.T)
        lights = self._light_samples(grid_x.shape, supersampling)
        hits = self._rays.cast(self._eye[None], directions)
        color = np.broadcast_to(BACKGROUND**_GAMMA, directions.shape).copy()
        distance = hits.distance
        if self._ground is not None:
            with np.errstate(divide="ignore"):
                to_ground = (self._ground - self._eye[2]) / directions[:, 2]
            on_ground = (to_ground > 0) & (to_ground < distance)
            points = self._eye + to_ground[on_ground, None] * directions[on_ground]
            color[on_ground] = self._ground_colors(points, lights[on_ground])
            hit = hits.hit & ~on_ground
        else:
            hit = hits.hit
        face = self._first_face[hits.mesh[hit]] + hits.triangle[hit]
        points = self._eye + distance[hit, None] * directions[hit]
        color[hit] = self._surface_colors(face, points, hits.normal[hit], directions[hit], lights[hit])
        return color

    def _light_samples(self, shape: tuple[int, int], supersampling: int) -> Float[np.ndarray, "N 3"]:
        """A direction to the light for each ray: every ray of a pixel sees another part of its disc."""
        rows, columns = np.indices(shape) % supersampling
        index = (rows * supersampling + columns).ravel()
        angle = np.arange(supersampling**2) * 2.399963  # the golden angle spreads any number evenly
        radius = _SUN_WIDTH * np.sqrt((np.arange(supersampling**2) + 0.5) / supersampling**2)
        side = _unit(np.cross(self._light, [0.0, 0.0, 1.0]))
        other = np.cross(side, self._light)
        disc = radius[:, None] * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)
        return _unit(self._light + disc)[index]

    def _ground_colors(
        self, points: Float[np.ndarray, "N 3"], lights: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "N 3"]:
        shadow = self._rays.occluded(points + _OFF_SURFACE * np.array([0, 0, 1.0]), lights)
        check = np.floor(points[:, :2] / _CHECK).sum(axis=1) % 2
        shade = (1 - 0.045 * check) * np.where(shadow, 0.62, 1.0)
        away = np.linalg.norm(points[:, :2] - self._middle[:2], axis=1)
        fade = np.clip((away / self._reach - 1.2) / 1.8, 0, 1)[:, None]
        fade = fade * fade * (3 - 2 * fade)
        return fade * BACKGROUND**_GAMMA + (1 - fade) * shade[:, None] * _GROUND**_GAMMA

    def _surface_colors(
        self,
        face: np.ndarray,
        points: Float[np.ndarray, "N 3"],
        flat_normal: Float[np.ndarray, "N 3"],
        directions: Float[np.ndarray, "N 3"],
        lights: Float[np.ndarray, "N 3"],
    ) -> Float[np.ndarray, "N 3"]:
        weights = trimesh.triangles.points_to_barycentric(self._corners[face], points)
        normal = _unit(np.einsum("nk,nkd->nd", weights, self._normals[face]))
        normal = np.where(_behind(normal, directions)[:, None], -normal, normal)
        flat = np.where(_behind(flat_normal, directions)[:, None], -flat_normal, flat_normal)
        shadow = self._rays.occluded(points + _OFF_SURFACE * flat, lights)
        towards_light = np.einsum("nd,nd->n", normal, lights)
        sun = _SUN * np.where(shadow, 0.0, np.maximum(towards_light, 0))
        sky = _SKY * (0.65 + 0.35 * normal[:, 2])
        # A weak light from the camera keeps the form of what lies in the shadow.
        headlight = 0.16 * np.maximum(-np.einsum("nd,nd->n", normal, directions), 0)
        half = _unit(lights - directions)
        gloss = np.where(shadow, 0.0, 0.12 * np.maximum(np.einsum("nd,nd->n", normal, half), 0) ** 40)
        return self._colors[face] * (sun + sky + headlight)[:, None] + gloss[:, None]


def pixels_of(
    points: Float[np.ndarray, "N 3"], T_world_camera: Float[np.ndarray, "4 4"], camera: Intrinsics
) -> Float[np.ndarray, "N 2"]:
    """Where points of the world (m) lie in the picture, as (column, row); for labels."""
    T_camera_world = invert(T_world_camera)
    x, y, depth = (points @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]).T
    return np.stack([camera.fx * x / depth + camera.cx, camera.fy * y / depth + camera.cy], axis=1)


def _unit(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    return vectors / np.maximum(np.sqrt(np.einsum("...d,...d->...", vectors, vectors)), 1e-12)[..., None]


def _level(vector: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """The horizontal part at length 1; zero for a vertical vector."""
    return _unit(vector * np.array([1.0, 1.0, 0.0]))


def _behind(normal: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
    """Which normals point away from the viewer."""
    return np.einsum("nd,nd->n", normal, directions) > 0
