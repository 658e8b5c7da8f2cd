"""Compares used packages with declared dependencies."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.errors import GroupedProblems, Location, Problem
from forge.base.frozen import frozen
from forge.base.graph import closure
from forge.workspace.cmake_text import package_references
from forge.workspace.model import TEST_KINDS, DependencyKind
from forge.workspace.python_metadata import imported_modules, mentioned_modules
from forge.workspace.resolve import ALL_KINDS, is_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.workspace.model import Package

_TESTS = frozenset({"test", "tests", "testing"})
_SILENT_BEGINNINGS = ("ament_", "rosidl_", "rmw_")
_SILENT = frozenset({"ros2launch", "launch", "launch_ros", "action_msgs"})
"""Dependencies that need no reference in files of the package."""


@frozen
class KnownPackages:
    """The packages in reach: known names, owners of modules, and dependencies.

    `near` are the packages of the workspace, which must be built before their dependents.
    """

    known: frozenset[str]
    near: frozenset[str]
    modules: Mapping[str, str]
    needs: Mapping[str, frozenset[str]]

    def knows(self, name: str) -> bool:
        """Tell whether a name is a package in reach or certainly a ROS package."""
        return name in self.known or is_ros_name(name)

    def owner(self, module: str) -> str | None:
        """Return the package that provides a Python module."""
        return self.modules.get(module) or (module if is_ros_name(module) else None)


@frozen
class Findings:
    """Problems by severity."""

    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


def undeclared_in_cmake(package: Package, text: str, path: Path, around: KnownPackages) -> Findings:
    """Return packages that a CMakeLists.txt uses without declaring them, each once.

    It is an error if CMake certainly fails: a required package of the workspace that no declared dependency
    provides transitively.
    """
    declared = _declared(package)
    below = closure(around.needs, around.needs.get(package.name, frozenset()))
    errors, warnings, notes = [], [], []
    reported: set[str] = set()
    for use in package_references(text):
        if use.name in declared or use.name in reported or not around.knows(use.name):
            continue
        reported.add(use.name)
        problem = _undeclared(package, use.name, Location(path, use.line), testing=use.testing)
        if use.name in below:
            notes.append(problem)
        elif use.required and use.name in around.near:
            errors.append(problem)
        else:
            warnings.append(problem)
    return Findings(tuple(errors), tuple(warnings), tuple(notes))


def undeclared_in_python(
    package: Package, texts: Iterable[tuple[Path, str]], around: KnownPackages
) -> Findings:
    """Return packages that Python files import without declaring them, each once."""
    declared = _declared(package)
    below = closure(around.needs, around.needs.get(package.name, frozenset()))
    warnings: list[Problem] = []
    notes: list[Problem] = []
    reported: set[str] = set()
    for path, text in texts:
        # Parse only files with candidate lines, because parsing is slow.
        if (declared | reported).issuperset(filter(None, map(around.owner, mentioned_modules(text)))):
            continue
        for module, line in _imports(text):
            name = around.owner(module)
            if name is None or name in declared or name in reported:
                continue
            reported.add(name)
            testing = not _TESTS.isdisjoint(path.parts)
            problem = _undeclared(package, name, Location(path, line), testing=testing, only_run=not testing)
            # Launch files rarely declare dependencies and run in a complete system.
            mild = name in below or path.name.endswith((".launch.py", "_launch.py"))
            (notes if mild else warnings).append(problem)
    return Findings((), tuple(warnings), tuple(notes))


def unused(
    package: Package, known: frozenset[str], mentions: Callable[[re.Pattern[str]], Iterator[str]]
) -> Iterator[Problem]:
    """Yield declared build and run dependencies that no other file of the package mentions.

    `mentions` yields matches of a pattern in all files except the manifest. Metapackages, which have neither
    sources nor CMake calls, are skipped.
    """
    wanted = {
        dependency.name
        for dependency in package.manifest.dependencies
        if dependency.name in known
        and dependency.kinds & {DependencyKind.BUILD, DependencyKind.EXEC}
        and not dependency.name.startswith(_SILENT_BEGINNINGS)
        and dependency.name not in _SILENT
    }
    if not wanted:
        return
    pattern = re.compile(rf"(?<![\w-])(?:{'|'.join(map(re.escape, sorted(wanted)))})(?![\w-])")
    for found in mentions(pattern):
        wanted.discard(found)
        if not wanted:
            return
    for name in sorted(wanted):
        message = f"'{package.name}' declares '{name}', but none of its files mentions it"
        kind = GroupedProblems(
            f"{{}} declare '{name}', but none of their files mentions it",
            package.name,
            "remove the line from each package.xml that does not need it",
        )
        yield Problem(message, Location(package.manifest.path), "remove the line if it is not needed", kind)


def _declared(package: Package) -> frozenset[str]:
    return frozenset((package.name, *package.manifest.names(ALL_KINDS | TEST_KINDS | {DependencyKind.DOC})))


def _undeclared(
    package: Package, name: str, place: Location, *, testing: bool, only_run: bool = False
) -> Problem:
    tag = "test_depend" if testing else "exec_depend" if only_run else "depend"
    return Problem(
        f"'{package.name}' uses '{name}' without declaring it in its manifest",
        place,
        f"add <{tag}>{name}</{tag}> to {package.manifest.path}",
        GroupedProblems(
            f"{{}} use '{name}' without declaring it in their manifests",
            package.name,
            f"add <{tag}>{name}</{tag}> to each package.xml",
        ),
    )


def _imports(text: str) -> Iterator[tuple[str, int]]:
    try:
        yield from imported_modules(text)
    except (SyntaxError, ValueError, RecursionError):
        return
