"""Simulated views that several tests share."""

import numpy as np
import trimesh

from ffhnet.geometry.transforms import invert
from ffhnet.perception.camera import look_at
from ffhnet.perception.table import Plane

SIDES = np.array([0.06, 0.1, 0.18])


def box_on_table(x=0.0, y=0.0, sides=SIDES):
    box = trimesh.creation.box(sides)
    box.apply_translation([x, y, sides[2] / 2])
    return box


def camera_at(tilt_degrees, distance=0.7, azimuth=0.4, target=(0.0, 0.0, 0.08)):
    tilt = np.radians(tilt_degrees)
    back = np.array([np.cos(tilt) * np.cos(azimuth), np.cos(tilt) * np.sin(azimuth), np.sin(tilt)])
    return look_at(np.array(target) + distance * back, np.array(target))


def true_plane(T_world_camera):
    return Plane(np.array([0.0, 0.0, 1.0]), 0.0).to_frame(invert(T_world_camera))


def distance_to_box(points_world, sides=SIDES):
    """Unsigned distance of world points to the surface of `box_on_table`."""
    q = np.abs(points_world - [0, 0, sides[2] / 2]) - np.asarray(sides) / 2
    return np.abs(np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0))
