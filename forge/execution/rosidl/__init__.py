"""Run a ROS distribution's own interface generators in one warm process, and compile their output faster."""
