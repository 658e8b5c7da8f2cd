"""The error of serialization."""

from __future__ import annotations


class CdrError(ValueError):
    """Invalid data, or a message that cannot be serialized.

    `offset` is the position of the error, including the four bytes of the header.
    """

    def __init__(self, problem: str, offset: int = 0) -> None:
        """Store the reason, the field and the offset."""
        super().__init__(f"{problem}, at offset {offset}")
        self.problem = problem
        self.offset = offset

    def __reduce__(self) -> tuple[type[CdrError], tuple[str, int]]:
        """Support pickling, for errors of worker processes."""
        return type(self), (self.problem, self.offset)
