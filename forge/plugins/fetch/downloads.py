"""Finds URLs that packages download during builds, and system libraries that they accept instead.

That is read in the package's own CMakeLists.txt: a library serves only if each way to the download asks for
it before. Vendor packages that download in any case are not satisfied by a library that is installed.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import pairwise

from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.text import listed
from forge.workspace.cmake_text import Call, calls, cmake_files
from forge.workspace.model import DependencyKind, Package

_DOWNLOADING = frozenset({"ament_vendor", "externalproject_add", "fetchcontent_declare"})
_URL = re.compile(r"(?:https?|ftp)://\S+")
_VERSION_LESS = re.compile(r'"?\$\{(.+)_VERSION\}"? VERSION_LESS "?([\d.]+)"?')
_FORCED = "FORCE_BUILD_VENDOR_PKG"
"""The option of vendor packages that is off by default."""


@frozen
class Download:
    url: str
    library: str = ""
    """The package of CMake that prevents the download, '' if none does."""
    version: str = ""
    """Its oldest accepted version, '' for any."""


def downloads(text: str) -> Iterator[Download]:
    """Yield the literal addresses that a CMakeLists.txt downloads from, except for those of git."""
    found = [*calls(text)] if "://" in text else []
    optional = {
        call.words[0]: call.words[1] if re.fullmatch(r"[\d.]+", " ".join(call.words[1:2])) else ""
        for call in found
        if call.command == "find_package" and call.words and "REQUIRED" not in call.words
    }
    for call in found:
        words = call.words
        # Repositories are locked: they do not count as downloads of the build.
        is_git = "GIT_REPOSITORY" in words or ("VCS_URL" in words and is_repository(words))
        is_file = call.command == "file" and words[:1] == ("DOWNLOAD",)
        is_download = is_file or (call.command in _DOWNLOADING and not is_git)
        if is_download and (url := next(filter(_URL.fullmatch, words), None)):
            yield Download(url, *_replacement(call, found, optional))


def is_repository(words: Sequence[str]) -> bool:
    """Return whether the VCS_URL of an ament_vendor() is a repository of git, and not an archive."""
    values = dict(pairwise(words))
    return values.get("VCS_TYPE", "git") == "git"


def _replacement(call: Call, found: Collection[Call], optional: dict[str, str]) -> tuple[str, str]:
    """Return the library whose absence alone triggers a call, and its version; ('', '') without one."""
    if "SATISFIED" in call.words:
        name = call.words[call.words.index("SATISFIED") + 1].removeprefix("${").removesuffix("_FOUND}")
        return (name, optional[name]) if name in optional else ("", "")
    names = {each.words[0].lower() for each in found if each.command in {"macro", "function"} and each.words}
    around = [each.split(" ")[0].lower() for each in call.conditions]
    if macro := next((name for name in around if name in names), None):
        uses = [_needed(each.conditions, optional) for each in found if each.command == macro]
    else:
        uses = [_needed(call.conditions, optional)]
    return uses[0] if uses and len(set(uses)) == 1 else ("", "")


def _needed(conditions: Collection[str], optional: dict[str, str]) -> tuple[str, str]:
    """Return the library whose absence, or whose age, one of the conditions is about, and nothing else."""
    for condition in conditions:
        library, version, others = "", "", False
        for term in condition.split(" OR "):
            if match := re.fullmatch(r"NOT (\S+)_FOUND", term):
                library, others = match[1], others or match[1] not in optional
            elif match := _VERSION_LESS.fullmatch(term):
                version = match[2]
            else:
                others = others or term != _FORCED
        if library and not others:
            return library, version or optional[library]
    return "", ""


def announced(packages: Iterable[Package], keys: Collection[str]) -> Iterator[Problem]:
    """Yield the downloads of each package; `keys` are the rosdep keys of libraries."""
    for package in packages:
        found = {each for path in cmake_files(package.path) for each in downloads(text_or_nothing(path))}
        libraries = sorted(set(keys) & set(package.manifest.names(frozenset({DependencyKind.BUILD}))))
        for each in sorted(found, key=lambda each: each.url):
            message, hint = f"'{package.name}' downloads {each.url} while it is built", None
            if each.library:
                version = f" {each.version} or newer" if each.version else ""
                message += f", unless CMake finds '{each.library}'{version}"
                hint = f"its rosdep key is {listed(libraries)}" if libraries else None
            yield Problem(message, hint=hint)
