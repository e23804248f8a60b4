"""Messages as plain objects: what reads them needs no ROS."""

from types import SimpleNamespace

import numpy as np


def cloud_message(points, order="<", kind="f4", offsets=(0, 4, 8), point_step=16, padding=0, height=1):
    """A well-formed PointCloud2 of N×3 points, with bytes between the fields and after the rows."""
    width = len(points) // height
    kind = np.dtype(order + kind)
    point = np.dtype(
        {"names": "xyz", "formats": [kind] * 3, "offsets": offsets, "itemsize": point_step}, align=False
    )
    packed = np.zeros((height, width), point)
    for i, name in enumerate("xyz"):
        packed[name] = points[:, i].reshape(height, width)
    rows = [row.tobytes() + bytes(padding) for row in packed]
    number = {4: 7, 8: 8}[kind.itemsize]
    return SimpleNamespace(
        height=height,
        width=width,
        fields=[
            SimpleNamespace(name=name, offset=offset, datatype=number, count=1)
            for name, offset in zip("xyz", offsets, strict=True)
        ],
        is_bigendian=order == ">",
        point_step=point_step,
        row_step=width * point_step + padding,
        data=b"".join(rows),
    )


def image_message(pixels, encoding, order="<", padding=0):
    """A well-formed Image of H×W pixels, with bytes after the rows."""
    packed = pixels.astype(pixels.dtype.newbyteorder(order))
    height, width = pixels.shape
    return SimpleNamespace(
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=int(order == ">"),
        step=width * pixels.itemsize + padding,
        data=b"".join(row.tobytes() + bytes(padding) for row in packed),
    )


def camera_message(width=640, height=480, k=(615.0, 0, 320.0, 0, 610.0, 240.0, 0, 0, 1), roi=(0, 0, 0, 0)):
    """A CameraInfo."""
    names = ("x_offset", "y_offset", "width", "height")
    return SimpleNamespace(
        width=width, height=height, k=np.array(k), roi=SimpleNamespace(**dict(zip(names, roi, strict=True)))
    )
