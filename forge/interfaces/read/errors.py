"""The error that parsers of lines and expressions raise, before file and line are known."""

from __future__ import annotations


class ParseError(Exception):
    """An error message, its offset in the parsed text, and a hint."""

    def __init__(self, message: str, *, offset: int = 0, hint: str | None = None) -> None:
        """Count `offset` from 0."""
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.hint = hint

    def shifted(self, by: int) -> ParseError:
        """Return the same error with its offset increased by `by`."""
        return ParseError(self.message, offset=self.offset + by, hint=self.hint)
