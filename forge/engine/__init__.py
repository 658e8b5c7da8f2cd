"""Observation of build steps: the files that they read, write and execute, and the consequences."""

__all__ = ["commands", "observation", "observer", "world"]
