"""What packages use and do not declare, and what they declare and never mention; pure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.cmake_reading import uses
from forge.errors import Place, Problem
from forge.frozen import frozen
from forge.graph import closure
from forge.model import TEST_KINDS, Kind
from forge.provision import ALL_KINDS, is_ros_name
from forge.python_reading import imported_modules, mentioned_modules

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.model import Package

_TESTS = frozenset({"test", "tests", "testing"})
_SILENT_BEGINNINGS = ("ament_", "rosidl_", "rmw_")
_SILENT = frozenset({"ros2launch", "launch", "launch_ros", "action_msgs"})
"""Dependencies that work by being there: nobody needs to mention them."""


@frozen
class Surroundings:
    """What packages may use: all that is known by name, who has which module, and who needs whom.

    `near` are the packages of the workspace itself: what is in there must be built before.
    """

    known: frozenset[str]
    near: frozenset[str]
    modules: Mapping[str, str]
    needs: Mapping[str, frozenset[str]]

    def knows(self, name: str) -> bool:
        """Tell if a name is a package: one in reach, or one of ROS that need not be there."""
        return name in self.known or is_ros_name(name)

    def owner(self, module: str) -> str | None:
        """Return the package that has a module of Python."""
        return self.modules.get(module) or (module if is_ros_name(module) else None)


@frozen
class Grades:
    """Problems by how much they matter."""

    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


def undeclared_in_cmake(package: Package, text: str, path: Path, around: Surroundings) -> Grades:
    """Return what a CMakeLists.txt asks for and the manifest does not; each name once.

    It is an error where CMake is sure to stop over it: the package of the workspace is required, and
    nothing else that is declared brings it along.
    """
    declared = _declared(package)
    below = closure(around.needs, around.needs.get(package.name, frozenset()))
    errors, warnings, notes = [], [], []
    told: set[str] = set()
    for use in uses(text):
        if use.name in declared or use.name in told or not around.knows(use.name):
            continue
        told.add(use.name)
        problem = _undeclared(package, use.name, Place(path, use.line), testing=use.testing)
        if use.name in below:
            notes.append(problem)
        elif use.required and use.name in around.near:
            errors.append(problem)
        else:
            warnings.append(problem)
    return Grades(tuple(errors), tuple(warnings), tuple(notes))


def undeclared_in_python(package: Package, texts: Iterable[tuple[Path, str]], around: Surroundings) -> Grades:
    """Return what Python files import and the manifest does not name; each package once."""
    declared = _declared(package)
    below = closure(around.needs, around.needs.get(package.name, frozenset()))
    warnings: list[Problem] = []
    notes: list[Problem] = []
    told: set[str] = set()
    for path, text in texts:
        # Reading a file as Python does is slow; most files need not be.
        if (declared | told).issuperset(filter(None, map(around.owner, mentioned_modules(text)))):
            continue
        for module, line in _imports(text):
            name = around.owner(module)
            if name is None or name in declared or name in told:
                continue
            told.add(name)
            testing = not _TESTS.isdisjoint(path.parts)
            problem = _undeclared(package, name, Place(path, line), testing=testing, only_run=not testing)
            # Launch files seldom have theirs declared, and run with what the whole system has.
            mild = name in below or path.name.endswith((".launch.py", "_launch.py"))
            (notes if mild else warnings).append(problem)
    return Grades((), tuple(warnings), tuple(notes))


def unused(
    package: Package, known: frozenset[str], mentions: Callable[[re.Pattern[str]], Iterator[str]]
) -> Iterator[Problem]:
    """Yield what a manifest declares for building or running and no other file of the package mentions.

    `mentions` yields what a pattern finds in all files but the manifest. A package that is nothing but a
    list of others mentions none of them, and says so with neither sources nor CMake calls.
    """
    wanted = {
        dependency.name
        for dependency in package.manifest.dependencies
        if dependency.name in known
        and dependency.kinds & {Kind.BUILD, Kind.EXEC}
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
        message = f"'{package.name}' declares '{name}', and none of its files mentions it"
        yield Problem(message, Place(package.manifest.path), "if it is not needed: remove the line")


def _declared(package: Package) -> frozenset[str]:
    return frozenset((package.name, *package.manifest.names(ALL_KINDS | TEST_KINDS | {Kind.DOC})))


def _undeclared(
    package: Package, name: str, place: Place, *, testing: bool, only_run: bool = False
) -> Problem:
    tag = "test_depend" if testing else "exec_depend" if only_run else "depend"
    return Problem(
        f"'{package.name}' uses '{name}', which its manifest does not name",
        place,
        f"add <{tag}>{name}</{tag}> to {package.manifest.path}",
    )


def _imports(text: str) -> Iterator[tuple[str, int]]:
    try:
        yield from imported_modules(text)
    except (SyntaxError, ValueError, RecursionError):
        return
