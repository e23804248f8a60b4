"""Reading a user's capture: point clouds and depth images, with one clear line for every failure."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float
from PIL import Image

from ffhnet.array_files import MAX_BYTES, check_arrays, check_size
from ffhnet.errors import CloudError, InputFileError
from ffhnet.files import reading
from ffhnet.perception.cloud import validate_cloud

CLOUD_TYPES = (".ply", ".pcd", ".npy", ".npz")
DEPTH_TYPES = (".png", ".npy", ".npz")

_CLOUD_KEYS = ("cloud", "points", "xyz", "pc")
_DEPTH_KEYS = ("depth",)

_MAX_COLUMNS = 16
"""A two-dimensional array with more columns is an image, not a list of points."""

_MAX_DEPTH = 20.0
"""m: no depth camera for tables reaches further; millimetres given as metres do."""

_MAX_PIXELS = 2**24
"""Of an image: 4096 x 4096. Larger ones are written to fill the memory."""

_MAX_COUNT = 4096
"""Numbers of one point of a PCD: descriptors have hundreds."""


def read_cloud(path: str | Path) -> Float[np.ndarray, "N 3"]:
    """The finite points (m) of a `.ply`, `.pcd`, `.npy` or `.npz` file.

    Arrays are N×3, or H×W×3, with more columns allowed; an `.npz` holds one under "cloud", "points",
    "xyz" or "pc", or as its only array.

    Raises:
        InputFileError: the file is missing, damaged, or not a cloud.
        CloudError: the points cannot be used (`validate_cloud`).
    """
    path = _existing(path, CLOUD_TYPES, "a point cloud")
    suffix = path.suffix.lower()
    if suffix in (".npy", ".npz"):
        with reading(path, "a NumPy file"):
            points = _read_array(path, _CLOUD_KEYS)
        if points.ndim == 2 and points.shape[1] > _MAX_COLUMNS:
            raise InputFileError(
                f"{path}: wanted points of shape (N, 3), got {points.shape}: a depth image wants intrinsics"
            )
    else:
        with reading(path, "a point cloud"):
            points = _read_ply(path) if suffix == ".ply" else _read_pcd(path)
    try:
        return validate_cloud(points)
    except CloudError as error:
        raise CloudError(f"{path}: {error}") from None


def read_depth(path: str | Path, depth_scale: float | None = None) -> Float[np.ndarray, "H W"]:
    """A depth image in metres, 0 = no reading, from a 16-bit `.png`, a `.npy` or an `.npz` ("depth").

    Args:
        path: the file.
        depth_scale: metres per unit. If none: 0.001 for integers, which most cameras write, 1 for floats.

    Raises:
        InputFileError: the file is missing, damaged, not a depth image, or without any reading.
    """
    path = _existing(path, DEPTH_TYPES, "a depth image")
    with reading(path, "a depth image"):
        raw = _read_png(path) if path.suffix.lower() == ".png" else _read_array(path, _DEPTH_KEYS)
    check_pixels(path, raw.size)
    if raw.ndim == 3 and raw.shape[2] == 1:
        raw = raw[:, :, 0]
    if raw.ndim != 2 or raw.shape[1] <= _MAX_COLUMNS:
        raise InputFileError(f"{path}: a depth image must have shape (H, W), got {raw.shape}")
    if raw.dtype in (np.uint8, np.int8, np.bool_):
        raise InputFileError(f"{path}: a depth image must have 16 bits per pixel, got {raw.dtype}")
    if not np.issubdtype(raw.dtype, np.number) or np.issubdtype(raw.dtype, np.complexfloating):
        raise InputFileError(f"{path}: a depth image must hold numbers, got {raw.dtype}")
    if depth_scale is None:
        depth_scale = 0.001 if np.issubdtype(raw.dtype, np.integer) else 1.0
    if not (np.isfinite(depth_scale) and depth_scale > 0):
        raise InputFileError(f"{path}: the depth scale must be positive metres per unit, got {depth_scale}")
    depth = raw.astype(float) * depth_scale
    depth[~np.isfinite(depth) | (depth < 0)] = 0.0
    readings = depth[depth > 0]
    if readings.size == 0:
        raise InputFileError(f"{path}: the depth image has no reading: all pixels are 0 or not finite")
    median = float(np.median(readings))
    if median > _MAX_DEPTH or median < 0.02:
        raise InputFileError(
            f"{path}: the median depth would be {median:.4g} m with depth scale {depth_scale:g}: "
            "give another scale"
        )
    return depth


def check_pixels(path: Path, pixels: int) -> None:
    """Raises InputFileError where an image has more pixels than a depth camera."""
    if pixels > _MAX_PIXELS:
        raise InputFileError(f"{path}: wanted an image of at most {_MAX_PIXELS} pixels, got {pixels}")


def _existing(path: str | Path, types: tuple[str, ...], what: str) -> Path:
    """The path, if there is a file of a known type that is not empty."""
    path = Path(path)
    if not path.is_file():
        raise InputFileError(f"{path}: no such file")
    if path.suffix.lower() not in types:
        raise InputFileError(f"{path}: {what} must be one of {', '.join(types)}, got '{path.suffix}'")
    if path.stat().st_size == 0:
        raise InputFileError(f"{path}: the file is empty")
    check_size(path)
    return path


def _read_ply(path: Path) -> np.ndarray:
    with path.open("rb") as file:
        if file.read(3) != b"ply":
            raise InputFileError(f"{path}: not a PLY file: it does not begin with 'ply'")
        promised = _promised_vertices(file)
    import trimesh  # here, because it takes long

    loaded = trimesh.load(path, file_type="ply", process=False)
    return _complete(path, np.asarray(loaded.vertices), promised)


def _promised_vertices(file: BinaryIO) -> int:
    """Number of vertices that a PLY header announces."""
    for line in file:
        words = line.split()
        if words[:2] == [b"element", b"vertex"]:
            return int(words[2])
        if words[:1] == [b"end_header"]:
            break
    return 0


def _complete(path: Path, points: np.ndarray, promised: int) -> np.ndarray:
    """The points, if there are as many as the header promised: a file cut between two points is still cut."""
    if len(points) != promised:
        raise InputFileError(f"{path}: truncated: the header promises {promised} points, got {len(points)}")
    return points


def _read_pcd(path: Path) -> np.ndarray:
    from pypcd4 import MetaData, PointCloud  # here, because it takes long

    with path.open("rb") as file:
        header = MetaData.parse_header(_pcd_header(file))
        # The library makes a column for each number of a point, in a loop, before it reads any.
        row = sum(header.count)
        if row > _MAX_COUNT or row * header.points > MAX_BYTES:
            raise InputFileError(f"{path}: {header.points} points of {row} numbers are too many for a cloud")
        file.seek(0)
        cloud = PointCloud.from_fileobj(file)
    missing = {"x", "y", "z"} - set(cloud.fields)
    if missing:
        raise InputFileError(
            f"{path}: a cloud must have the fields x, y and z, got {', '.join(cloud.fields)}"
        )
    return _complete(path, cloud.numpy(("x", "y", "z")), cloud.metadata.points)


def _pcd_header(file: BinaryIO) -> list[str]:
    """The lines of a PCD up to the one that says how its data are written."""
    lines: list[str] = []
    for line in file:
        lines.append(line.decode().strip())
        if lines[-1].startswith("DATA"):
            break
    return lines


def _read_png(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        if image.format != "PNG":
            raise InputFileError(f"{path}: not a PNG image, but {image.format}")
        # Pillow opens 16-bit grey images as "I;16" or, in older versions, as 32-bit "I".
        if not image.mode.startswith("I"):
            raise InputFileError(
                f"{path}: a depth image must have one channel of 16 bits, "
                f"got 8 bits per channel (mode '{image.mode}')"
            )
        check_pixels(path, image.width * image.height)
        return np.asarray(image)


def _read_array(path: Path, keys: tuple[str, ...]) -> np.ndarray:
    """The array of an `.npy` file, or of an `.npz` file under one of the keys; never unpickles."""

    if path.suffix.lower() == ".npz":
        check_arrays(path)
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return loaded
    with loaded:
        names = loaded.files
        known = [key for key in keys if key in names] or (names if len(names) == 1 else [])
        if not known:
            raise InputFileError(f"{path}: wanted an array named {' or '.join(keys)}, got {', '.join(names)}")
        return loaded[known[0]]
