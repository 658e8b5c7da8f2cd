"""Warnings about underlays, interpreter, CMake arguments, stale packages and limits; missing executables."""
