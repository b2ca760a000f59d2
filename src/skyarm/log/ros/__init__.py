"""Export of flights as ROS messages."""
