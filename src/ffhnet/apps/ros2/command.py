"""`ffhnet ros`: start the node."""

from __future__ import annotations

import os
from importlib.util import find_spec

from ffhnet.apps.ros2.settings import RosOptions
from ffhnet.errors import MissingExtraError

PACKAGES = ("rclpy", "sensor_msgs", "geometry_msgs", "visualization_msgs", "trajectory_msgs", "std_srvs")


def run(options: RosOptions) -> None:
    """Run the node until it is stopped."""
    missing = [name for name in (*PACKAGES, "diagnostic_msgs") if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"`ffhnet ros` needs {', '.join(missing)}: source the setup.bash of your ROS 2, "
            "or on Linux pip install 'ffhnet[ros]'"
        )
    # A newcomer's computer should not be open to its network. Robots of several computers set SUBNET.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from ffhnet.apps.ros2.node import spin

    spin(options)
