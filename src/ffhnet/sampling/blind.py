"""Blind controls: one fixed vertical wrap over whatever stands there, to tell what a network adds.

Of the cloud they use nothing but its footprint and its top. Many single objects on a table can be lifted like
that, so a success rate says little without theirs beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.ndimage import maximum_filter

from ffhnet.geometry.rotations import about_z, matrix_from_euler_xyz
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand

_STEPS = 45
"""Directions of the footprint that are tried, 2 degrees apart."""

_STRAY = 1.0
"""Per cent of the points at each end of a side that count as strays."""


_CELL = 0.005
"""m: side of the cells in which the open hand and the cloud are compared."""

_REACH = 64
"""Cells to each side of the palm's x axis; the open hand is smaller."""


@dataclass(frozen=True)
class BlindConfig:
    """The wrap; the values were chosen among about sixty on 20 objects of the validation split.

    The hand comes down along its approach axis until the hollow of the hand is `depth` below the top of what
    the camera sees, or until the open hand would touch that or the table.

    Attributes:
        tilt: rad by which the palm's x axis leaves straight down, so that the palm's face turns down.
        reference: point of the palm frame (m) in the hollow of the hand.
        depth: m of that point below the object's top.
        clearance: m that the open hand keeps from cloud and table along its way.
        weights: of the hand's eigengrasps, the shape that it closes to first; of a hand with fewer the first
            ones, of one with more the others are zero.
    """

    tilt: float = 0.1
    reference: tuple[float, float, float] = (0.075, 0.03, 0.0)
    depth: float = 0.02
    clearance: float = 0.005
    weights: tuple[float, ...] = (0.05, 0.25, 0.35, 0.0)


BLIND = BlindConfig()


@dataclass(frozen=True)
class Footprint:
    """The smallest rectangle around a cloud seen from above.

    Attributes:
        centre: m, in the world's xy plane.
        short_yaw: rad, direction of the shorter side.
        sides: m, the shorter and the longer one.
    """

    centre: Float[np.ndarray, " 2"]
    short_yaw: float
    sides: tuple[float, float]


def footprint(cloud: Float[np.ndarray, "M 3"]) -> Footprint:
    """The rectangle of the least area around the cloud (m, world frame), strays left out."""
    yaw = np.arange(_STEPS) * np.pi / 2 / _STEPS
    axes = np.stack([np.stack([np.cos(yaw), np.sin(yaw)]), np.stack([-np.sin(yaw), np.cos(yaw)])])
    along = np.einsum("mk,akn->anm", cloud[:, :2], axes)
    low, high = np.percentile(along, [_STRAY, 100 - _STRAY], axis=-1)
    best = int(np.argmin(np.prod(high - low, axis=0)))
    sides = (high - low)[:, best]
    middle = (high + low)[:, best] / 2
    short = int(np.argmin(sides))
    return Footprint(
        centre=middle @ axes[:, :, best],
        short_yaw=float(yaw[best] + short * np.pi / 2),
        sides=(float(sides[short]), float(sides[1 - short])),
    )


def blind_random_yaw(
    cloud: Float[np.ndarray, "M 3"],
    hand: Hand,
    count: int,
    rng: np.random.Generator,
    config: BlindConfig = BLIND,
) -> Grasps:
    """Vertical wraps over the middle of the cloud, turned at random about the vertical.

    Args:
        cloud: visible object points, metres, world frame (table at z = 0).
        hand: gives eigengrasps and limits; its fingers and thumb must close along the palm's z axis.
        count: number of grasps.
        rng: source of randomness.
        config: the wrap.
    """
    return _wraps(cloud, footprint(cloud), hand, rng.uniform(-np.pi, np.pi, count), config)


def blind_short_side(
    cloud: Float[np.ndarray, "M 3"],
    hand: Hand,
    count: int,
    rng: np.random.Generator,
    config: BlindConfig = BLIND,
) -> Grasps:
    """The same, closing across the footprint's shorter side, with the thumb on either side by chance."""
    seen = footprint(cloud)
    return _wraps(cloud, seen, hand, seen.short_yaw + np.pi * rng.integers(2, size=count), config)


def _wraps(
    cloud: Float[np.ndarray, "M 3"],
    seen: Footprint,
    hand: Hand,
    yaw: Float[np.ndarray, " N"],
    config: BlindConfig,
) -> Grasps:
    """`yaw` is the direction in which the palm's z axis points, from thumb to fingers."""
    used = hand.eigengrasps[: len(config.weights)]
    joints = hand.eigengrasp_origin + np.array(config.weights[: len(used)]) @ used
    joints = np.clip(joints, hand.lower, hand.upper)
    upright = matrix_from_euler_xyz(np.array([0.0, np.pi / 2 - config.tilt, 0.0]))
    rotation = np.stack([about_z(angle) for angle in yaw]) @ upright
    top = np.percentile(cloud[:, 2], 100 - _STRAY)
    hollow = np.array([*seen.centre, top - config.depth])
    nearest = hollow - rotation @ np.array(config.reference)
    surface = _surface(hand.shape(hand.open(joints)))
    back = [_way_back(surface, cloud, r, p, config.clearance) for r, p in zip(rotation, nearest, strict=True)]
    position = nearest - np.array(back)[:, None] * rotation[:, :, 0]
    return Grasps(
        rotation=rotation,
        position=position,
        joints=np.tile(joints, (len(yaw), 1)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )


def _surface(mesh: trimesh.Trimesh) -> Float[np.ndarray, "V 3"]:
    """Points all over a mesh, at most two cells apart."""
    vertices, _ = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 2 * _CELL, max_iter=12)
    return vertices


def _way_back(
    surface: Float[np.ndarray, "V 3"],
    cloud: Float[np.ndarray, "M 3"],
    rotation: Float[np.ndarray, "3 3"],
    position: Float[np.ndarray, " 3"],
    clearance: float,
) -> float:
    """How far (m) the open hand must stay back along its x axis to be clear of cloud and table on its way."""
    front = maximum_filter(_highest(surface), size=3)  # a cell to all sides: no gaps, and some margin
    overlap = front + _highest((cloud - position) @ rotation * [-1.0, 1.0, 1.0])
    lowest = (surface @ rotation.T)[:, 2].min() + position[2]
    down = -rotation[2, 0]
    return max(0.0, float(overlap.max()) + clearance, (clearance - lowest) / down)


def _highest(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "c c"]:
    """The largest x in each cell of the yz plane around the origin, -inf where there is none."""
    cell = np.floor(points[:, 1:] / _CELL).astype(int) + _REACH
    inside = ((cell >= 0) & (cell < 2 * _REACH)).all(axis=1)
    grid = np.full((2 * _REACH, 2 * _REACH), -np.inf)
    np.maximum.at(grid, tuple(cell[inside].T), points[inside, 0])
    return grid
