"""What the steps of a build read, write and execute, and what follows for the next build."""

__all__ = ["commands", "observation", "observer", "world"]
