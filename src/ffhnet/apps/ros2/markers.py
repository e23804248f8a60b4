"""What RViz shows: every palm's approach as a line coloured by its score, and the best grasp's hand."""

from __future__ import annotations

import numpy as np
import torch
from geometry_msgs.msg import Point, Pose, Vector3
from jaxtyping import Float
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ffhnet.apps.ros2.to_messages import pose_message
from ffhnet.evaluation.shapes import FINGERS, color_scale
from ffhnet.geometry.rotations import quaternion_from_matrix
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import Hand

LINE_LENGTH = 0.05
"""m from a palm along its approach axis."""

LINE_WIDTH = 0.002
"""m"""


def marker_array(grasps: Grasps, hand: Hand, header: Header, shown: int) -> MarkerArray:
    """Markers for the first `shown` grasps; those of the view before are deleted first."""
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    if len(grasps) and shown:
        markers += [_palms(grasps[:shown], header), *_hand(grasps, hand, header)]
    return MarkerArray(markers=markers)


def _palms(grasps: Grasps, header: Header) -> Marker:
    """A line for each grasp, that ends at the palm."""
    start = grasps.position - LINE_LENGTH * grasps.rotation[:, :, 0]
    ends = np.stack([start, grasps.position], axis=1).reshape(-1, 3)
    colors = np.repeat(color_scale(grasps.score), 2, axis=0)
    return Marker(
        header=header,
        ns="palms",
        type=Marker.LINE_LIST,
        pose=_identity(),
        scale=Vector3(x=LINE_WIDTH),
        color=_color(FINGERS),
        points=[Point(x=x, y=y, z=z) for x, y, z in ends.tolist()],
        colors=[_color(color) for color in colors],
    )


def _hand(grasps: Grasps, hand: Hand, header: Header) -> list[Marker]:
    """The collision shapes of the hand in the best grasp."""
    T_palm_body = hand.body_poses(torch.as_tensor(grasps.joints[:1], dtype=torch.float64))[0].numpy()
    T_frame_palm = make_transform(grasps.rotation[0], grasps.position[0])
    markers: list[Marker] = []
    for geom in hand.tree.geoms:
        T_frame_geom = T_frame_palm @ T_palm_body[geom.body] @ geom.T_body_geom
        for kind, scale, along in _primitives(geom.type, geom.size):
            T = T_frame_geom @ make_transform(position=np.array([0.0, 0.0, along]))
            markers.append(
                Marker(
                    header=header,
                    ns="hand",
                    id=len(markers),
                    type=kind,
                    pose=_pose(T),
                    scale=Vector3(x=scale[0], y=scale[1], z=scale[2]),
                    color=_color(FINGERS),
                )
            )
    return markers


def _primitives(kind: str, size: tuple[float, ...]) -> list[tuple[int, tuple[float, float, float], float]]:
    """RViz's shapes for one of MuJoCo's: type, lengths of the sides, and how far along z it stands."""
    if kind == "box":
        return [(Marker.CUBE, (2 * size[0], 2 * size[1], 2 * size[2]), 0.0)]
    ball = (2 * size[0],) * 3
    if kind == "sphere":
        return [(Marker.SPHERE, ball, 0.0)]
    rod = (Marker.CYLINDER, (2 * size[0], 2 * size[0], 2 * size[1]), 0.0)
    if kind == "cylinder":
        return [rod]
    return [rod, (Marker.SPHERE, ball, size[1]), (Marker.SPHERE, ball, -size[1])]


def _pose(T: Float[np.ndarray, "4 4"]) -> Pose:
    x, y, z = T[:3, 3].tolist()
    qw, qx, qy, qz = quaternion_from_matrix(T[:3, :3]).tolist()
    return pose_message(x, y, z, qx, qy, qz, qw)


def _identity() -> Pose:
    return pose_message(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _color(rgb: Float[np.ndarray, " 3"]) -> ColorRGBA:
    r, g, b = rgb.tolist()
    return ColorRGBA(r=r, g=g, b=b, a=1.0)
