"""Reject folders whose paths contain characters that build tools cannot handle; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_SEPARATORS = {
    ":": "path lists use it as separator",
    ";": "CMake lists use it as separator",
    '"': "CMake's scripts use it as string delimiter",
    "\\": "CMake interprets it as '/'",
}
_SETUPTOOLS_PLACEHOLDERS = dict.fromkeys("$%{}", "setuptools substitutes it")


def path_problems(folders: Iterable[Path], *, python: bool) -> Iterator[Problem]:
    """Yield a problem for each folder with an unsupported character; `python`: with Python packages."""
    reasons = {**_SEPARATORS, **(_SETUPTOOLS_PLACEHOLDERS if python else {})}
    for folder in dict.fromkeys(folders):
        for character in dict.fromkeys(str(folder)):
            reason = "it is a line break" if character in "\n\r" else reasons.get(character)
            if reason:
                hint = "move the workspace, or choose other folders with '--build-base' and '--install-base'"
                message = f"the path '{folder}' contains {character!r}, which is not supported: {reason}"
                yield Problem(message, hint=hint)
                break
