"""Versions of interface definitions: `forge interface diff` compares two, `fix` makes valid ones of ROS 1."""
