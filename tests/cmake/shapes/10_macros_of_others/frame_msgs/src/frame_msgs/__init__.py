"""Frames."""

ORIGIN = (0.0, 0.0, 0.0)
