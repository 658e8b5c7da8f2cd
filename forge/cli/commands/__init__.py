"""One module per command with the functions register(parser) and run(options) -> exit code."""

__all__ = ["interface", "list"]
