"""Text for files that CMake reads."""

from __future__ import annotations

import re


def quoted(*elements: str) -> str:
    """Return a quoted CMake argument: the list of the elements, which may contain any character."""
    escaped = (re.sub(r'([\\"$])', r"\\\1", element).replace(";", r"\;") for element in elements)
    return '"' + ";".join(escaped) + '"'
