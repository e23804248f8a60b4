"""The ROS 2 node: clouds or depth images in, ranked grasps out.

`from_messages` and `to_messages` know messages but no middleware, `pipeline` knows neither, `latest` is the
thread between them, and `node` is the only file that imports `rclpy`.
"""
