"""Live ROS topics of a flight, and commands and goals from ROS."""

from skyarm.links.ros.node import Node, RosError
from skyarm.links.ros.ros_link import RosLink, live_session

__all__ = ["Node", "RosError", "RosLink", "live_session", "open_node"]


def open_node(version: int) -> Node:
    """Open a node of ROS 1 or 2, on loopback unless ROS's own environment variables say otherwise.

    Raises:
        RosError: another version, a library or a master that is missing.
    """
    if version == 1:
        from skyarm.links.ros.ros1_node import Ros1Node

        return Ros1Node()
    if version == 2:
        from skyarm.links.ros.ros2_node import Ros2Node

        return Ros2Node()
    raise RosError(f"--ros = {version}: must be 1 or 2")
