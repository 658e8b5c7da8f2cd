"""Hints for failures with a known cause, derived from the output of compilers, linkers, CMake and Python."""
