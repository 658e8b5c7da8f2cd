"""Observation of build steps: the files that they read, write and execute, and the consequences."""

__all__ = ["accesses", "commands", "observation", "observer", "variables", "world"]
