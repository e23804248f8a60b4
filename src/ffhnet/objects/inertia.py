"""Mass, centre of mass and inertia of a set of convex pieces of one density."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.objects.grasp_object import DENSITY, MASS_RANGE, GraspObject


class MassProperties(NamedTuple):
    """Mass and its distribution, in the object's frame.

    Attributes:
        mass: kg.
        centre: centre of mass, metres.
        inertia: about the centre of mass, kg m², axes of the object's frame.
    """

    mass: float
    centre: Float[np.ndarray, " 3"]
    inertia: Float[np.ndarray, "3 3"]


def piece_properties(pieces: Sequence[trimesh.Trimesh]) -> MassProperties:
    """Properties at a density of 1 kg/m³, so that `mass` is the volume in m³.

    The integrals over closed outward meshes add up, so all triangles are integrated at once.
    """
    triangles = np.concatenate([piece.vertices[piece.faces] for piece in pieces])
    found = trimesh.triangles.mass_properties(triangles, density=1.0)
    return MassProperties(float(found.mass), found.center_mass, found.inertia)


def default_mass(volume: float) -> float:
    """Mass in kg of an object of this volume in m³: `DENSITY` × volume, clipped to `MASS_RANGE`."""
    return float(np.clip(DENSITY * volume, *MASS_RANGE))


def inertia(obj: GraspObject) -> MassProperties:
    """Properties of an object whose mass is spread evenly over the volume of its pieces."""
    unit = piece_properties(obj.pieces)
    return MassProperties(obj.mass, unit.centre, unit.inertia * (obj.mass / unit.mass))
