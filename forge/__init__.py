"""Build ROS 2 workspaces and compile ROS 2 interfaces, with or without ROS."""

__version__ = "0.1.0"
