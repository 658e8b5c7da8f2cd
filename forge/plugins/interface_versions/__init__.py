"""Versions of interface definitions.

`forge interface diff` compares two, `fix` corrects invalid ones, such as those of ROS 1.
"""
