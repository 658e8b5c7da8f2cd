"""Finds what the CMake files of packages download, such as the sources of libraries."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.text import counted
from forge.workspace.cmake_text import calls, cmake_files

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.workspace.model import Package

_COMMANDS = frozenset(
    {"ament_vendor", "cpmaddpackage", "externalproject_add", "fetchcontent_declare", "fetchcontent_populate"}
)
_FEW = 10
_REMOTE = re.compile(r"(?:https?|ftp|git|ssh)://\S+|[\w.-]+@[\w.-]+:\S+")


def announced_downloads(packages: Iterable[Package]) -> Problem | None:
    """Return a note on the literal addresses in commands that may download, None if there are none.

    Some of the commands may be in branches that are not taken.
    """
    urls: dict[tuple[str, str], None] = {}
    for package in packages:
        for text in map(text_or_nothing, cmake_files(package.path)):
            if "://" not in text and "@" not in text:
                continue  # reading all words of large files takes time
            for call in calls(text):
                if call.command in _COMMANDS or (call.command == "file" and call.words[:1] == ("DOWNLOAD",)):
                    urls.update(((package.name, url), None) for url in filter(_REMOTE.fullmatch, call.words))
    if not urls:
        return None
    found = list(urls)
    shown = ", ".join(f"{url} ('{name}')" for name, url in found[:_FEW])
    rest = f" and {len(found) - _FEW} more" if len(found) > _FEW else ""
    return Problem(f"this build may download {counted(len(found), 'thing')}: {shown}{rest}")
