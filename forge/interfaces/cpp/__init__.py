"""The C++17 target: headers with the paths and names of rosidl_generator_cpp."""

__all__ = ["headers", "text"]
