"""Output of a build: console, logs, JSON events, and what plugins add: hints and reporters.

All reporters listen to the events in `build.events`.
"""

__all__ = ["console", "handlers", "hints", "logs", "reporters"]
