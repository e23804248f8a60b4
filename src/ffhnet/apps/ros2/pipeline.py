"""From points in a named frame to ranked grasps in the frame that is wanted."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ffhnet.apps.ros2.settings import RosOptions
from ffhnet.errors import OptionError, SceneError
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.inference import FFHNet
from ffhnet.perception.cloud import validate_object
from ffhnet.perception.observation import Observation, observe_object, observe_scene


def find_grasps(
    network: FFHNet, cloud: Float[np.ndarray, "N 3"], frame: str, is_scene: bool, options: RosOptions
) -> Grasps:
    """Ranked grasps, best first, for the object in a cloud.

    Args:
        network: proposes and rates.
        cloud: points (m), the optical frame of a camera (x right, y down, z forward) if it is a scene.
        frame: ROS's name of the cloud's frame.
        is_scene: the points can only be a whole scene, as those of a depth image.
        options: what the user set.

    Raises:
        FFHNetError: no object or no grasp in it, for whatever reason; the message says which.
    """
    observation = _observe(cloud, is_scene, options)
    grasps = network.grasp(observation, options.num, options.seed, options.threshold)
    if len(grasps) == 0:
        raise SceneError(f"no grasp reaches the threshold {options.threshold:g}")
    if options.max_failure > 0:
        refusal = network.control_risk(options.max_failure).refusal(grasps.score)
        if refusal is not None:
            raise SceneError(refusal)
    return grasps.to_frame(_T_wanted_input(options), options.frame or frame)


def no_grasps(network: FFHNet) -> Grasps:
    """A batch of none, of the network's hand."""
    joint_names = network.info.joint_names
    return Grasps(
        rotation=np.zeros((0, 3, 3)),
        position=np.zeros((0, 3)),
        joints=np.zeros((0, len(joint_names))),
        joint_names=joint_names,
        hand=network.info.hand,
        frame="",
        probability=np.zeros(0),
    )


def _T_wanted_input(options: RosOptions) -> Float[np.ndarray, "4 4"]:
    """Pose of the input's frame in the frame that is wanted; the identity where that is the same."""
    if not options.input_pose:
        return np.eye(4)
    x, y, z, *quaternion_xyzw = options.input_pose
    quaternion_wxyz = np.roll(quaternion_xyzw, 1)
    return make_transform(matrix_from_quaternion(quaternion_wxyz), np.array([x, y, z]))


def _observe(cloud: Float[np.ndarray, "N 3"], is_scene: bool, options: RosOptions) -> Observation:
    if not options.up:
        return observe_scene(cloud, np.random.default_rng(options.seed), options.object)
    if is_scene:
        raise OptionError("up is for clouds of one object; a depth image shows a whole scene")
    cloud = validate_object(cloud)
    direction = cloud.mean(axis=0) - np.array(options.camera) if options.camera else None
    return observe_object(cloud, np.array(options.up), "camera", viewing_direction=direction)
