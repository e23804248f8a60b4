"""A thousand clouds at 30 Hz through a real node: what becomes of them, how late answers are, and its memory.

    python benchmarks/ros2_stream.py --json ros2_stream.json

Three processes on loopback: the node, a publisher, and this one, which subscribes. Every tenth cloud is
broken. Latency runs from the stamp, taken just before a cloud is published, to the poses' arrival here.
Leaves with status 1 where the node did not live through it. Needs ROS 2 and /proc (Linux).
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import rclpy
import tyro
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2, PointField

from ffhnet.apps.console import absent
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.capture import read_depth
from ffhnet.perception.cloud import depth_to_cloud

EXAMPLES = Path(__file__).parents[1] / "examples" / "data"
MB = 1e6


@dataclass(frozen=True)
class Options:
    """A stream of clouds through the ROS 2 node."""

    clouds: int = 1000
    """Clouds that are published."""
    rate: float = 30.0
    """Clouds per second."""
    every: int = 4
    """Keep one in so many of the 640 x 480 pixels."""
    num: int = 400
    """Grasps that the node samples for a view."""
    weights: str = ""
    """Weights of the node; empty takes the package's own."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the figures to this file."""


def main(options: Options) -> None:
    # Alone in a domain of its own, and on this machine only; the other processes inherit it.
    os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    program = "from ffhnet.apps.cli import main; main()"
    settings = ["--num", str(options.num), "--weights", options.weights]
    node = subprocess.Popen([sys.executable, "-c", program, "ros", *settings])
    publisher = multiprocessing.get_context("spawn").Process(target=publish, args=(options,))
    try:
        figures = watch(node, publisher, options)
        node.send_signal(signal.SIGINT)
        figures["exit_status"] = node.wait(timeout=60)
    finally:
        node.kill()
        publisher.kill()
    print(json.dumps(figures, indent=2))
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    sys.exit(0 if figures["exit_status"] == 0 else 1)


def publish(options: Options) -> None:
    """Send the clouds of the examples at a steady rate, each under the time at which it leaves."""
    rclpy.init()
    node = rclpy.create_node("camera")
    publisher = node.create_publisher(PointCloud2, "cloud", qos_profile_sensor_data)
    messages = example_messages(options.every)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.1)
    start = time.monotonic()
    for number in range(options.clouds):
        time.sleep(max(0.0, start + number / options.rate - time.monotonic()))
        message = messages[number % len(messages)]
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)
    # What was published last may still be on its way.
    time.sleep(2.0)
    rclpy.shutdown()


def example_messages(every: int) -> list[PointCloud2]:
    """Nine clouds of three scenes with noise, and a broken one."""
    rng = np.random.default_rng(0)
    messages = []
    for file in sorted(EXAMPLES.glob("*_depth.png")):
        cloud = depth_to_cloud(read_depth(file), REALSENSE_D415)[0][::every]
        messages += [cloud_message(cloud + rng.normal(scale=0.001, size=cloud.shape)) for _ in range(3)]
    broken = cloud_message(np.full((1000, 3), np.nan))
    broken.point_step = 7
    return [*messages, broken]


def cloud_message(cloud: np.ndarray) -> PointCloud2:
    message = PointCloud2(height=1, width=len(cloud), point_step=12, row_step=12 * len(cloud), is_dense=True)
    message.fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate("xyz")
    ]
    message.header.frame_id = "camera_depth_optical_frame"
    message.data = cloud.astype("<f4").tobytes()
    return message


def watch(grasps: subprocess.Popen, publisher: Any, options: Options) -> dict[str, Any]:
    """Subscribe until the publisher is done; gives the figures."""
    rclpy.init()
    node = rclpy.create_node("watcher")
    latency: list[float] = []
    poses: list[int] = []
    memory: list[float] = []
    health: dict[str, str] = {}

    def on_grasps(message: PoseArray) -> None:
        now, stamp = node.get_clock().now().nanoseconds, message.header.stamp
        latency.append(1e-9 * now - stamp.sec - 1e-9 * stamp.nanosec)
        poses.append(len(message.poses))
        memory.append(resident(grasps.pid))

    def on_diagnostics(message: DiagnosticArray) -> None:
        health.update({item.key: item.value for item in message.status[0].values})

    node.create_subscription(PoseArray, "/ffhnet/grasps", on_grasps, 10)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    publisher.start()
    while publisher.is_alive():
        if grasps.poll() is not None:
            sys.exit(f"the node ended with status {grasps.returncode} while clouds came")
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.shutdown()
    good = np.array(latency)[np.array(poses) > 0]
    settled = np.array(memory[len(memory) // 4 :]) / MB
    slope = np.polyfit(np.linspace(0, 0.75 * options.clouds, len(settled)), settled, 1)[0]
    return {
        "published": options.clouds,
        "rate_hz": options.rate,
        "points": [m.width for m in example_messages(options.every)[:-1:3]],
        "grasps_sampled": options.num,
        "load_average": os.getloadavg()[0],
        "node": health,
        "answers_seen": len(poses),
        "with_grasps": int((np.array(poses) > 0).sum()),
        "latency_ms": {
            "median": round(1000 * float(np.median(good)), 1),
            "p99": round(1000 * float(np.percentile(good, 99)), 1),
            "worst": round(1000 * float(good.max()), 1),
        },
        "resident_mb": {
            "after_a_quarter": round(float(settled[0]), 1),
            "at_the_end": round(float(settled[-1]), 1),
            "slope_per_1000_clouds": round(1000 * float(slope), 2),
        },
    }


def resident(pid: int) -> float:
    """Bytes of a process that are in memory."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main(tyro.cli(Options))
