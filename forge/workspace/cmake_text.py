"""Reads CMake files by CMake's grammar; nothing is evaluated: CMake may run each of the calls, or none."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.workspace.model import CMAKE_TYPES, Package
from forge.workspace.source_names import is_environment, may_contain_packages

_TOKEN = re.compile(
    r"(?P<gap>[ \t\r\n\f\v;\ufeff]+|\#\[(=*)\[.*?\]\2\]|\#(?!\[=*\[)[^\n]*)"
    r"|(?P<parenthesis>[()])"
    r"|\[(?P<level>=*)\[(?P<bracket>.*?)\](?P=level)\]"
    r'|"(?P<string>(?:[^"\\]|\\.)*)"'
    r'|(?P<word>(?!\[=*\[)(?:[^\s()#"\\;]|\\.)+(?:"(?:[^"\\]|\\.)*"(?:[^\s()#"\\;]|\\.)*)*)',
    re.DOTALL,
)
_OPENING = frozenset({"block", "elseif", "else", "foreach", "function", "if", "macro", "while"})
_CLOSING = frozenset(
    {"elseif", "else", "endblock", "endforeach", "endfunction", "endif", "endmacro", "endwhile"}
)

_LITERAL = re.compile(r"[a-zA-Z0-9_-]+")
_PACKAGE = re.compile(r"[a-zA-Z][a-zA-Z0-9_-]*")
_PKG_CONFIG = frozenset({"pkg_check_modules", "pkg_search_module"})
_PKG_CONFIG_FLAGS = frozenset(
    {"GLOBAL", "IMPORTED_TARGET", "NO_CMAKE_ENVIRONMENT_PATH", "NO_CMAKE_PATH", "QUIET", "REQUIRED"}
)
_SCOPES = frozenset({"PUBLIC", "PRIVATE", "INTERFACE", "SYSTEM"})

_BEFORE_PROJECT = frozenset({"cmake_minimum_required", "cmake_policy", "message", "set"})
PROJECT_DETAILS = frozenset({"COMPAT_VERSION", "DESCRIPTION", "HOMEPAGE_URL", "SPDX_LICENSE", "VERSION"})
_ENABLING = frozenset({"enable_language", "project"})
_WITHOUT_CXX = frozenset({"ASM", "C", "Fortran", "NONE", "OPTIONAL"})
"""Languages that need no C++ compiler, and other keywords of project(). Any other word may be a variable."""


@frozen
class Call:
    """A call of a command in lower case; `conditions` are the arguments of the blocks around it."""

    command: str
    words: tuple[str, ...]
    line: int
    conditions: tuple[str, ...] = ()


@frozen
class PackageReference:
    """A package in a CMakeLists.txt; `required` at its top level, or `testing` if only tests use it."""

    name: str
    line: int
    required: bool
    testing: bool


def calls(text: str) -> Iterator[Call]:
    """Yield the calls in order, up to the first text that CMake cannot parse."""
    conditions: list[str] = []
    words: list[str] = []
    command, depth, end = "", 0, 0
    line, counted_to, start = 1, 0, 0
    for token in _TOKEN.finditer(text):
        if token.start() != end:
            return
        end = token.end()
        kind = token.lastgroup or ""
        word = token[kind]
        if kind == "gap":
            continue
        if depth:
            depth += (word == "(") - (word == ")") if kind == "parenthesis" else 0
            if depth:
                words.append(word)
                continue
            line += text.count("\n", counted_to, start)
            counted_to = start
            if command in _CLOSING and conditions:
                conditions.pop()
            yield Call(command, tuple(words), line, tuple(conditions))
            if command in _OPENING:
                conditions.append(" ".join(words))
            command = ""
        elif word == "(" and kind == "parenthesis" and command:
            words, depth = [], 1
        elif kind == "word" and not command:
            command, start = word.lower(), token.start()
        else:
            return


def cmake_files(folder: Path) -> Iterator[str]:
    """Yield the paths of all CMake files below a folder, except hidden and installed ones."""
    for place, folders, names in os.walk(folder):
        if place != os.fspath(folder) and is_environment({*folders, *names}.__contains__):
            folders.clear()
            continue
        folders[:] = sorted(filter(may_contain_packages, folders))
        for name in sorted(names):
            if name == "CMakeLists.txt" or name.endswith(".cmake"):
                yield f"{place}/{name}"


def project_name(text: str) -> str | None:
    """Return the literal name of the first project() with one, '' if none has one, None without project()."""
    name = None
    for call in calls(text):
        if call.command == "project":
            if call.words and _LITERAL.fullmatch(call.words[0]):
                return call.words[0]
            name = ""
    return name


def cmake_dependencies(texts: Iterable[str]) -> frozenset[str]:
    """Return the literal names passed to find_package and pkg-config."""
    names: set[str] = set()
    for text in texts:
        if not ("ind_package" in text or "pkg_" in text or "IND_PACKAGE" in text):
            continue  # parsing large files completely takes time
        for call in calls(text):
            # Includes wrappers such as catkin_find_package.
            if call.command.endswith("find_package"):
                names.update(filter(_LITERAL.fullmatch, call.words[:1]))
            elif call.command in _PKG_CONFIG:
                modules = (word for word in call.words[1:] if word not in _PKG_CONFIG_FLAGS)
                names.update(re.split("[<>=]", module, maxsplit=1)[0] for module in modules)
    return frozenset(filter(None, names))


def package_references(text: str) -> Iterator[PackageReference]:
    """Yield the packages referenced by a literal name; none is required after a return()."""
    returned = False
    for call in calls(text):
        returned = returned or call.command == "return"
        testing = any("BUILD_TESTING" in condition for condition in call.conditions)
        match call.command:
            case "find_package":
                names = call.words[:1]
            case "ament_target_dependencies":
                names = call.words[1:]
            case "rosidl_generate_interfaces" if "DEPENDENCIES" in call.words:
                names = call.words[call.words.index("DEPENDENCIES") + 1 :]
            case _:
                continue
        optional = call.command == "find_package" and "REQUIRED" not in call.words
        required = not (call.conditions or returned or optional)
        for name in names:
            if _PACKAGE.fullmatch(name) and name not in _SCOPES:
                yield PackageReference(name, call.line, required, testing)


def compiled_packages(packages: Iterable[Package]) -> list[Package]:
    """Return the packages whose project() enables a language, that is, unless it specifies NONE."""
    compiled = []
    for package in packages:
        text = _project_text(package) if package.build_type in CMAKE_TYPES else ""
        project = next((call for call in calls(text) if call.command == "project"), None)
        if text and (project is None or "NONE" not in project.words):
            compiled.append(package)
    return compiled


def any_enables_cxx(packages: Iterable[Package]) -> bool:
    """Return whether one of the packages may enable C++ in any of its CMake files."""
    for package in compiled_packages(packages):
        has_project = any(call.command in _ENABLING for call in calls(_project_text(package)))
        if not has_project or any(map(enables_cxx, map(text_or_nothing, cmake_files(package.path)))):
            return True
    return False


def enables_cxx(text: str) -> bool:
    """Return whether a CMake file may enable C++, as project() does unless it lists other languages."""
    for call in calls(text):
        words = [word for word in call.words if word != "LANGUAGES"]
        if call.command == "project":
            details = [at for at, word in enumerate(words) if word in PROJECT_DETAILS]
            words = [word for at, word in enumerate(words) if at and not {at, at - 1} & {*details}]
        if call.command in _ENABLING and (not words or not _WITHOUT_CXX.issuperset(words)):
            return True
    return False


def _project_text(package: Package) -> str:
    return text_or_nothing(package.path / "CMakeLists.txt")


def certainly_compiles(text: str) -> bool:
    """Return whether project() enables C or C++, and no command before it may choose a compiler."""
    for call in calls(text):
        if call.command == "project" and not call.conditions:
            following = call.words[1] if call.words[1:] else "VERSION"
            named = not {"C", "CXX"}.isdisjoint(call.words)
            return named or (following in PROJECT_DETAILS and "LANGUAGES" not in call.words)
        if call.command not in _BEFORE_PROJECT or "COMPILER" in str(call.words):
            return False
    return False
