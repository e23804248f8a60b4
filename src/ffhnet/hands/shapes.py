"""Meshes of a hand's collision shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.hands.kinematics import KinematicTree


def body_meshes(tree: KinematicTree) -> tuple[trimesh.Trimesh, ...]:
    """The shapes of every body in its own frame, one mesh each (empty where it has none)."""
    parts: list[list[trimesh.Trimesh]] = [[] for _ in tree.bodies]
    for geom in tree.geoms:
        parts[geom.body].append(_primitive(geom.type, geom.size).apply_transform(geom.T_body_geom))
    return tuple(trimesh.util.concatenate(part) if part else trimesh.Trimesh() for part in parts)


def placed(meshes: Sequence[trimesh.Trimesh], poses: Float[np.ndarray, "B 4 4"]) -> trimesh.Trimesh:
    """The meshes, each at its pose, as one."""
    return trimesh.util.concatenate(
        [mesh.copy().apply_transform(pose) for mesh, pose in zip(meshes, poses, strict=True)]
    )


def _primitive(kind: str, size: tuple[float, ...]) -> trimesh.Trimesh:
    """A mesh of MuJoCo's primitive, centred, long axis z."""
    if kind == "box":
        return trimesh.creation.box(2 * np.array(size))
    if kind == "sphere":
        return trimesh.creation.icosphere(radius=size[0])
    if kind == "cylinder":
        return trimesh.creation.cylinder(radius=size[0], height=2 * size[1])
    capsule = trimesh.creation.capsule(radius=size[0], height=2 * size[1], count=[24, 24])
    return capsule.apply_translation(-capsule.bounds.mean(axis=0))
