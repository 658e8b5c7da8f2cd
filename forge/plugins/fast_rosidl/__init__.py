"""Builds interface packages with a ROS distribution's own rosidl faster.

Its generators, and scripts of ament, run in one preloaded process, and generated sources are compiled
together.
"""
