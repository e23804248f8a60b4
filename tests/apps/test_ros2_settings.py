"""Options of the ROS node, and how they reach the grasps."""

import numpy as np
import pytest

from ffhnet.apps.ros2 import command
from ffhnet.apps.ros2.pipeline import find_grasps, no_grasps
from ffhnet.apps.ros2.settings import RosOptions
from ffhnet.errors import CloudError, MissingExtraError, OptionError, SceneError
from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import make_transform
from ffhnet.inference import FFHNet
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.observation import observe_depth

UP = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def network(untrained_weights):
    return FFHNet.from_pretrained(untrained_weights)


@pytest.fixture(scope="module")
def scene(depth):
    return depth_to_cloud(depth, REALSENSE_D415)[0]


@pytest.mark.parametrize(
    "options",
    [
        {"num": 0}, {"shown": -1}, {"threshold": 1.5}, {"threshold": float("nan")}, {"max_failure": 1.0},
        {"up": (0.0, 1.0)}, {"up": (0.0, float("inf"), 1.0)}, {"camera": (0.0, 0.0, 0.0)}, {"max_age": 0.0},
        {"depth_scale": -1.0}, {"depth_scale": float("inf")}, {"frame": "base"}, {"seed": -1},
        {"frame": "base", "input_pose": (0.0,) * 7}, {"input_pose": (0.0,) * 6 + (1.0,)},
    ],
)  # fmt: skip
def test_options_that_cannot_be_used(options):
    with pytest.raises(OptionError):
        RosOptions(**options)


def test_a_scene_answers_as_the_library_does(network, scene, depth):
    options = RosOptions(num=12, seed=3)
    found = find_grasps(network, scene, "optical", True, options)
    wanted = network.grasp(observe_depth(depth, REALSENSE_D415, np.random.default_rng(3)), 12, seed=3)
    assert found.frame == "optical"
    np.testing.assert_array_equal(found.position, wanted.position)
    np.testing.assert_array_equal(found.probability, wanted.probability)


def test_grasps_go_to_the_frame_that_is_wanted(network, object_cloud):
    quarter = np.sqrt(0.5)
    moved = RosOptions(num=8, up=UP, frame="base", input_pose=(1.0, 2.0, 3.0, 0.0, 0.0, quarter, quarter))
    there = find_grasps(network, object_cloud, "cloud", False, moved)
    here = find_grasps(network, object_cloud, "cloud", False, RosOptions(num=8, up=UP))
    T_base_cloud = make_transform(about_z(np.pi / 2), np.array([1.0, 2.0, 3.0]))
    wanted = here.to_frame(T_base_cloud, "base")
    assert there.frame == "base"
    np.testing.assert_allclose(there.position, wanted.position, atol=1e-12)
    np.testing.assert_allclose(there.rotation, wanted.rotation, atol=1e-12)


def test_where_the_camera_stood_turns_the_view(network, object_cloud):
    front, side = (
        find_grasps(network, object_cloud, "f", False, RosOptions(num=8, up=UP, camera=camera))
        for camera in ((-1.0, 0.0, 0.5), (0.0, -1.0, 0.5))
    )
    assert np.abs(front.position - side.position).max() > 0.01


def test_refusals_have_a_reason(network, scene, object_cloud):
    with pytest.raises(SceneError, match="threshold 1"):
        find_grasps(network, scene, "f", True, RosOptions(num=4, threshold=1.0))
    with pytest.raises(OptionError, match="whole scene"):
        find_grasps(network, scene, "f", True, RosOptions(num=4, up=UP))
    with pytest.raises(CloudError, match="empty"):
        find_grasps(network, np.zeros((0, 3)), "f", False, RosOptions(num=4, up=UP, camera=UP))
    with pytest.raises(CloudError, match="millimetres"):
        find_grasps(network, 1000 * scene, "f", True, RosOptions(num=4))
    assert len(no_grasps(network)) == 0


def test_without_ros_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"rclpy.*ffhnet\[ros\]"):
        command.run(RosOptions())


def test_the_command_line_leaves_ros_its_arguments(ffhnet):
    status, _, err = ffhnet("ros", "--threshold", "2", "--ros-args", "-p", "num:=3")
    assert status == 2
    assert "threshold" in err
