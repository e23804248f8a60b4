"""A real node in a process of its own, and a real publisher and subscriber in this one, over loopback."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2: pip install 'ffhnet[ros]'")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros2_stand_ins import camera_message, cloud_message, image_message
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from ffhnet.apps.ros2.pipeline import find_grasps
from ffhnet.apps.ros2.settings import RosOptions
from ffhnet.inference import FFHNet
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.cloud import depth_to_cloud

NUM = 16
PATIENCE = 60.0
"""s: a crowded machine may be slow, a broken node is silent for ever."""

OUTPUTS = {"grasps": PoseArray, "table": PointCloud2, "preshape": JointTrajectory, "markers": MarkerArray}


@pytest.fixture(scope="module")
def environment():
    """Nobody else on this machine talks in this domain."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield


@pytest.fixture(scope="module")
def process(environment, untrained_weights):
    program = "from ffhnet.apps.cli import main; main()"
    options = ["--weights", str(untrained_weights), "--num", str(NUM)]
    node = subprocess.Popen(
        [sys.executable, "-c", program, "ros", *options, "--ros-args", "-p", "shown:=3"],
        stderr=subprocess.PIPE,
        text=True,
    )
    yield node
    if node.poll() is None:
        node.kill()
        node.communicate()


class Robot:
    """The other side: sends views, keeps answers."""

    def __init__(self):
        self.node = rclpy.create_node("robot")
        self.answers = {name: [] for name in (*OUTPUTS, "diagnostics")}
        for name, kind in OUTPUTS.items():
            self.node.create_subscription(kind, f"/ffhnet/{name}", self.answers[name].append, 10)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.answers["diagnostics"].append, 10)
        self.publishers = {
            name: self.node.create_publisher(kind, name, 10)
            for name, kind in {"cloud": PointCloud2, "depth": Image, "camera_info": CameraInfo}.items()
        }
        self.sent = 0
        self.wait_for(lambda: all(p.get_subscription_count() for p in self.publishers.values()), "the node")

    def wait_for(self, condition, what):
        self.spin(PATIENCE, condition)
        assert condition(), f"{what} did not come"

    def send(self, name, message, frame="optical"):
        """Publish under a header of its own; gives the stamp."""
        self.sent += 1
        message.header.frame_id = frame
        message.header.stamp.sec = self.sent
        self.publishers[name].publish(message)
        return self.sent

    def stamps(self):
        """Of all answers, in the order in which they came."""
        return [answer.header.stamp.sec for answer in self.answers["grasps"]]

    def ask(self, name, message):
        """Send a view until it is answered (the node listens with best effort); gives every output for it."""
        first = self.sent + 1

        def complete():
            for stamp in range(first, self.sent + 1):
                found = {output: self.answer(output, stamp) for output in OUTPUTS}
                if None not in found.values():
                    return found
            return None

        deadline = time.monotonic() + PATIENCE
        while complete() is None:
            assert time.monotonic() < deadline, f"no answer to {self.sent + 1 - first} views"
            self.send(name, message)
            self.spin(0.5, complete)
        return complete()

    def answer(self, output, stamp):
        """What came of an output for a stamp, or None."""
        for message in self.answers[output]:
            header = message.markers[0].header if output == "markers" else message.header
            if header.stamp.sec == stamp:
                return message
        return None

    def spin(self, seconds, condition=lambda: False):
        """Listen for some time, or until the condition holds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not condition():
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def call(self, kind, name, request):
        client = self.node.create_client(kind, name)
        self.wait_for(client.service_is_ready, name)
        future = client.call_async(request)
        self.wait_for(future.done, f"the response of {name}")
        self.node.destroy_client(client)
        return future.result()

    def set(self, name, value):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, "/ffhnet/set_parameters", request).results[0]


@pytest.fixture(scope="module")
def robot(environment, process):
    rclpy.init()
    yield Robot()
    rclpy.shutdown()


@pytest.fixture(scope="module")
def cloud(depth):
    return depth_to_cloud(depth, REALSENSE_D415)[0][::12].astype("f4")


def real_cloud(stand_in) -> PointCloud2:
    fields = [PointField(**vars(field)) for field in stand_in.fields]
    return PointCloud2(**{**vars(stand_in), "fields": fields})


def real_camera(**changes) -> CameraInfo:
    stand_in = camera_message(**changes)
    return CameraInfo(width=stand_in.width, height=stand_in.height, k=stand_in.k)


def palms(message: PoseArray) -> np.ndarray:
    return np.array([[pose.position.x, pose.position.y, pose.position.z] for pose in message.poses])


def test_the_answer_is_that_of_the_library_under_the_header_of_the_view(robot, cloud, untrained_weights):
    answer = robot.ask("cloud", real_cloud(cloud_message(cloud)))
    wanted = find_grasps(
        FFHNet.from_pretrained(untrained_weights), cloud, "optical", False, RosOptions(num=NUM)
    )
    np.testing.assert_allclose(palms(answer["grasps"]), wanted.position, atol=1e-5)
    assert {m.header.frame_id for m in (answer["grasps"], answer["table"], answer["preshape"])} == {"optical"}
    assert answer["table"].width == NUM
    assert len(answer["preshape"].points) == 2
    assert len(answer["markers"].markers[1].points) == 2 * 3


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_depth_images_with_their_camera(robot, depth, encoding):
    pixels = np.rint(1000 * depth).astype("u2") if encoding == "16UC1" else depth.astype("f4")
    image = Image(**vars(image_message(pixels, encoding)))

    def answered():
        # Two topics are not in order: the camera may come after the image.
        robot.send("camera_info", real_camera(k=(615.0, 0, 320.0, 0, 615.0, 240.0, 0, 0, 1)))
        return len(robot.ask("depth", image)["grasps"].poses) == NUM

    robot.wait_for(answered, "grasps for a depth image")


def broken_views(cloud):
    good = cloud_message(cloud)
    for changes in (
        {"point_step": 11}, {"row_step": 7}, {"width": 10**6}, {"data": good.data[:-1]}, {"data": b""},
        {"fields": []}, {"is_bigendian": True}, {"width": 0, "row_step": 0, "data": b""},
        {"height": 0, "width": 0, "row_step": 0, "data": b""},
    ):  # fmt: skip
        stand_in = cloud_message(cloud)
        vars(stand_in).update(changes)
        yield "cloud", real_cloud(stand_in)
    for points in (
        np.full_like(cloud, np.nan),
        1000 * cloud,
        np.zeros_like(cloud),
        cloud[:10],
        cloud - cloud.mean(0),
    ):
        yield "cloud", real_cloud(cloud_message(points))
    millimetres = (np.zeros((480, 640), "u2"), np.full((480, 640), 65535, "u2"), np.zeros((0, 0), "u2"))
    for pixels in (*millimetres, np.ones((48, 64), "u2")):
        yield "depth", Image(**vars(image_message(pixels, "16UC1")))
    yield "depth", Image(**{**vars(image_message(millimetres[0], "16UC1")), "encoding": "rgb8"})
    for metres in (np.nan, 1e38):
        yield "depth", Image(**vars(image_message(np.full((480, 640), metres, "f4"), "32FC1")))


def test_broken_views_are_answered_with_none_and_the_next_good_one_as_ever(robot, process, cloud):
    for name, message in broken_views(cloud):
        answer = robot.ask(name, message)
        assert answer["grasps"].poses == []
        assert list(answer["preshape"].points) == []
    assert process.poll() is None
    assert robot.ask("cloud", real_cloud(cloud_message(cloud)))["grasps"].poses


def test_a_flood_is_answered_in_order_with_the_newest(robot, cloud):
    message = real_cloud(cloud_message(cloud))
    already = len(robot.stamps())
    first = robot.sent + 1
    for _ in range(40):
        robot.send("cloud", message)
        robot.spin(0.01)
    robot.ask("cloud", message)
    stamps = [stamp for stamp in robot.stamps()[already:] if stamp >= first]
    assert stamps == sorted(set(stamps))
    assert len(stamps) < robot.sent + 1 - first


def test_on_demand_the_node_answers_when_it_is_called(robot, cloud):
    robot.spin(1.0)
    assert robot.set("continuous", False).successful
    assert robot.set("max_age", 100.0).successful
    already = len(robot.stamps())
    stamp = robot.send("cloud", real_cloud(cloud_message(cloud)))
    robot.spin(1.0)
    assert len(robot.stamps()) == already
    response = robot.call(Trigger, "/ffhnet/trigger", Trigger.Request())
    assert response.success
    assert f"{NUM} grasps" in response.message
    robot.wait_for(lambda: len(robot.stamps()) > already, "the answer")
    assert robot.stamps()[already:] in ([stamp], [stamp - 1])
    assert robot.set("max_age", 1e-3).successful
    response = robot.call(Trigger, "/ffhnet/trigger", Trigger.Request())
    assert not response.success
    assert "no view of the last 0.001 s" in response.message
    assert robot.set("max_age", 1.0).successful
    assert robot.set("continuous", True).successful


def test_parameters_that_cannot_be_used_are_refused(robot):
    result = robot.set("threshold", 1.5)
    assert not result.successful
    assert "threshold" in result.reason
    assert not robot.set("up", [0.0, 1.0]).successful
    assert not robot.set("weights", "elsewhere").successful


def test_diagnostics_say_how_it_goes(robot, cloud):
    def next_status():
        told = len(robot.answers["diagnostics"])
        robot.wait_for(lambda: len(robot.answers["diagnostics"]) > told, "diagnostics")
        return robot.answers["diagnostics"][-1].status[0]

    assert robot.set("max_age", 100.0).successful
    robot.ask("cloud", real_cloud(cloud_message(cloud[:10])))
    status = next_status()
    assert status.level == DiagnosticStatus.WARN
    assert "50 points" in status.message
    robot.ask("cloud", real_cloud(cloud_message(cloud)))
    assert next_status().level == DiagnosticStatus.OK
    assert robot.set("max_age", 0.1).successful
    robot.spin(1.0)
    assert next_status().level == DiagnosticStatus.STALE


def test_an_interrupt_ends_it_quietly(robot, process):
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert "Traceback" not in err
