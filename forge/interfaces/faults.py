"""A mistake in one line of a definition, before anybody knows which line of which file."""

from __future__ import annotations


class Fault(Exception):  # noqa: N818  (it never leaves the parser: there it becomes a Problem)
    """What is wrong, at which offset of the text that was being read, and what to do."""

    def __init__(self, message: str, *, offset: int = 0, hint: str | None = None) -> None:
        """Count `offset` from 0."""
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.hint = hint

    def shifted(self, by: int) -> Fault:
        """Return the same fault, seen from a text in which this one starts at `by`."""
        return Fault(self.message, offset=self.offset + by, hint=self.hint)
