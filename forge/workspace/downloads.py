"""Finds what the CMake files of packages download, such as the sources of libraries."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.text import counted
from forge.workspace.cmake_text import calls, cmake_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.workspace.model import Package

_COMMANDS = frozenset(
    {"ament_vendor", "cpmaddpackage", "externalproject_add", "fetchcontent_declare", "fetchcontent_populate"}
)
_FEW = 10
_REMOTE = re.compile(r"(?:https?|ftp|git|ssh)://\S+|[\w.-]+@[\w.-]+:\S+")


def downloads_of(package: Package) -> Iterator[str]:
    """Yield the literal addresses in commands that may download; a branch of them may not be taken."""
    for text in map(text_or_nothing, cmake_files(package.path)):
        if "://" not in text and "@" not in text:
            continue  # reading all words of large files takes time
        for call in calls(text):
            if call.command in _COMMANDS or (call.command == "file" and call.words[:1] == ("DOWNLOAD",)):
                yield from filter(_REMOTE.fullmatch, call.words)


def announced_downloads(packages: Iterable[Package]) -> Problem | None:
    """Return a note on what building the packages may download, None if it is nothing."""
    found = [(package.name, url) for package in packages for url in dict.fromkeys(downloads_of(package))]
    if not found:
        return None
    shown = ", ".join(f"{url} ('{name}')" for name, url in found[:_FEW])
    rest = f" and {len(found) - _FEW} more" if len(found) > _FEW else ""
    return Problem(f"this build may download {counted(len(found), 'thing')}: {shown}{rest}")
