"""Definitions from files: find and parse .msg, .srv, .action and .idl files."""

__all__ = ["declarations", "literals", "parsing", "sources"]
