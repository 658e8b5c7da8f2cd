"""The one error of the wire format."""

from __future__ import annotations


class CdrError(ValueError):
    """Bytes that are no message of the type, or a message that cannot be written.

    `offset` counts all bytes, the header's four included: where reading or writing could not go on.
    """

    def __init__(self, problem: str, offset: int = 0) -> None:
        """Say what is wrong, and where."""
        super().__init__(f"{problem}, at offset {offset}")
        self.problem = problem
        self.offset = offset

    def __reduce__(self) -> tuple[type[CdrError], tuple[str, int]]:
        """Let the error be pickled, as those of worker processes are."""
        return type(self), (self.problem, self.offset)
