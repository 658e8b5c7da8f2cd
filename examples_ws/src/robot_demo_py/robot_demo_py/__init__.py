"""Python programs on the same interfaces as robot_demo_cpp."""
