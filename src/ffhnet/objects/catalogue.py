"""From what a user names (`--objects NAME|DIR`) to objects, each built only when it is needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ffhnet.errors import ObjectError
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.layouts import find_meshes
from ffhnet.objects.procedural import FIRST_SEED, make_object, object_name, seed_of, split_seeds
from ffhnet.objects.scans import load_scan

DEFAULT_COUNT = 100
"""Objects of a procedural split where the user names no number."""


@dataclass(frozen=True)
class ObjectSource:
    """An object that is not built yet; can be sent to another process.

    Attributes:
        name: of the object.
        load: builds it; raises what `make_object` or `load_scan` raise.
    """

    name: str
    load: Callable[[], GraspObject]


def resolve_objects(spec: str, cache_dir: str | Path | None = None) -> list[ObjectSource]:
    """Objects that a specification names.

    Args:
        spec: "procedural-test", "varied-train" or another split, "procedural-test:20" for its first 20
            objects, the name of one procedural object ("bottle_000123"), a mesh file, or a folder of meshes;
            or several of these, separated by commas.
        cache_dir: where convex pieces of scans are kept, the user's cache folder if none.

    Raises:
        ObjectError: the specification names nothing.
        InputFileError: a folder without meshes.
    """
    path = Path(spec)
    if "," in spec and not path.exists():
        return [source for part in spec.split(",") for source in resolve_objects(part.strip(), cache_dir)]
    if spec.partition(":")[0] in FIRST_SEED:
        return [_procedural(seed) for seed in _split_seeds(spec)]
    # The path of an empty text is the working folder.
    if spec and path.is_dir():
        return [_scan(mesh.name, mesh.path, cache_dir) for mesh in find_meshes(path)]
    if path.is_file():
        return [_scan(path.stem, path, cache_dir)]
    try:
        return [_procedural(seed_of(spec))]
    except ObjectError:
        splits = ", ".join(f"{split}[:COUNT]" for split in FIRST_SEED)
        raise ObjectError(
            f"wanted {splits}, a name such as {object_name(123)}, a mesh file or a folder, got {spec!r}"
        ) from None


def _split_seeds(spec: str) -> list[int]:
    split, colon, count = spec.partition(":")
    if colon and not (count.isascii() and count.isdigit()):
        raise ObjectError(f"wanted a number of objects after the colon, got {spec!r}")
    return split_seeds(split, int(count) if colon else DEFAULT_COUNT)


def _procedural(seed: int) -> ObjectSource:
    return ObjectSource(object_name(seed), partial(make_object, seed))


def _scan(name: str, path: Path, cache_dir: str | Path | None) -> ObjectSource:
    return ObjectSource(name, partial(load_scan, path, cache_dir, name=name))
