import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffhnet.errors import ObjectError, OptionError
from ffhnet.objects.units import (
    EXTENT_RANGE,
    HOUSEHOLD_RANGE,
    UNITS,
    WrongUnitError,
    check_scale,
    likely_scales,
    metres_per_unit,
)

PATH = Path("tea.obj")
household = st.floats(HOUSEHOLD_RANGE[0] * 1.0001, HOUSEHOLD_RANGE[1] * 0.9999)


def sides(longest: float) -> np.ndarray:
    return longest * np.array([0.5, 1.0, 0.3])


@given(household, st.sampled_from(sorted(UNITS)))
def test_auto_finds_the_unit_or_says_that_two_fit(longest, unit):
    if 30 <= longest / unit <= 50:
        # A small thing in millimetres or a large one in centimetres.
        with pytest.raises(ObjectError, match=r"--scale 0.01\b.*--scale 0.001\b"):
            metres_per_unit(sides(longest / unit), "auto", PATH)
    else:
        assert metres_per_unit(sides(longest / unit), "auto", PATH) == unit


@given(household, st.sampled_from([0.01, 0.001]))
def test_a_wrong_unit_is_never_taken_for_metres_and_the_right_one_is_named(longest, unit):
    with pytest.raises(ObjectError, match=r"wanted an object of .* to 2.0 m") as caught:
        metres_per_unit(sides(longest / unit), 1.0, PATH)
    if isinstance(caught.value, WrongUnitError):
        assert caught.value.scale == unit
        assert f"{UNITS[unit]}, give --scale {unit:g}" in str(caught.value)
        assert metres_per_unit(sides(longest / unit), caught.value.scale, PATH) == unit
    else:
        assert 30 <= longest / unit <= 50


@given(household, st.sampled_from([0.01, 0.001]))
def test_a_scale_for_a_mesh_in_metres_is_refused_or_leaves_it_tiny(longest, scale):
    if longest * scale < EXTENT_RANGE[0]:
        with pytest.raises(WrongUnitError, match=r"in metres, give --scale 1$"):
            metres_per_unit(np.full(3, longest), scale, PATH)
    else:
        assert metres_per_unit(np.full(3, longest), scale, PATH) * longest <= 0.005


@given(st.floats(1e-6, 1e6))
def test_a_likely_scale_gives_a_household_size(longest):
    for scale in likely_scales(longest):
        assert HOUSEHOLD_RANGE[0] <= longest * scale <= HOUSEHOLD_RANGE[1]
    assert len(likely_scales(longest)) <= 2


@pytest.mark.parametrize("longest", [1e-5, 0.01, 0.7, 1e4])
def test_auto_refuses_sizes_of_no_unit(longest):
    with pytest.raises(ObjectError, match=r"no unit would be likely: give its scale"):
        metres_per_unit(sides(longest), "auto", PATH)


@pytest.mark.parametrize("scale", [0.0, -0.001, float("nan"), float("inf")])
def test_scales_that_are_not_positive_are_refused(scale):
    with pytest.raises(OptionError, match="positive number"):
        check_scale(scale)


def test_the_error_survives_the_way_from_another_process():
    error = pickle.loads(pickle.dumps(WrongUnitError("in millimetres", 0.001)))
    assert (str(error), error.scale) == ("in millimetres", 0.001)
