"""Extracts metadata from the text of a CMakeLists.txt without running it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.workspace.cmake_text import calls

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

_NAME = re.compile(r"[a-zA-Z0-9_-]+")
_PKG_CONFIG = frozenset({"pkg_check_modules", "pkg_search_module"})
_PKG_CONFIG_FLAGS = frozenset(
    {"GLOBAL", "IMPORTED_TARGET", "NO_CMAKE_ENVIRONMENT_PATH", "NO_CMAKE_PATH", "QUIET", "REQUIRED"}
)
_OPAQUE = frozenset({"include", "add_subdirectory", "macro", "function", "cmake_language"})
"""Commands that may call others."""
_NO_REGISTRATION = frozenset({"find_package", "ament_python_install_package"})
_WORD = re.compile(r"[a-zA-Z][a-zA-Z0-9_-]*")
_SCOPES = frozenset({"PUBLIC", "PRIVATE", "INTERFACE", "SYSTEM"})
_INERT = frozenset(
    {"add_compile_definitions", "add_compile_options", "add_definitions", "add_executable", "add_library"}
    | {"add_link_options", "cmake_minimum_required", "else", "elseif", "enable_testing", "endforeach"}
    | {"endif", "endwhile", "foreach", "if", "include_directories", "install", "link_directories", "list"}
    | {"mark_as_advanced", "math", "message", "option", "project", "set", "set_target_properties", "string"}
    | {"target_compile_definitions", "target_compile_features", "target_compile_options"}
    | {"target_include_directories", "target_link_libraries", "target_sources", "unset", "while"}
)
"""Commands that find_package() does not depend on, unless they change a variable of its search."""
_ELSEWHERE = frozenset({"CONFIGS", "HINTS", "NAMES", "PATHS"})
"""Arguments of find_package() that name other packages or folders."""
_SETTING = frozenset({"foreach", "list", "option", "set", "string", "unset"})
_SEARCH = re.compile(r"_(?:DIR|PATH|PREFIX|ROOT)\b|_INCLUDE|FIND_|PROVIDER|SYSROOT|TOOLCHAIN")


@frozen
class PackageReference:
    """A reference to a package in a CMakeLists.txt, with its line.

    `required` tells whether it is required at the top level of the file, `testing` whether only tests use it.
    """

    name: str
    line: int
    required: bool = False
    testing: bool = False


def project_name(text: str) -> str | None:
    """Return the literal name of the first project() that has one, else None."""
    return next((words[0] for words in _projects(text) if words and _NAME.fullmatch(words[0])), None)


def names_no_literal(text: str) -> bool:
    return any(True for _ in _projects(text))


def is_catkin_toplevel(text: str) -> bool:
    """Tell whether this is the file that catkin_make creates above a source folder."""
    return project_name(text) == "Project" and "catkin_workspace()" in text.splitlines()


def cmake_dependencies(texts: Iterable[str]) -> frozenset[str]:
    """Return the literal names passed to find_package and pkg-config."""
    found: set[str] = set()
    for text in texts:
        if not ("ind_package" in text or "pkg_" in text or "IND_PACKAGE" in text):
            continue  # reading all words of large files takes time
        for call in calls(text):
            # Also wrappers such as catkin_find_package.
            if call.command.endswith("find_package"):
                found.update(filter(_NAME.fullmatch, call.words[:1]))
            elif call.command in _PKG_CONFIG:
                modules = (word for word in call.words[1:] if word not in _PKG_CONFIG_FLAGS)
                found.update(re.split("[<>=]", module, maxsplit=1)[0] for module in modules)
    return frozenset(filter(None, found))


def may_register_package(text: str) -> bool:
    """Tell whether ament_package() is called, or may be called by another file or a macro."""
    commands = {call.command for call in calls(text)}
    return not commands.isdisjoint(_OPAQUE) or any("package" in name for name in commands - _NO_REGISTRATION)


def targets(text: str) -> tuple[str, ...]:
    """Return the targets with literal names, in order; ${PROJECT_NAME} is expanded."""
    name = project_name(text) or ""
    made = (call for call in calls(text) if call.command in {"add_executable", "add_library"} and call.words)
    return tuple(call.words[0].replace("${PROJECT_NAME}", name) for call in made)


def linked_packages(text: str) -> frozenset[str]:
    """Return the packages that targets link, by name or by a target such as NAME::NAME."""
    linking = {"ament_target_dependencies", "target_link_libraries"}
    words = (word for call in calls(text) if call.command in linking for word in call.words[1:])
    return frozenset(word.partition("::")[0] for word in words)


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


def requirements(text: str, is_inert: Callable[[str], bool] = lambda _: True) -> frozenset[str]:
    """Return the packages that CMake certainly looks for, and without which it certainly fails.

    They are those of find_package(NAME REQUIRED) outside of all blocks and before any command that may change
    what is found, or that may end the file: included files, macros, return(), variables of the search.
    `is_inert(name)` tells whether finding another package before them changes nothing.
    """
    found: set[str] = set()
    for call in calls(text):
        if call.command == "find_package" and call.words:
            name = call.words[0]
            if not call.conditions and "REQUIRED" in call.words and _ELSEWHERE.isdisjoint(call.words):
                found.add(name)
            if not is_inert(name):
                break
        elif call.command not in _INERT or (call.command in _SETTING and _sets_search(call.words)):
            break
    return frozenset(filter(_WORD.fullmatch, found))


def changes_search(words: Iterable[str]) -> bool:
    """Tell whether one of the words may be a variable that changes what find_package() finds."""
    return any(map(_SEARCH.search, words))


def _sets_search(words: tuple[str, ...]) -> bool:
    return changes_search(words) or "$" in "".join(words[:2])


def used_by_tests_only(text: str) -> frozenset[str]:
    references = tuple(uses(text))
    return frozenset(use.name for use in references if use.testing) - {
        use.name for use in references if not use.testing
    }


def _projects(text: str) -> Iterator[tuple[str, ...]]:
    return (call.words for call in calls(text) if call.command == "project")
