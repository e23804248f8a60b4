"""Procedural household objects: a seed gives an object, and disjoint ranges of seeds give the splits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh

from ffhnet.errors import ObjectError
from ffhnet.objects import packages, vessels
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.inertia import default_mass, piece_properties
from ffhnet.objects.resting import resting_poses

Split = Literal["train", "val", "test"]

SPLIT_SIZE = 1_000_000
"""Seeds per split, so that the splits never meet."""

FIRST_SEED: dict[Split, int] = {"train": 0, "val": SPLIT_SIZE, "test": 2 * SPLIT_SIZE}
"""First seed of each split."""


@dataclass(frozen=True)
class Family:
    """A kind of object.

    Attributes:
        draw: draws the convex pieces of one object, metres, z up.
        weight: relative frequency.
    """

    draw: Callable[[np.random.Generator], list[trimesh.Trimesh]]
    weight: float


FAMILIES: dict[str, Family] = {
    "box": Family(packages.box, 12),
    "thin_box": Family(packages.thin_box, 12),
    "milk_carton": Family(packages.milk_carton, 4),
    "pouch": Family(packages.pouch, 6),
    "tube": Family(packages.tube, 5),
    "prism": Family(packages.prism, 4),
    "rounded_block": Family(packages.rounded_block, 5),
    "fruit": Family(packages.fruit, 5),
    "can": Family(vessels.can, 10),
    "stick": Family(vessels.stick, 6),
    "bottle": Family(vessels.bottle, 9),
    "detergent": Family(vessels.detergent, 8),
    "jar": Family(vessels.jar, 6),
    "spray_flask": Family(vessels.spray_flask, 6),
    "cup": Family(vessels.cup, 6),
    "bowl": Family(vessels.bowl, 2),
    "pot": Family(vessels.pot, 4),
}
"""Boxes and cylinders lead, as they do in a kitchen cupboard and in the KIT and BigBIRD object sets."""


def make_object(seed: int) -> GraspObject:
    """Procedural object of a seed; the same seed always gives the same object.

    Raises:
        ObjectError: the seed is negative.
    """
    rng = _generator(seed)
    family = _draw_family(rng)
    pieces = _grounded(FAMILIES[family].draw(rng))
    poses = resting_poses(pieces)
    return GraspObject(
        name=f"{family}_{seed:06d}",
        family=family,
        visual=trimesh.util.concatenate(pieces),
        pieces=tuple(pieces),
        mass=default_mass(piece_properties(pieces).mass),
        resting_poses=np.stack([pose.T_world_object for pose in poses]),
        pose_names=tuple(pose.name for pose in poses),
    )


def object_name(seed: int) -> str:
    """Name of a seed's object, for example "bottle_000123", without building it.

    Raises:
        ObjectError: the seed is negative.
    """
    return f"{_draw_family(_generator(seed))}_{seed:06d}"


def seed_of(name: str) -> int:
    """Seed of a procedural object's name, the inverse of `object_name`.

    Raises:
        ObjectError: no procedural object has this name.
    """
    digits = name.rpartition("_")[2]
    if not (digits.isascii() and digits.isdigit()) or object_name(int(digits)) != name:
        raise ObjectError(f"wanted the name of a procedural object such as {object_name(123)}, got {name!r}")
    return int(digits)


def procedural_split(split: Split, count: int) -> list[int]:
    """Seeds of the first `count` objects of a split; splits share no seed.

    Raises:
        ObjectError: an unknown split, or more objects than a split holds.
    """
    if split not in FIRST_SEED:
        raise ObjectError(f"wanted a split out of {', '.join(FIRST_SEED)}, got {split!r}")
    if not 0 < count <= SPLIT_SIZE:
        raise ObjectError(f"wanted 1 to {SPLIT_SIZE} objects of a split, got {count}")
    return list(range(FIRST_SEED[split], FIRST_SEED[split] + count))


def object_names(split: Split, count: int) -> list[str]:
    """Names of the first `count` objects of a split.

    Raises:
        ObjectError: an unknown split, or more objects than a split holds.
    """
    return [object_name(seed) for seed in procedural_split(split, count)]


def _generator(seed: int) -> np.random.Generator:
    if seed < 0:
        raise ObjectError(f"wanted a seed of 0 or more, got {seed}")
    return np.random.default_rng(seed)


def _draw_family(rng: np.random.Generator) -> str:
    weights = np.array([family.weight for family in FAMILIES.values()])
    return str(rng.choice(list(FAMILIES), p=weights / weights.sum()))


def _grounded(pieces: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Pieces moved so that the lowest point is z = 0 exactly."""
    lowest = min(piece.vertices[:, 2].min() for piece in pieces)
    if lowest != 0.0:
        for piece in pieces:
            piece.vertices[:, 2] -= lowest
    return pieces
