"""`GraspObject`: what the camera sees, what the physics collides with, and what it weighs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

DENSITY = 500.0
"""kg/m³: filled household packages lie between 200 (cereal) and 1000 (drinks)."""

MASS_RANGE = (0.05, 0.4)
"""kg: the mass of density × volume is clipped to what one hand of this size lifts with ease."""


@dataclass(frozen=True)
class GraspObject:
    """A rigid object in its own frame (metres, z up, resting on z = 0 as modelled).

    Attributes:
        name: unique name.
        family: for example "bottle", or "scan" for an imported mesh.
        visual: the surface that a camera sees.
        pieces: convex pieces (closed meshes in the same frame) whose union is the collision shape;
            pieces touch but do not overlap, so that mass and inertia add up.
        mass: kg.
        resting_poses: T_world_object for each stable pose on the table z = 0, most natural first,
            with the object's centre of mass above the world origin.
        pose_names: "standing" or "lying_K" for each resting pose.
    """

    name: str
    family: str
    visual: trimesh.Trimesh
    pieces: tuple[trimesh.Trimesh, ...]
    mass: float
    resting_poses: Float[np.ndarray, "P 4 4"]
    pose_names: tuple[str, ...]
