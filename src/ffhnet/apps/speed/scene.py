"""What the benchmark looks at: a can of 7 x 16 cm on a table, from 0.7 m away, without noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth

INTRINSICS = REALSENSE_D415
RADIUS, HEIGHT = 0.035, 0.16
"""m"""


@cache
def depth_image() -> Float[np.ndarray, "480 640"]:
    """Metres along the optical axis."""
    can = trimesh.creation.cylinder(radius=RADIUS, height=HEIGHT)
    can.apply_translation([0, 0, HEIGHT / 2])
    return render_depth([can], look_at(np.array([-0.5, 0.1, 0.5]), np.array([0, 0, HEIGHT / 2])), INTRINSICS)


@cache
def visible_side(count: int) -> Float[np.ndarray, "count 3"]:
    """Random points (m, z up) on the side of the can that a camera at negative x sees; drawn but once."""
    rng = np.random.default_rng(count)
    angle, z = rng.uniform(-1.4, 1.4, count), rng.uniform(0, HEIGHT, count)
    return np.column_stack([-RADIUS * np.cos(angle), RADIUS * np.sin(angle), z])
