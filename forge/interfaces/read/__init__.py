"""Definitions from files: find and parse .msg, .srv, .action and .idl files, and lint them."""

__all__ = ["declarations", "lint", "literals", "parsing", "sources"]
