"""The view frame: the frame in which the networks see object and grasp."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ffhnet.errors import OptionError
from ffhnet.geometry.transforms import make_transform

_MIN_HORIZONTAL = np.sin(np.radians(2.0))
"""A viewing direction within 2° of the vertical has no usable horizontal part."""


def view_frame(
    cloud: Float[np.ndarray, "N 3"], up: Float[np.ndarray, " 3"], viewing_direction: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """T_input_view: origin at the cloud's mean, z = up, x = viewing direction projected on the table.

    A camera that looks straight down has no such projection. Then x is the input frame's -y: in the
    camera frame that is up in the image, to which the projection tends as a level camera tilts down.

    Args:
        cloud: visible points of the object (m) in the input frame.
        up: direction against gravity in the input frame, of any length.
        viewing_direction: from the camera to the object in the input frame, of any length.

    Raises:
        OptionError: a direction has no length or is not finite.
    """
    z = unit(up, "up direction")
    x = np.zeros(3)
    # -x comes last for the case that -y is itself vertical.
    for direction in (unit(viewing_direction, "viewing direction"), [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]):
        x = np.asarray(direction) - np.dot(direction, z) * z
        if np.linalg.norm(x) > _MIN_HORIZONTAL:
            break
    x /= np.linalg.norm(x)
    return make_transform(
        np.column_stack([x, np.cross(z, x), z]), np.asarray(cloud, dtype=float).mean(axis=0)
    )


def unit(vector: Float[np.ndarray, " 3"], name: str) -> Float[np.ndarray, " 3"]:
    """The vector at length 1; `name` is for the message.

    Raises:
        OptionError: not three finite numbers, or of no length.
    """
    vector = np.asarray(vector, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all() or np.linalg.norm(vector) < 1e-9:
        raise OptionError(f"the {name} must be three finite numbers, not all zero, got {vector.tolist()}")
    return vector / np.linalg.norm(vector)
