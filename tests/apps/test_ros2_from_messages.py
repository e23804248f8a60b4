"""What a message says about itself is compared with its bytes before any of them is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2_stand_ins import camera_message, cloud_message, image_message

from ffhnet.apps.ros2.from_messages import cloud_from_message, depth_from_message, intrinsics_from_message
from ffhnet.errors import FFHNetError, MessageError
from ffhnet.perception.camera import Intrinsics

POINTS = np.random.default_rng(0).normal(size=(24, 3)).astype("f4")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("kind", "offsets", "step"), [("f4", (0, 4, 8), 12), ("f4", (8, 0, 20), 32),
                                                       ("f8", (1, 9, 17), 25)])  # fmt: skip
@pytest.mark.parametrize(("height", "padding"), [(1, 0), (4, 0), (4, 5)])
def test_points_come_out_as_they_went_in(order, kind, offsets, step, height, padding):
    message = cloud_message(POINTS, order, kind, offsets, step, padding, height)
    np.testing.assert_array_equal(cloud_from_message(message), POINTS)


def test_points_without_a_reading_stay_in_their_place():
    holes = POINTS.copy()
    holes[3] = np.nan
    np.testing.assert_array_equal(cloud_from_message(cloud_message(holes)), holes)


@pytest.mark.parametrize(("height", "width", "row_step"), [(0, 0, 0), (0, 5, 80), (5, 0, 0)])
def test_a_cloud_may_be_empty(height, width, row_step):
    message = cloud_message(POINTS[:0])
    message.height, message.width, message.row_step = height, width, row_step
    assert cloud_from_message(message).shape == (0, 3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point_step": 8}, ["point_step is 8"]),
        ({"point_step": 17}, ["do not fit"]),
        ({"width": 25}, ["do not fit"]),
        ({"height": 2}, ["got 384"]),
        ({"width": 2**32 - 1, "row_step": 2**32 - 1}, ["4294967295"]),
        ({"row_step": 400}, ["got 384"]),
        ({"data": b""}, ["got 0"]),
        ({"data": bytes(383)}, ["got 383"]),
        ({"fields": []}, ["none"]),
        ({"fields": cloud_message(POINTS).fields[:2]}, ["got x, y"]),
    ],
)
def test_a_cloud_that_contradicts_itself_is_refused(changes, words):
    message = cloud_message(POINTS)
    vars(message).update(changes)
    with pytest.raises(MessageError) as caught:
        cloud_from_message(message)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(("name", "value"), [("datatype", 6), ("datatype", 0), ("count", 3), ("offset", 13)])
def test_a_field_that_is_no_float_of_the_point_is_refused(name, value):
    message = cloud_message(POINTS)
    setattr(message.fields[1], name, value)
    with pytest.raises(MessageError):
        cloud_from_message(message)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("padding", [0, 6])
def test_depth_in_both_units(order, padding):
    millimetres = np.arange(12, dtype=np.uint16).reshape(3, 4) * 500
    for encoding, pixels in (("16UC1", millimetres), ("mono16", millimetres),
                             ("32FC1", millimetres.astype("f4") / 1000)):  # fmt: skip
        depth = depth_from_message(image_message(pixels, encoding, order, padding))
        np.testing.assert_allclose(depth, millimetres / 1000, atol=1e-7)
    depth = depth_from_message(image_message(millimetres, "16UC1"), depth_scale=0.0001)
    np.testing.assert_allclose(depth, millimetres / 10000)


@pytest.mark.parametrize(
    "changes",
    [
        {"encoding": "rgb8"}, {"encoding": ""}, {"width": 5}, {"height": 4}, {"step": 7}, {"step": 9},
        {"data": bytes(23)}, {"width": 2**32 - 1, "height": 2**32 - 1, "step": 2**32 - 1},
    ],
)  # fmt: skip
def test_an_image_that_contradicts_itself_is_refused(changes):
    message = image_message(np.ones((3, 4), np.uint16), "16UC1")
    vars(message).update(changes)
    with pytest.raises(MessageError):
        depth_from_message(message)


def test_the_pinhole_of_a_camera():
    assert intrinsics_from_message(camera_message()) == Intrinsics(615.0, 610.0, 320.0, 240.0, 640, 480)
    assert intrinsics_from_message(camera_message(roi=(0, 0, 640, 480))).width == 640


@pytest.mark.parametrize(
    "camera",
    [
        camera_message(k=np.zeros(9)),
        camera_message(k=(np.nan, 0, 320, 0, 610, 240, 0, 0, 1)),
        camera_message(k=(-615, 0, 320, 0, 610, 240, 0, 0, 1)),
        camera_message(roi=(10, 0, 320, 240)),
        camera_message(width=0, height=0),
    ],
    ids=["uncalibrated", "nan", "negative", "region", "empty"],
)
def test_a_camera_that_is_no_pinhole_is_refused(camera):
    with pytest.raises(FFHNetError):
        intrinsics_from_message(camera)


SIZES = st.integers(0, 2**32 - 1) | st.integers(0, 40)


@given(
    data=st.binary(max_size=200),
    height=SIZES,
    width=SIZES,
    steps=st.tuples(SIZES, SIZES),
    offsets=st.tuples(SIZES, SIZES, SIZES),
    datatype=st.integers(0, 255) | st.sampled_from([7, 8]),
    bigendian=st.booleans(),
)
def test_whatever_comes_is_points_or_a_typed_error(data, height, width, steps, offsets, datatype, bigendian):
    message = cloud_message(POINTS)
    message.point_step, message.row_step = steps
    message.height, message.width, message.data, message.is_bigendian = height, width, data, bigendian
    for field, offset in zip(message.fields, offsets, strict=True):
        field.offset, field.datatype = offset, datatype
    try:
        points = cloud_from_message(message)
    except FFHNetError:
        return
    assert points.shape == (height * width if data else 0, 3)
