"""Observation of build steps: what they read, write and execute, and the consequences."""

__all__ = ["commands", "observation", "observer", "world"]
