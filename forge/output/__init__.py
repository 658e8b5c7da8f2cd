"""Output of a build: console, status lines, logs, JSON events.

All reporters listen to the events in `build.events`.
"""

__all__ = ["console", "handlers", "hints", "reporters"]
