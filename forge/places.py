"""Folders whose names a build cannot do with, for the tools below take them for something else; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_SEPARATORS = {
    ":": "lists of folders are separated by it",
    ";": "CMake's lists are separated by it",
    '"': "CMake's own scripts end a text with it",
    "\\": "CMake takes it for a '/'",
}
_OF_PYTHON = dict.fromkeys("$%{}", "setuptools puts something else in its place")


def unfit_folders(folders: Iterable[Path], *, python: bool) -> Iterator[Problem]:
    """Yield a problem for each folder that no build works in; `python`: with Python packages."""
    reasons = {**_SEPARATORS, **(_OF_PYTHON if python else {})}
    for folder in dict.fromkeys(folders):
        for sign in dict.fromkeys(str(folder)):
            why = "a line ends with it" if sign in "\n\r" else reasons.get(sign)
            if why:
                hint = "move the workspace, or name other folders with '--build-base' and '--install-base'"
                message = f"nothing can be built in '{folder}', for {sign!r} is in its name: {why}"
                yield Problem(message, hint=hint)
                break
