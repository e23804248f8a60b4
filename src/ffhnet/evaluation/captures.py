"""Real depth captures on disk: what the sensor gave, and the meshes that were registered to it.

A capture is a folder with `meta.json` and either `depth.png`, whose intrinsics are `K`, or `cloud.ply`;
beside the depth there may be a `mask.png` of object numbers. An object of known shape is named in
`meta.json` with its pose `T_camera_mesh`, or `T_cloud_mesh` where the cloud is an object already cut out.
Meshes rest on z = 0 of their files, which are named relative to the folder that holds the groups' folder.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from PIL import Image

from ffhnet.errors import InputFileError, OptionError
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.capture import read_cloud, read_depth
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.observation import Observation, observe_object, observe_objects, observe_scene

_TABLE_IN_MASK = "1 = table"
"""What `mask_origin` says where the number 1 of a mask is the table; else it is an object."""


@dataclass(frozen=True)
class RegisteredMesh:
    """An object whose shape and pose are known.

    Attributes:
        name: the mesh file's stem.
        path: the mesh file (m).
        T_input_mesh: its pose in the capture's frame.
        number: of the object in the mask, or None.
    """

    name: str
    path: Path
    T_input_mesh: Float[np.ndarray, "4 4"]
    number: int | None


@dataclass(frozen=True)
class Capture:
    """One real capture.

    Attributes:
        name: "group/name".
        cloud: all readings (m), in the camera's frame.
        intrinsics: of a depth image, None for a cloud.
        numbers: for each point the number of its object in the mask (0 = background), None without a mask.
        objects: the numbers that objects have in the mask.
        cut_out: whether the cloud is one object without its scene.
        registered: the objects whose poses are known.
    """

    name: str
    cloud: Float[np.ndarray, "N 3"]
    intrinsics: Intrinsics | None
    numbers: Int[np.ndarray, " N"] | None
    objects: tuple[int, ...]
    cut_out: bool
    registered: tuple[RegisteredMesh, ...]

    def observe(self, seed: int = 0) -> list[Observation]:
        """All objects that are found without the mask, the main one first.

        Raises:
            CloudError, SceneError: nothing can be observed.
        """
        if self.cut_out:
            # Such clouds come without their scene: up is known from the registered mesh only.
            return [observe_object(self.cloud, self.registered[0].T_input_mesh[:3, 2], "camera")]
        return observe_objects(self.cloud, np.random.default_rng(seed))

    def observe_masked(self, number: int, seed: int = 0) -> Observation:
        """The object of that number in the mask.

        Raises:
            OptionError: there is no mask.
            SceneError: no table, or too few points of the mask.
        """
        if self.numbers is None:
            raise OptionError(f"{self.name} has no mask")
        return observe_scene(self.cloud, np.random.default_rng(seed), mask=self.numbers == number)


def find_captures(folder: Path) -> list[Path]:
    """Folders of the captures GROUP/NAME in a folder, by name.

    Raises:
        InputFileError: there is none.
    """
    found = sorted(meta.parent for meta in folder.glob("*/*/meta.json"))
    if not found:
        raise InputFileError(f"{folder}: wanted captures in GROUP/NAME/meta.json, found none")
    return found


def read_capture(folder: Path) -> Capture:
    """The capture in a folder.

    Raises:
        InputFileError: a file is missing or damaged.
    """
    meta = _read_meta(folder / "meta.json")
    intrinsics, numbers = None, None
    objects: tuple[int, ...] = ()
    if "K" in meta:
        depth = read_depth(folder / "depth.png", meta["depth_scale_m_per_unit"])
        (fx, _, cx), (_, fy, cy), _ = meta["K"]
        intrinsics = Intrinsics(fx, fy, cx, cy, width=depth.shape[1], height=depth.shape[0])
        cloud, pixels = depth_to_cloud(depth, intrinsics)
        if (folder / "mask.png").exists():
            with Image.open(folder / "mask.png") as mask:
                numbers = np.asarray(mask).ravel()[pixels].astype(int)
            first = 2 if _TABLE_IN_MASK in meta["mask_origin"] else 1
            objects = tuple(int(number) for number in np.unique(numbers) if number >= first)
    else:
        cloud = read_cloud(folder / "cloud.ply")
    return Capture(
        name=f"{folder.parent.name}/{folder.name}",
        cloud=cloud,
        intrinsics=intrinsics,
        numbers=numbers,
        objects=objects,
        cut_out="T_cloud_mesh" in meta,
        registered=tuple(_registered(meta, folder.parents[2])),
    )


def _read_meta(path: Path) -> dict[str, Any]:
    try:
        meta: dict[str, Any] = json.loads(path.read_text())
    except FileNotFoundError:
        raise InputFileError(f"{path}: no such file") from None
    except ValueError as error:
        raise InputFileError(f"{path}: not JSON ({error})") from None
    return meta


def _registered(meta: dict[str, Any], root: Path) -> Iterator[RegisteredMesh]:
    """Meshes with a pose: of the capture itself, or of the objects that it lists."""
    for item in (meta, *meta.get("objects", ())):
        pose = item.get("T_camera_mesh", item.get("T_cloud_mesh"))
        if pose is not None:
            path = root / item["mesh"]
            yield RegisteredMesh(path.stem, path, np.array(pose), item.get("label"))
