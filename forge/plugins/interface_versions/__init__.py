"""Versions of interface definitions: `forge interface diff` compares two, `fix` corrects invalid ones, as of
ROS 1."""
