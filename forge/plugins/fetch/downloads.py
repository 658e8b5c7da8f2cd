"""Finds URLs that packages download during builds, and system libraries that they accept instead.

Both are read from the package's own CMakeLists.txt: a library counts only if each path to the download checks
for it first. Vendor packages that always download are not satisfied by an installed library.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.text import listed
from forge.toolchain.programs import find_cmake
from forge.workspace.cmake_text import Call, calls, cmake_files
from forge.workspace.model import DependencyKind, Package

_DOWNLOADING = frozenset({"ament_vendor", "externalproject_add", "fetchcontent_declare"})
_URL = re.compile(r"(?:https?|ftp)://\S+")
_VERSION_LESS = re.compile(r'"?\$\{(.+)_VERSION\}"? VERSION_LESS "?([\d.]+)"?')
_FORCED = "FORCE_BUILD_VENDOR_PKG"
"""The option of vendor packages that is off by default."""
_OTHER_SYSTEMS = frozenset({"ANDROID", "APPLE", "MSVC", "WIN32"})
_NAME = re.compile(r"[\w.+-]+")
_VARIABLE = re.compile(r"\$\{(\w+)\}")


@frozen
class Download:
    url: str
    library: str = ""
    """The package of CMake that prevents the download, '' if none does."""
    requested: str = ""
    """The version that find_package() is called with, '' for any."""
    oldest: str = ""
    """The oldest version of the found package that is accepted, '' for any."""


def linux_calls(text: str) -> list[Call]:
    """Return the calls that may run on Linux, with the values of variables that are set to a single one."""
    values: dict[str, str] = {}
    several: set[str] = set()

    def expanded(word: str) -> str:
        return _VARIABLE.sub(lambda match: values.get(match[1], match[0]), word)

    def may_run(call: Call) -> bool:
        terms = {term for each in call.conditions for term in each.split(" AND ") if " OR " not in each}
        return _OTHER_SYSTEMS.isdisjoint(terms) and all(values.get(term) != "OFF" for term in terms)

    all_calls = [*calls(text)]
    for call in filter(may_run, all_calls):
        if call.command == "set" and call.words:
            name, *words = map(expanded, call.words)
            value = " ".join(words[: words.index("CACHE")] if "CACHE" in words else words)
            if values.setdefault(name, value) != value:
                several.add(name)
    for name in several:
        del values[name]
    running = [call for call in all_calls if may_run(call)]
    unused = {call.command for call in all_calls} - {call.command for call in running}  # among others, macros
    return [
        replace(
            call, words=tuple(map(expanded, call.words)), conditions=tuple(map(expanded, call.conditions))
        )
        for call in running
        if unused.isdisjoint(each.split(" ")[0].lower() for each in call.conditions)
    ]


def downloads(text: str) -> Iterator[Download]:
    """Yield the literal addresses that a CMakeLists.txt downloads from, except for those of git."""
    cmake_calls = linux_calls(text) if "://" in text else []
    optional = {
        call.words[0]: call.words[1] if re.fullmatch(r"[\d.]+", " ".join(call.words[1:2])) else ""
        for call in cmake_calls
        if call.command == "find_package" and call.words and "REQUIRED" not in call.words
    }
    for call in cmake_calls:
        words = call.words
        # Repositories are locked: they do not count as downloads of the build.
        is_git = "GIT_REPOSITORY" in words or ("VCS_URL" in words and is_repository(words))
        is_file = call.command == "file" and words[:1] == ("DOWNLOAD",)
        is_download = is_file or (call.command in _DOWNLOADING and not is_git)
        if is_download and (url := next(filter(_URL.fullmatch, words), None)):
            yield Download(url, *_replacement(call, cmake_calls, optional))


def is_repository(words: Sequence[str]) -> bool:
    """Return whether the VCS_URL of an ament_vendor() is a repository of git, and not an archive."""
    values = dict(pairwise(words))
    return values.get("VCS_TYPE", "git") == "git"


def _replacement(call: Call, cmake_calls: Collection[Call], optional: dict[str, str]) -> tuple[str, str, str]:
    """Return the library whose absence alone triggers a call, and its versions; '' for missing values."""
    if "SATISFIED" in call.words:
        name = call.words[call.words.index("SATISFIED") + 1].removeprefix("${").removesuffix("_FOUND}")
        return (name, optional[name], "") if name in optional else ("", "", "")
    names = {
        each.words[0].lower() for each in cmake_calls if each.command in {"macro", "function"} and each.words
    }
    condition_words = [each.split(" ")[0].lower() for each in call.conditions]
    if macro := next((name for name in condition_words if name in names), None):
        uses = [_needed(each.conditions, optional) for each in cmake_calls if each.command == macro]
    else:
        uses = [_needed(call.conditions, optional)]
    return uses[0] if uses and len(set(uses)) == 1 else ("", "", "")


def _needed(conditions: Collection[str], optional: dict[str, str]) -> tuple[str, str, str]:
    """Return the library whose absence or age is the only subject of one of the conditions."""
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
            return library, optional[library], version
    return "", "", ""


def announced(
    packages: Iterable[Package], keys: Collection[str], variables: Mapping[str, str]
) -> Iterator[Problem]:
    """Yield the downloads of each package, except those that an installed library prevents.

    `keys` are the rosdep keys of libraries, `variables` the environment in which CMake looks for them.
    """
    package_downloads = {
        (package, each)
        for package in packages
        for path in cmake_files(package.path)
        for each in downloads(text_or_nothing(path))
    }
    needed = {
        (each.library, each.requested, each.oldest): package.path
        for package, each in package_downloads
        if each.library
    }
    installed = _installed(needed, variables)
    for package, each in sorted(package_downloads, key=lambda pair: (pair[0].name, pair[1].url)):
        if (each.library, each.requested, each.oldest) in installed:
            continue
        message, hint = f"'{package.name}' downloads {each.url} while it is built", None
        if each.library:
            version = each.oldest or each.requested
            newer = f" {version} or newer" if version else ""
            message += f", unless CMake finds '{each.library}'{newer}"
            names = sorted(set(keys) & set(package.manifest.names(frozenset({DependencyKind.BUILD}))))
            if names:
                hint = f"its rosdep key is {'one of ' * (len(names) > 1)}{listed(names)}"
        yield Problem(message, hint=hint)


def _installed(
    libraries: Mapping[tuple[str, str, str], Path], variables: Mapping[str, str]
) -> set[tuple[str, str, str]]:
    """Return the libraries, with requested and oldest versions, that CMake finds for these packages."""
    named_libraries = {key: path for key, path in libraries.items() if _NAME.fullmatch(key[0])}
    cmake = find_cmake(variables)
    if not named_libraries or cmake is None:
        return set()
    lines = ["cmake_minimum_required(VERSION 3.10)", "project(libraries)"]
    for (name, requested, oldest), path in named_libraries.items():
        is_new = f' AND NOT "${{{name}_VERSION}}" VERSION_LESS {oldest}' if oldest else ""
        modules = {Path(file).parent for file in cmake_files(path) if Path(file).name == f"Find{name}.cmake"}
        lines += [
            f"set(CMAKE_MODULE_PATH {' '.join(f'[==[{each}]==]' for each in sorted(modules))})",
            f"find_package({name} {requested} QUIET)",
            f"if({name}_FOUND{is_new})",
            f'  file(APPEND found.txt "{name} {requested} {oldest}\\n")',
            "endif()",
        ]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "CMakeLists.txt").write_text("\n".join(lines))
        subprocess.run(
            (str(cmake), "-S", folder, "-B", f"{folder}/build", "-Wno-dev", "-Wno-deprecated"),
            env=dict(variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
        )
        rows = text_or_nothing(Path(folder, "found.txt")).splitlines()
    return {key for key in named_libraries if " ".join(key) in rows}
