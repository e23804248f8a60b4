"""What a user can set: the options of `ffhnet ros` and, by the same names, the parameters of the node."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ffhnet.errors import OptionError


@dataclass(frozen=True)
class RosOptions:
    """ROS 2 node: a depth camera's clouds or depth images in, ranked grasps out.

    Every option is a parameter of the node of the same name, and all but --weights can be changed while it
    runs. What follows --ros-args is for ROS: parameters, names, topics.
    """

    num: int = 400
    """Grasps to sample for every view."""
    threshold: float = 0.0
    """Leave out grasps below this probability."""
    max_failure: float = 0.0
    """Abstain where the best grasp cannot be promised to fail at most this often; 0 never abstains."""
    seed: int = 0
    """Same view and seed, same grasps."""
    weights: str = ""
    """Folder of trained weights; empty takes those that come with the package."""
    up: tuple[float, ...] = ()
    """Three numbers: clouds show one object, already cut out, and this is against gravity in their frame."""
    camera: tuple[float, ...] = ()
    """Three numbers: where the camera stands in the frame of cut-out clouds, metres; empty: at the origin."""
    object: int = 0
    """Which object of a scene, 0 = the main one."""
    depth_scale: float = 0.0
    """Metres per unit of depth images; 0 takes 0.001 for integers and 1 for floats."""
    frame: str = ""
    """Give grasps in this frame; empty keeps the frame of the input."""
    input_pose: tuple[float, ...] = ()
    """X Y Z QX QY QZ QW: pose of the input's frame in --frame, metres and ROS's order of a quaternion."""
    shown: int = 50
    """Grasps that RViz gets to see."""
    max_age: float = 1.0
    """Seconds after which a view is too old for the trigger service."""
    continuous: bool = True
    """Grasps for every view; otherwise only when the service is called."""

    def __post_init__(self) -> None:
        for name, allowed in (("up", (0, 3)), ("camera", (0, 3)), ("input_pose", (0, 7))):
            values = getattr(self, name)
            if len(values) not in allowed or not all(map(math.isfinite, values)):
                raise OptionError(f"{name} must be {allowed[1]} finite numbers or none, got {list(values)}")
        if self.num < 1 or min(self.shown, self.object, self.seed) < 0:
            raise OptionError("num must be at least 1; shown, object and seed at least 0")
        if not 0 <= self.threshold <= 1 or not 0 <= self.max_failure < 1:
            raise OptionError("threshold and max_failure must be between 0 and 1")
        if not (0 <= self.depth_scale < math.inf and self.max_age > 0):
            raise OptionError("depth_scale must not be negative, and max_age must be positive")
        if self.camera and not self.up:
            raise OptionError("camera is for an object already cut out: give up with it")
        if bool(self.frame) != bool(self.input_pose):
            raise OptionError("frame and input_pose belong together: give both or neither")
        if self.input_pose and abs(math.hypot(*self.input_pose[3:]) - 1) > 1e-3:
            raise OptionError(
                f"the quaternion of input_pose must have length 1, got {list(self.input_pose[3:])}"
            )
