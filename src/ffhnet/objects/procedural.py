"""Procedural objects: a seed gives an object, and disjoint ranges of seeds give collections and splits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import trimesh

from ffhnet.errors import ObjectError
from ffhnet.objects import packages, tableware, tools, toys, trinkets, vessels
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.inertia import default_mass, piece_properties
from ffhnet.objects.resting import resting_poses

Split = Literal["train", "val", "test"]

Collection = Literal["procedural", "varied", "awkward"]
"""Packages and vessels that stand, as in a cupboard; everything else: tableware, tools and toys; and of the
latter, with small and flat things, those that are hard to grasp."""

SPLIT_SIZE = 1_000_000
"""Seeds per split, so that the splits never meet."""

FIRST_SEED: dict[str, int] = {
    f"{collection}-{split}": (3 * i + k) * SPLIT_SIZE
    for i, collection in enumerate(get_args(Collection))
    for k, split in enumerate(get_args(Split))
}
"""First seed of each split: "procedural-train", "procedural-val", …, "varied-test"."""


@dataclass(frozen=True)
class Family:
    """A kind of object.

    Attributes:
        draw: draws the convex pieces of one object, metres, z up.
        weight: relative frequency.
    """

    draw: Callable[[np.random.Generator], list[trimesh.Trimesh]]
    weight: float


PROCEDURAL: dict[str, Family] = {
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

VARIED: dict[str, Family] = {
    "plate": Family(tableware.plate, 4),
    "wide_bowl": Family(tableware.wide_bowl, 7),
    "pan": Family(tableware.pan, 5),
    "pitcher": Family(tableware.pitcher, 8),
    "teapot": Family(tableware.teapot, 6),
    "stemmed_glass": Family(tableware.stemmed_glass, 4),
    "hammer": Family(tools.hammer, 5),
    "screwdriver": Family(tools.screwdriver, 5),
    "wrench": Family(tools.wrench, 4),
    "pliers": Family(tools.pliers, 4),
    "ladle": Family(tools.ladle, 4),
    "power_tool": Family(tools.power_tool, 6),
    "torch": Family(tools.torch, 4),
    "device": Family(tools.device, 5),
    "stapler": Family(tools.stapler, 3),
    "shoe": Family(tools.shoe, 8),
    "quadruped": Family(toys.quadruped, 5),
    "bird": Family(toys.bird, 6),
    "aircraft": Family(toys.aircraft, 6),
    "vehicle": Family(toys.vehicle, 6),
    "ring": Family(toys.ring, 5),
    "basket": Family(toys.basket, 4),
    "composite": Family(toys.composite, 14),
}
"""Wide, flat, long, lying and branching things, of which the other collection has few. The hand cannot grasp
some of them (`graspability.why_not_graspable`), as in any set of real objects."""

AWKWARD: dict[str, Family] = {
    "marble": Family(trinkets.marble, 5),
    "toy_block": Family(trinkets.toy_block, 8),
    "brick": Family(trinkets.brick, 6),
    "pyramid": Family(trinkets.pyramid, 4),
    "cutlery": Family(trinkets.cutlery, 8),
    **{
        name: Family(VARIED[name].draw, weight)
        for name, weight in {
            "plate": 7, "wide_bowl": 4, "pan": 10, "pitcher": 5, "teapot": 6, "hammer": 9, "screwdriver": 5,
            "wrench": 6, "pliers": 6, "ladle": 5, "power_tool": 6, "aircraft": 10, "ring": 7,
        }.items()
    },
}  # fmt: skip
"""Small, flat and thin things, on which most samples of generators trained on the other two fail."""

_FAMILIES: dict[Collection, dict[str, Family]] = {
    "procedural": PROCEDURAL,
    "varied": VARIED,
    "awkward": AWKWARD,
}

FAMILIES = PROCEDURAL | VARIED | AWKWARD
"""All families by name."""


def make_object(seed: int) -> GraspObject:
    """Procedural object of a seed; the same seed always gives the same object.

    Raises:
        ObjectError: the seed is negative.
    """
    rng = _generator(seed)
    family = _draw_family(seed, rng)
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
    return f"{_draw_family(seed, _generator(seed))}_{seed:06d}"


def seed_of(name: str) -> int:
    """Seed of a procedural object's name, the inverse of `object_name`.

    Raises:
        ObjectError: no procedural object has this name.
    """
    digits = name.rpartition("_")[2]
    if not (digits.isascii() and digits.isdigit()) or object_name(int(digits)) != name:
        raise ObjectError(f"wanted the name of a procedural object such as {object_name(123)}, got {name!r}")
    return int(digits)


def split_seeds(split: str, count: int) -> list[int]:
    """Seeds of the first `count` objects of a split such as "procedural-test"; splits share no seed.

    Raises:
        ObjectError: an unknown split, or more objects than a split holds.
    """
    if split not in FIRST_SEED:
        raise ObjectError(f"wanted a split out of {', '.join(FIRST_SEED)}, got {split!r}")
    if not 0 < count <= SPLIT_SIZE:
        raise ObjectError(f"wanted 1 to {SPLIT_SIZE} objects of a split, got {count}")
    return list(range(FIRST_SEED[split], FIRST_SEED[split] + count))


def _generator(seed: int) -> np.random.Generator:
    if seed < 0:
        raise ObjectError(f"wanted a seed of 0 or more, got {seed}")
    return np.random.default_rng(seed)


def _draw_family(seed: int, rng: np.random.Generator) -> str:
    collections = list(_FAMILIES.values())
    families = collections[min(seed // (3 * SPLIT_SIZE), len(collections) - 1)]
    weights = np.array([family.weight for family in families.values()])
    return str(rng.choice(list(families), p=weights / weights.sum()))


def _grounded(pieces: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Pieces moved so that the lowest point is z = 0 exactly."""
    lowest = min(piece.vertices[:, 2].min() for piece in pieces)
    if lowest != 0.0:
        for piece in pieces:
            piece.vertices[:, 2] -= lowest
    return pieces
