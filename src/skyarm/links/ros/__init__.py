"""Live ROS topics of a flight, and commands and goals from ROS."""

from skyarm.links.ros.node import Node, RosError
from skyarm.links.ros.ros_link import RosLink, live_session

__all__ = ["Node", "RosError", "RosLink", "live_session", "open_node"]


def open_node(version: int) -> Node:
    """Open a node of ROS 2, on loopback unless ROS's own environment variables say
    otherwise.

    Raises:
        RosError: another version, or the library is missing.
    """
    if version != 2:
        raise RosError(
            f"--ros = {version}: must be 2; ROS 1 ended in May 2025, and ros1_bridge"
            " connects its nodes to --ros 2"
        )
    from skyarm.links.ros.ros2_node import Ros2Node

    return Ros2Node()
