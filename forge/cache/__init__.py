"""The options and the data model of the package cache, which is a plugin."""

__all__ = ["model", "options"]
