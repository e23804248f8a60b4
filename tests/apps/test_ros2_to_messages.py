"""Grasps as messages: every number arrives, in ROS's order, under the header that was given."""

import numpy as np
import pytest

pytest.importorskip("visualization_msgs", reason="needs the ROS message packages: pip install 'ffhnet[ros]'")

from geometry_msgs.msg import Pose
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from ffhnet.apps.ros2.from_messages import cloud_from_message
from ffhnet.apps.ros2.markers import marker_array
from ffhnet.apps.ros2.to_messages import pose_array, preshape, table
from ffhnet.geometry.rotations import matrix_from_quaternion, matrix_from_rotation_vector
from ffhnet.geometry.transforms import apply, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand

HAND = load_hand()
HEADER = Header(frame_id="optical")


@pytest.fixture
def grasps():
    rng = np.random.default_rng(0)
    return Grasps(
        rotation=matrix_from_rotation_vector(rng.normal(size=(5, 3))),
        position=rng.normal(size=(5, 3)),
        joints=rng.uniform(HAND.lower, HAND.upper, (5, HAND.num_joints)),
        joint_names=HAND.joint_names,
        hand=HAND.name,
        frame="optical",
        probability=np.linspace(0.9, 0.1, 5),
    )


def transform(pose: Pose) -> np.ndarray:
    q, p = pose.orientation, pose.position
    return make_transform(matrix_from_quaternion(np.array([q.w, q.x, q.y, q.z])), np.array([p.x, p.y, p.z]))


def test_poses(grasps):
    message = pose_array(grasps, HEADER)
    assert message.header == HEADER
    wanted = make_transform(grasps.rotation, grasps.position)
    np.testing.assert_allclose([transform(pose) for pose in message.poses], wanted, atol=1e-12)


def test_the_table_holds_all_that_is_known(grasps):
    message = table(grasps, HEADER)
    names = [field.name for field in message.fields]
    rows = np.frombuffer(bytes(message.data), "<f4").reshape(5, len(names))
    assert names[7:] == ["probability", *HAND.joint_names]
    np.testing.assert_array_equal(cloud_from_message(message), grasps.position.astype("f4"))
    np.testing.assert_array_equal(rows[:, 7], grasps.probability.astype("f4"))
    np.testing.assert_array_equal(rows[:, 8:], grasps.joints.astype("f4"))
    assert "robustness" in [
        field.name for field in table(grasps.replace(robustness=np.ones(5)), HEADER).fields
    ]


def test_the_fingers_open_first_and_close_at_the_hand_s_speed(grasps):
    message = preshape(grasps, HAND, HEADER)
    opened, closed = (np.array(point.positions) for point in message.points)
    assert tuple(message.joint_names) == HAND.joint_names
    np.testing.assert_array_equal(closed, grasps.joints[0])
    moves = HAND.closing.moves > 0
    np.testing.assert_array_equal(opened[moves], HAND.lower[moves])
    np.testing.assert_array_equal(opened[~moves], closed[~moves])
    start, end = (p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points)
    assert start == 0
    assert np.abs(closed - opened).max() / end == pytest.approx(HAND.closing.speed, rel=1e-6)


def test_the_hand_in_rviz_is_the_hand_of_the_best_grasp(grasps):
    markers = marker_array(grasps, HAND, HEADER, shown=3).markers
    assert markers[0].action == Marker.DELETEALL
    palms = markers[1]
    assert len(palms.points) == len(palms.colors) == 6
    shapes = [marker for marker in markers if marker.ns == "hand"]
    assert len({marker.id for marker in shapes}) == len(shapes)
    corners = []
    for marker in shapes:
        s = marker.scale
        unit = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3)
        if marker.type == Marker.SPHERE:
            unit = np.concatenate([0.5 * np.eye(3), -0.5 * np.eye(3)])
        corners.append(apply(transform(marker.pose), unit * [s.x, s.y, s.z]))
    shape = HAND.shape(grasps.joints[0]).apply_transform(
        make_transform(grasps.rotation[0], grasps.position[0])
    )
    # Corners of a cylinder's box stand out by less than half its radius, 14 mm at most.
    np.testing.assert_allclose(
        [np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)], shape.bounds, atol=0.007
    )


def test_no_grasps_are_messages_too(grasps):
    none = grasps[:0]
    assert pose_array(none, HEADER).poses == []
    assert table(none, HEADER).width == 0
    assert list(preshape(none, HAND, HEADER).points) == []
    assert [m.action for m in marker_array(none, HAND, HEADER, 3).markers] == [Marker.DELETEALL]
