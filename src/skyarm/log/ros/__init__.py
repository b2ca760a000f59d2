"""A flight as messages of ROS."""
