"""What a camera's ROS messages hold, as arrays. Nothing here needs ROS: any object with the fields will do.

A message comes from another program, perhaps over a bad network: nothing it says about itself is believed
before it was compared with the bytes that came.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float

from ffhnet.errors import MessageError
from ffhnet.perception.camera import Intrinsics

POINT_TYPES = {7: "f4", 8: "f8"}
"""Numbers that `sensor_msgs/PointField` gives to float32 and float64."""

DEPTH_ENCODINGS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}
"""Type of a pixel and metres per unit (REP 118)."""


class PointField(Protocol):
    """`sensor_msgs/PointField`."""

    name: str
    offset: int
    datatype: int
    count: int


class PointCloud2(Protocol):
    """`sensor_msgs/PointCloud2`."""

    height: int
    width: int
    fields: Sequence[Any]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: Any


class Image(Protocol):
    """`sensor_msgs/Image`."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: Any


class CameraInfo(Protocol):
    """`sensor_msgs/CameraInfo`."""

    height: int
    width: int
    k: Any
    roi: Any


def cloud_from_message(message: PointCloud2) -> Float[np.ndarray, "N 3"]:
    """The points (m, in the message's frame) in their order, those without a reading (NaN) too.

    Raises:
        MessageError: no x, y or z of floats, or sizes that do not fit each other or the data.
    """
    order = ">" if message.is_bigendian else "<"
    fields = {field.name: field for field in message.fields}
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise MessageError(f"a cloud must have the fields x, y and z, got {', '.join(fields) or 'none'}")
    xyz = [fields[name] for name in "xyz"]
    for field in xyz:
        if field.datatype not in POINT_TYPES or field.count != 1:
            raise MessageError(
                f"field {field.name!r} must be one float32 (7) or float64 (8), "
                f"got {field.count} of type {field.datatype}"
            )
    types = [np.dtype(order + POINT_TYPES[field.datatype]) for field in xyz]
    end = max(field.offset + kind.itemsize for field, kind in zip(xyz, types, strict=True))
    if end > message.point_step:
        raise MessageError(f"x, y and z end at byte {end} of a point, but point_step is {message.point_step}")
    shape, strides = (message.height, message.width), (message.row_step, message.point_step)
    data = _checked(message.data, shape, strides)
    if data.nbytes == 0:
        return np.zeros((0, 3))
    columns = [
        np.ndarray(shape, kind, data, offset=field.offset, strides=strides)
        for field, kind in zip(xyz, types, strict=True)
    ]
    return np.stack([column.ravel().astype(float) for column in columns], axis=1)


def depth_from_message(message: Image, depth_scale: float | None = None) -> Float[np.ndarray, "H W"]:
    """A depth image in metres; 0, NaN and infinity mean no reading.

    Args:
        message: encoded as 16UC1, mono16 or 32FC1.
        depth_scale: metres per unit; None takes millimetres for integers and metres for floats (REP 118).

    Raises:
        MessageError: another encoding, or sizes that do not fit each other or the data.
    """
    if message.encoding not in DEPTH_ENCODINGS:
        raise MessageError(
            f"a depth image must be encoded as {', '.join(DEPTH_ENCODINGS)}, got {message.encoding!r}"
        )
    kind, usual_scale = DEPTH_ENCODINGS[message.encoding]
    pixel = np.dtype((">" if message.is_bigendian else "<") + kind)
    shape, strides = (message.height, message.width), (message.step, pixel.itemsize)
    pixels = np.ndarray(shape, pixel, _checked(message.data, shape, strides), strides=strides)
    return pixels.astype(float) * (usual_scale if depth_scale is None else depth_scale)


def intrinsics_from_message(message: CameraInfo) -> Intrinsics:
    """The pinhole of a camera; its distortion is not used.

    Raises:
        MessageError: an uncalibrated camera (zeros), or one of which only a part is read out.
        OptionError: focal lengths that are not positive and finite.
    """
    roi = message.roi
    part = (roi.x_offset, roi.y_offset, roi.width or message.width, roi.height or message.height)
    if part != (0, 0, message.width, message.height):
        raise MessageError(f"the whole image of a camera is wanted, got the region {part}")
    k = [float(value) for value in message.k]
    if len(k) != 9 or k[0] == 0 or k[4] == 0:
        raise MessageError("the camera is not calibrated: fx and fy of its CameraInfo are 0")
    return Intrinsics(fx=k[0], fy=k[4], cx=k[2], cy=k[5], width=message.width, height=message.height)


def _checked(data: Any, shape: tuple[int, int], strides: tuple[int, int]) -> memoryview:
    """The bytes of rows of items; raises MessageError where there are not as many as the sizes say."""
    (height, width), (row, item) = shape, strides
    view = memoryview(data).cast("B")
    if height > 0 and width * item > row:
        raise MessageError(f"{width} items of {item} bytes do not fit into a row of {row} bytes")
    if height * row != view.nbytes:
        raise MessageError(f"{height} rows of {row} bytes are {height * row} bytes, got {view.nbytes}")
    return view
