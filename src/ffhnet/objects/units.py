"""The unit of a mesh file, judged from the size that a household object can have."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from ffhnet.errors import ObjectError, OptionError

UNITS: dict[float, str] = {1.0: "metres", 0.01: "centimetres", 0.001: "millimetres"}
"""Metres per unit that mesh files come in."""

HOUSEHOLD_RANGE = (0.03, 0.5)
"""m: longest side of the bounding box of household objects; the YCB marble has 0.035, its hammer 0.33."""

EXTENT_RANGE = (0.001, 2.0)
"""m: every side of the bounding box of something that a hand can be asked to grasp."""

Scale = float | Literal["auto"]
"""Metres per unit of a file; "auto" finds it from the size."""


class WrongUnitError(ObjectError):
    """A mesh has no likely size in metres, but it has in one other unit.

    Attributes:
        scale: metres per unit that would give the likely size.
    """

    def __init__(self, message: str, scale: float) -> None:
        super().__init__(message)
        self.scale = scale

    def __reduce__(self) -> tuple[type[WrongUnitError], tuple[str, float]]:
        return type(self), (str(self), self.scale)


def likely_scales(longest: float) -> list[float]:
    """Metres per unit at which a longest side (in the file's unit) is that of a household object."""
    low, high = HOUSEHOLD_RANGE
    return [scale for scale in UNITS if low <= longest * scale <= high]


def check_scale(scale: Scale) -> None:
    """Make sure that a scale can be applied.

    Raises:
        OptionError: it is not a positive number.
    """
    if scale != "auto" and not (np.isfinite(scale) and scale > 0):
        raise OptionError(f"wanted a positive number of metres per unit as scale, got {scale}")


def metres_per_unit(extents: Float[np.ndarray, " 3"], scale: Scale, path: Path) -> float:
    """The scale to apply to a mesh, after checking that it leads to the size of an object.

    Args:
        extents: sides of the bounding box in the file's unit.
        scale: metres per unit as the user says; "auto" takes the only one of `UNITS` that fits.
        path: of the mesh, for the message.

    Raises:
        WrongUnitError: too large or too small with this scale, and of a likely size in exactly one unit.
        OptionError: the scale is not a positive number.
        ObjectError: too large, too small or too flat; or no or two units fit where one was to be found.
    """
    check_scale(scale)
    likely = likely_scales(float(extents.max()))
    if scale == "auto":
        if len(likely) != 1:
            fitting = " and ".join(f"{UNITS[s]} (--scale {s:g})" for s in likely) or "no unit"
            raise ObjectError(
                f"wanted a mesh whose size tells its unit, {path} is {_size(extents)} units, for which "
                f"{fitting} would be likely: give its scale"
            )
        scale = likely[0]
    _check_size(extents * scale, likely[0] if len(likely) == 1 else None, path)
    return scale


def _check_size(sides: Float[np.ndarray, " 3"], better: float | None, path: Path) -> None:
    low, high = EXTENT_RANGE
    if low <= sides.max() <= high:
        if sides.min() < low:
            raise ObjectError(
                f"wanted a solid of at least {low} m in every direction, {path} is {_size(sides)} m"
            )
        return
    problem = f"wanted an object of {low} to {high} m, {path} is {_size(sides)} m"
    if better is None:
        raise ObjectError(f"{problem}: in which unit is it?")
    raise WrongUnitError(f"{problem}: it seems to be in {UNITS[better]}, give --scale {better:g}", better)


def _size(sides: Float[np.ndarray, " 3"]) -> str:
    return " x ".join(f"{side:.4g}" for side in sides)
