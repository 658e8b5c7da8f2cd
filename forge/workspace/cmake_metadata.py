"""Extracts metadata from the text of a CMakeLists.txt without running it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_NAME = r"""("?)([a-zA-Z0-9_-]+)\1"""
_COMMENT = re.compile(r"""("[^"\n]*")|#[^\n]*""")
_PROJECT = re.compile(rf"(?i:project)\s*\(\s*{_NAME}(\s+[^)]*)?\)")
_ANY_PROJECT = re.compile(r"(?i:\bproject)\s*\(")
# Also matches wrappers such as catkin_find_package.
_FIND_PACKAGE = re.compile(rf"(?i:find_package)\s*\(\s*{_NAME}(\s+[^)]*)?\)")
_PKG_CONFIG = re.compile(
    r"(?i:pkg_check_modules|pkg_search_module)\s*\(\s*(\"?)[a-zA-Z0-9_]+\1"
    r"(?:\s+(?:REQUIRED|QUIET|NO_CMAKE_PATH|NO_CMAKE_ENVIRONMENT_PATH))*([^)]+)\)"
)
_CALL = re.compile(
    r"\b(if|elseif|else|endif|find_package|ament_target_dependencies|rosidl_generate_interfaces"
    r"|ament_python_install_package|cmake_minimum_required|add_executable|add_library"
    r"|(?:end)?(?:function|macro)|return)\s*\(",
    re.IGNORECASE,
)
_COMMAND = re.compile(r"\b(\w+)\s*\(")
_OPAQUE = frozenset({"include", "add_subdirectory", "macro", "function", "cmake_language"})
"""Commands that may call others."""
_NO_REGISTRATION = frozenset({"find_package", "ament_python_install_package"})
_WORD = re.compile(r"[a-zA-Z][a-zA-Z0-9_-]*")
_OPENING = frozenset({"if", "elseif", "else", "function", "macro"})
_CLOSING = frozenset({"elseif", "else", "endif", "endfunction", "endmacro"})
_SCOPES = frozenset({"PUBLIC", "PRIVATE", "INTERFACE", "SYSTEM"})


@frozen
class PackageReference:
    """A reference to a package in a CMakeLists.txt, with its line.

    `required` tells whether configuration fails without it, `testing` whether only tests use it.
    """

    name: str
    line: int
    required: bool = False
    testing: bool = False


@frozen
class Call:
    """A call of a command: its lower-case name, arguments, line, and enclosing conditions."""

    command: str
    words: tuple[str, ...]
    line: int
    conditions: tuple[str, ...] = ()


def project_name(text: str) -> str | None:
    """Return the literal name of the first project() that has one, else None."""
    match = _PROJECT.search(_without_comments(text))
    return match[2] if match else None


def names_no_literal(text: str) -> bool:
    """Tell whether there is a project() with a name that is not a literal."""
    return _ANY_PROJECT.search(_without_comments(text)) is not None


def is_catkin_toplevel(text: str) -> bool:
    """Tell whether this is the file that catkin_make creates above a source folder."""
    return project_name(text) == "Project" and "catkin_workspace()" in text.splitlines()


def cmake_dependencies(texts: Iterable[str]) -> frozenset[str]:
    """Return the literal names passed to find_package and pkg-config."""
    content = "\n".join(map(_without_comments, texts))
    found = {match[2] for match in _FIND_PACKAGE.finditer(content)}
    for match in _PKG_CONFIG.finditer(content):
        found.update(re.split("[<>=]", module, maxsplit=1)[0] for module in match[2].split())
    return frozenset(filter(None, found))


def may_register_package(text: str) -> bool:
    """Tell whether ament_package() is called, or may be called by another file or a macro."""
    commands = {match[1].lower() for match in _COMMAND.finditer(_without_comments(text))}
    return not commands.isdisjoint(_OPAQUE) or any("package" in name for name in commands - _NO_REGISTRATION)


def calls(text: str) -> Iterator[Call]:
    """Yield the calls that concern other packages, in order."""
    content = _without_comments(text)
    conditions: list[str] = []
    line, seen = 1, 0
    for match in _CALL.finditer(content):
        command = match[1].lower()
        line += content.count("\n", seen, match.start())
        seen = match.start()
        words = _words(content, match.end())
        if command in _CLOSING and conditions:
            conditions.pop()
        if command in _OPENING:
            conditions.append(" ".join(words))
        elif command not in _CLOSING:
            yield Call(command, words, line, tuple(conditions))


def targets(text: str) -> tuple[str, ...]:
    """Return the targets with literal names, in order; ${PROJECT_NAME} is expanded."""
    name = project_name(text) or ""
    made = (call for call in calls(text) if call.command in {"add_executable", "add_library"} and call.words)
    return tuple(call.words[0].replace("${PROJECT_NAME}", name) for call in made)


def uses(text: str) -> Iterator[PackageReference]:
    """Yield the packages referenced by a literal name; none is required after a return()."""
    returned = False
    for call in calls(text):
        returned = returned or call.command == "return"
        testing = any("BUILD_TESTING" in condition for condition in call.conditions)
        names: tuple[str, ...] = ()
        if call.command == "find_package":
            names = call.words[:1]
        elif call.command == "ament_target_dependencies":
            names = call.words[1:]
        elif call.command == "rosidl_generate_interfaces" and "DEPENDENCIES" in call.words:
            names = call.words[call.words.index("DEPENDENCIES") + 1 :]
        sure = not (call.conditions or returned) and (
            call.command != "find_package" or "REQUIRED" in call.words
        )
        for name in names:
            if _WORD.fullmatch(name) and name not in _SCOPES:
                yield PackageReference(name, call.line, sure, testing)


def requirements(text: str) -> frozenset[str]:
    """Return the packages without which configuration certainly fails."""
    return frozenset(use.name for use in uses(text) if use.required)


def used_by_tests_only(text: str) -> frozenset[str]:
    """Return the packages that only tests use."""
    references = tuple(uses(text))
    return frozenset(use.name for use in references if use.testing) - {
        use.name for use in references if not use.testing
    }


def _words(content: str, start: int) -> tuple[str, ...]:
    """Return the unquoted arguments up to the closing parenthesis of a call."""
    depth, at = 1, start
    while at < len(content) and depth:
        depth += {"(": 1, ")": -1}.get(content[at], 0)
        at += 1
    return tuple(word.strip('"') for word in content[start : at - 1].split())


def _without_comments(text: str) -> str:
    """Return the text up to its last ')' without comments, which bounds the search of patterns."""
    plain = _COMMENT.sub(lambda match: match[1] or "", text)
    return plain[: plain.rfind(")") + 1]
