"""Links to programs on the other side of a socket: autopilots, ROS, servos."""
