"""What pictures are made of: a hand, a cloud, arrows and frames as coloured meshes, and a colour scale."""

from __future__ import annotations

import numpy as np
import torch
import trimesh
from jaxtyping import Float

from ffhnet.evaluation.render import Surface
from ffhnet.geometry.transforms import make_transform
from ffhnet.hands import Hand

PALM = np.array([0.27, 0.31, 0.37])
FINGERS = np.array([0.86, 0.88, 0.90])
FINGERTIPS = np.array([0.43, 0.48, 0.55])
AXES = np.array([[0.86, 0.20, 0.18], [0.20, 0.62, 0.25], [0.16, 0.38, 0.85]])
"""Red x, green y, blue z."""

_SCALE = np.array(
    [[0.24, 0.16, 0.45], [0.20, 0.38, 0.64], [0.13, 0.60, 0.60], [0.45, 0.76, 0.36], [0.97, 0.84, 0.16]]
)
_CLOUD_LOW = np.array([0.80, 0.36, 0.12])
_CLOUD_HIGH = np.array([0.98, 0.74, 0.28])


def color_scale(values: Float[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
    """Colours (sRGB) of values in 0..1, dark violet to yellow; brightness rises all the way."""
    stops = np.linspace(0, 1, len(_SCALE))
    return np.stack([np.interp(values, stops, channel) for channel in _SCALE.T], axis=-1)


def link_colors(hand: Hand) -> Float[np.ndarray, "L 3"]:
    """Colour of each link of a hand: palm, fingers or fingertips."""
    tips = {site.body for site in hand.tree.sites}
    return np.array(
        [PALM if i == 0 else FINGERTIPS if i in tips else FINGERS for i in range(len(hand.tree.bodies))]
    )


def hand_surfaces(
    hand: Hand, joints: Float[np.ndarray, " J"], T_world_palm: Float[np.ndarray, "4 4"]
) -> list[Surface]:
    """Palm, fingers and fingertips of a hand in three colours, standing at a palm pose."""
    poses = T_world_palm @ hand.body_poses(torch.as_tensor(joints, dtype=torch.float64)[None])[0].numpy()
    colors = link_colors(hand)
    surfaces = []
    for color in (PALM, FINGERS, FINGERTIPS):
        links = [i for i in np.flatnonzero((colors == color).all(axis=1)) if len(hand.body_shapes[i].faces)]
        if links:
            part = trimesh.util.concatenate(
                [hand.body_shapes[i].copy().apply_transform(poses[i]) for i in links]
            )
            surfaces.append(Surface(part.smooth_shaded, color))
    return surfaces


def cloud_surface(cloud: Float[np.ndarray, "N 3"], detail: int = 60) -> Surface:
    """Points as small balls, coloured by height; thinned to one per cell of a `detail`-th of the extent."""
    cell = max(float(np.ptp(cloud, axis=0).max()) / detail, 1e-4)
    _, kept = np.unique(np.floor(cloud / cell).astype(int), axis=0, return_index=True)
    points = cloud[kept]
    ball = trimesh.creation.icosahedron()
    n_vertices, n_faces = len(ball.vertices), len(ball.faces)
    vertices = points[:, None] + 0.55 * cell * ball.vertices
    faces = ball.faces + n_vertices * np.arange(len(points))[:, None, None]
    mesh = trimesh.Trimesh(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3),
        vertex_normals=np.tile(ball.vertices, (len(points), 1)),
        process=False,
    )
    return Surface(mesh, np.repeat(cloud_colors(points), n_faces, axis=0))


def cloud_colors(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """A colour (sRGB) for each point by its height z, dark below."""
    height = points[:, 2] - points[:, 2].min()
    share = (height / max(height.max(), 1e-9))[:, None]
    return _CLOUD_LOW + share * (_CLOUD_HIGH - _CLOUD_LOW)


def arrow(length: float, radius: float, sections: int = 16) -> trimesh.Trimesh:
    """An arrow along +z from the origin (metres)."""
    head = min(0.35 * length, 6 * radius)
    shaft = trimesh.creation.cylinder(radius, length - head, sections=sections)
    shaft.apply_translation([0, 0, (length - head) / 2])
    cone = trimesh.creation.cone(2.4 * radius, head, sections=sections)
    return trimesh.util.concatenate([shaft, cone.apply_translation([0, 0, length - head])]).smooth_shaded


def frame_surfaces(T_world_frame: Float[np.ndarray, "4 4"], length: float, radius: float) -> list[Surface]:
    """The axes of a frame as arrows: red x, green y, blue z."""
    surfaces = []
    for axis, color in enumerate(AXES):
        T_frame_arrow = make_transform(_turn_z_to_axis(axis), np.zeros(3))
        surfaces.append(Surface(arrow(length, radius).apply_transform(T_world_frame @ T_frame_arrow), color))
    return surfaces


def approach_arrows(
    rotation: Float[np.ndarray, "N 3 3"],
    position: Float[np.ndarray, "N 3"],
    color: Float[np.ndarray, "N 3"],
    length: float = 0.035,
) -> Surface:
    """One small arrow per palm, along its approach axis (palm x)."""
    one = arrow(length, radius=length / 28, sections=8)
    turned = one.vertices @ _turn_z_to_axis(0).T
    normals = one.vertex_normals @ _turn_z_to_axis(0).T
    vertices = np.einsum("nij,vj->nvi", rotation, turned) + position[:, None]
    faces = one.faces + len(one.vertices) * np.arange(len(position))[:, None, None]
    mesh = trimesh.Trimesh(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3),
        vertex_normals=np.einsum("nij,vj->nvi", rotation, normals).reshape(-1, 3),
        process=False,
    )
    return Surface(mesh, np.repeat(color, len(one.faces), axis=0))


def _turn_z_to_axis(axis: int) -> Float[np.ndarray, "3 3"]:
    """The rotation that permutes the axes so that z becomes x (0), y (1) or z (2)."""
    return np.roll(np.eye(3), axis + 1, axis=0)
