"""Ranked grasps as ROS messages, under the header that they are given. Needs the message packages only."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from jaxtyping import Float
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ffhnet.geometry.rotations import quaternion_from_matrix
from ffhnet.grasps import SCORES, Grasps
from ffhnet.hands import Hand

POSE_FIELDS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def pose_array(grasps: Grasps, header: Header) -> PoseArray:
    """The poses of the palms (metres), in the order of the grasps."""
    poses = [pose_message(*row) for row in _poses(grasps).tolist()]
    return PoseArray(header=header, poses=poses)


def pose_message(x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> Pose:
    """A pose from seven numbers."""
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def table(grasps: Grasps, header: Header) -> PointCloud2:
    """All that is known of the grasps, one point each.

    Float32 fields: `POSE_FIELDS` of the palm, the scores that are known (`probability`, `robustness`), and
    the joint angles (rad) by the joints' names.
    """
    scores = {name: getattr(grasps, name) for name in SCORES if getattr(grasps, name) is not None}
    names = (*POSE_FIELDS, *scores, *grasps.joint_names)
    rows = np.column_stack([_poses(grasps), *scores.values(), grasps.joints]).astype("<f4")
    fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(names)
    ]
    step = 4 * len(names)
    return PointCloud2(
        header=header,
        height=1,
        width=len(grasps),
        fields=fields,
        is_bigendian=False,
        point_step=step,
        row_step=step * len(grasps),
        data=rows.tobytes(),
        is_dense=True,
    )


def preshape(grasps: Grasps, hand: Hand, header: Header) -> JointTrajectory:
    """The best grasp's fingers: the open hand in which to approach, then the shape to which it closes.

    The second point comes as late as the slowest joint takes at the speed of the closing motion. Without
    grasps there are no points.
    """
    message = JointTrajectory(header=header, joint_names=list(grasps.joint_names))
    if len(grasps):
        closed = grasps.joints[0]
        opened = hand.open(closed)
        travel = float(np.abs(closed - opened).max()) / hand.closing.speed
        message.points = [_point(opened, 0.0), _point(closed, travel)]
    return message


def _point(joints: Float[np.ndarray, " J"], seconds: float) -> JointTrajectoryPoint:
    whole = int(seconds)
    return JointTrajectoryPoint(
        positions=joints.tolist(),
        time_from_start=Duration(sec=whole, nanosec=int((seconds - whole) * 1e9)),
    )


def _poses(grasps: Grasps) -> Float[np.ndarray, "N 7"]:
    """Position and quaternion (ROS's order xyzw) of each palm."""
    quaternion = quaternion_from_matrix(grasps.rotation) if len(grasps) else np.zeros((0, 4))
    return np.column_stack([grasps.position, quaternion[:, [1, 2, 3, 0]]])
