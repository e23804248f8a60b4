"""A tube and boxes on a table, seen by a camera without noise, and grasps of the tube."""

import numpy as np
import trimesh

from ffhnet.geometry.transforms import apply, invert
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.observation import observe_depth

T_WORLD_CAMERA = look_at([-0.6, 0.1, 0.5], [0.0, 0.0, 0.08])


def tube():
    return trimesh.creation.cylinder(radius=0.03, height=0.14).apply_translation([0, 0, 0.07])


def box(x, y, height=0.16):
    return trimesh.creation.box([0.08, 0.08, height]).apply_translation([x, y, height / 2])


def observe(*meshes):
    """The observation of what stands at the world's origin."""
    depth = render_depth(list(meshes), T_WORLD_CAMERA, REALSENSE_D415)
    for index in range(len(meshes)):
        found = observe_depth(depth, REALSENSE_D415, np.random.default_rng(0), object_index=index)
        if np.linalg.norm(apply(T_WORLD_CAMERA, found.cloud).mean(axis=0)[:2]) < 0.04:
            return found
    raise AssertionError("nothing at the origin")


def grasps_from(azimuths, distance=0.12, height=0.08):
    """Side grasps of the tube (world frame): palm x level, from these directions (rad) towards its axis."""
    hand, azimuths = load_hand(), np.atleast_1d(azimuths)
    back = np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(len(azimuths))], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], back.shape)
    return Grasps(
        rotation=np.stack([-back, up, np.cross(-back, up)], axis=2),
        position=distance * back + [0.0, 0.0, height],
        joints=np.zeros((len(back), hand.num_joints)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
        probability=np.ones(len(back)),
    )


def to_camera(grasps):
    return grasps.to_frame(invert(T_WORLD_CAMERA), "camera")
