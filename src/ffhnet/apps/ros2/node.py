"""The node itself: topics, parameters, the service, and the thread that works on the newest view."""

from __future__ import annotations

import array
import dataclasses
import os
import signal
import threading
import traceback
from collections.abc import Sequence

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from ffhnet.apps.ros2.from_messages import cloud_from_message, depth_from_message, intrinsics_from_message
from ffhnet.apps.ros2.health import Health
from ffhnet.apps.ros2.latest import Arrival, Latest
from ffhnet.apps.ros2.markers import marker_array
from ffhnet.apps.ros2.pipeline import find_grasps, no_grasps
from ffhnet.apps.ros2.settings import RosOptions
from ffhnet.apps.ros2.to_messages import pose_array, preshape, table
from ffhnet.errors import FFHNetError, MessageError
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.perception.cloud import depth_to_cloud

_SENSOR = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""As ROS has it for sensors, but with the newest view only. It hears reliable publishers as well."""

_ANSWER = QoSProfile(depth=1)
"""Reliable, and only the newest: an old answer is of no use to a robot."""

_LOG_EVERY = 5.0
"""s between lines of the log about refused views."""


@dataclasses.dataclass(frozen=True)
class View:
    """What a camera sent: a cloud, or a depth image with what was last known of its camera."""

    message: PointCloud2 | Image
    camera: CameraInfo | None = None


class GraspNode(Node):
    """Clouds or depth images in; ranked grasps, the best one's fingers, markers and diagnostics out.

    The callbacks only put the newest view into a mailbox. One thread takes it out, so that views which come
    faster than they can be answered are dropped, and answers are never older than one view.
    """

    def __init__(self, options: RosOptions) -> None:
        super().__init__("ffhnet")
        self._declare(options)
        self._options = self._read_parameters()
        self.add_on_set_parameters_callback(self._on_parameters)
        self._network = FFHNet.from_pretrained(self._options.weights or None)
        self._hand = load_hand(self._network.info.hand)
        self._no_grasps = no_grasps(self._network)
        self._health = Health()
        self._views: Latest[View] = Latest()
        self._camera: CameraInfo | None = None

        self._grasps = self.create_publisher(PoseArray, "~/grasps", _ANSWER)
        self._table = self.create_publisher(PointCloud2, "~/table", _ANSWER)
        self._preshape = self.create_publisher(JointTrajectory, "~/preshape", _ANSWER)
        self._markers = self.create_publisher(MarkerArray, "~/markers", _ANSWER)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", _ANSWER)
        self.create_subscription(PointCloud2, "cloud", self._on_cloud, _SENSOR)
        self.create_subscription(Image, "depth", self._on_depth, _SENSOR)
        self.create_subscription(CameraInfo, "camera_info", self._on_camera, _SENSOR)
        self.create_service(Trigger, "~/trigger", self._on_trigger)
        self.create_timer(1.0, self._tell_health)

        self._busy = threading.Lock()
        self._worker = threading.Thread(target=self._work, name="grasps")
        self._worker.start()
        reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
        self.get_logger().info(f"grasps of {self._hand.name}; ROS_AUTOMATIC_DISCOVERY_RANGE is {reach}")

    def finish(self) -> None:
        """Wait for the worker to end with the view that it has."""
        self._views.close()
        self._worker.join()

    def _on_cloud(self, message: PointCloud2) -> None:
        self._bring(View(message))

    def _on_depth(self, message: Image) -> None:
        self._bring(View(message, self._camera))

    def _on_camera(self, message: CameraInfo) -> None:
        self._camera = message

    def _bring(self, view: View) -> None:
        self._health.received()
        self._views.put(view)

    def _work(self) -> None:
        while (arrival := self._views.take()) is not None:
            if self._options.continuous:
                self._answer(arrival)

    def _on_trigger(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        arrival = self._views.peek()
        if arrival is None or arrival.age > self._options.max_age:
            age = "none came yet" if arrival is None else f"the last one came {arrival.age:.1f} s ago"
            response.message = f"no view of the last {self._options.max_age:g} s: {age}"
            return response
        grasps, refusal = self._answer(arrival)
        response.success = refusal is None
        response.message = refusal or f"{len(grasps)} grasps, the best with score {grasps.score[0]:.3f}"
        return response

    def _answer(self, arrival: Arrival[View]) -> tuple[Grasps, str | None]:
        """Publish the grasps for a view, or that there are none and why."""
        with self._busy:
            options, header = self._options, arrival.item.message.header
            header = Header(stamp=header.stamp, frame_id=options.frame or header.frame_id)
            refusal: str | None = None
            try:
                grasps = self._find(arrival.item, options)
            except FFHNetError as error:
                grasps, refusal = self._no_grasps, str(error)
            except Exception as error:
                # A robot must keep seeing: what nobody has thought of costs one view and is told.
                grasps, refusal = self._no_grasps, f"fault: {type(error).__name__}: {error}"
                self.get_logger().error(traceback.format_exc())
            self._publish(grasps, header, options.shown)
            if refusal is None:
                self._health.answered(arrival.age)
            else:
                self._health.refused(refusal)
                self.get_logger().warning(refusal, throttle_duration_sec=_LOG_EVERY)
        return grasps, refusal

    def _find(self, view: View, options: RosOptions) -> Grasps:
        message = view.message
        if isinstance(message, Image):
            if view.camera is None:
                raise MessageError("a depth image came, but no CameraInfo before it")
            named = message.header.frame_id, view.camera.header.frame_id
            if named[0] != named[1]:
                raise MessageError(
                    f"the depth image is of frame {named[0]!r}, its CameraInfo of {named[1]!r}"
                )
            depth = depth_from_message(message, options.depth_scale or None)
            cloud, _ = depth_to_cloud(depth, intrinsics_from_message(view.camera))
        else:
            cloud = cloud_from_message(message)
        is_scene = isinstance(message, Image)
        return find_grasps(self._network, cloud, message.header.frame_id, is_scene, options)

    def _publish(self, grasps: Grasps, header: Header, shown: int) -> None:
        self._grasps.publish(pose_array(grasps, header))
        self._table.publish(table(grasps, header))
        self._preshape.publish(preshape(grasps, self._hand, header))
        self._markers.publish(marker_array(grasps, self._hand, header, shown))

    def _tell_health(self) -> None:
        now = self.get_clock().now().to_msg()
        name, max_age = self.get_name(), self._options.max_age
        self._diagnostics.publish(self._health.message(name, now, self._views.dropped, max_age))

    def _declare(self, options: RosOptions) -> None:
        for field in dataclasses.fields(options):
            default = getattr(options, field.name)
            # ROS cannot tell the type of an empty list: such a parameter is declared, but not set.
            value = Parameter.Type.DOUBLE_ARRAY if default == () else default
            self.declare_parameter(field.name, value, ParameterDescriptor(read_only=field.name == "weights"))

    def _read_parameters(self, changed: Sequence[Parameter] = ()) -> RosOptions:
        """The options as the parameters have them; raises OptionError where they do not fit."""
        parameters = [self.get_parameter_or(field.name) for field in dataclasses.fields(RosOptions)]
        names = {parameter.name for parameter in parameters}
        values = {p.name: p.value for p in [*parameters, *changed] if p.name in names and p.value is not None}
        arrays = {name: tuple(value) for name, value in values.items() if isinstance(value, array.array)}
        return RosOptions(**{**values, **arrays})

    def _on_parameters(self, changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            self._options = self._read_parameters(changed)
        except FFHNetError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def spin(options: RosOptions) -> None:
    """Run the node until it is interrupted or terminated; ROS reads its arguments from the command line."""
    # ROS's own handlers would take its context away while the worker still publishes.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        node = GraspNode(options)
        try:
            rclpy.spin(node)
        except KeyboardInterrupt:
            pass
        finally:
            node.finish()
    finally:
        rclpy.shutdown()
