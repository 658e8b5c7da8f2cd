"""CMake variables on the command line; unused ones are reported once if no package used them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from forge.base.cmake_syntax import cmake_arguments, definitions
from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.workspace.model import CMAKE_TYPES, Package

OLDEST_POLICY = "3.5"
"""The oldest version that CMake 4 supports. Projects that require an older one, as many do, use this one."""
_POLICY_DEFAULT = "CMAKE_POLICY_DEFAULT_"
_UNUSED = re.compile(
    rb"CMake Warning(?: \(unused-cli\))?:\r?\n"
    rb"  Manually-specified variables were not used by the project:\r?\n\r?\n"
    rb"((?:    \S+\r?\n)+)(?:\r?\n)*"
)

BUILD_TESTING = "BUILD_TESTING"
_FALSE = re.compile(r"(0|OFF|NO|FALSE|N|IGNORE|(.*-)?NOTFOUND)?", re.IGNORECASE)
_CACHED = re.compile(rf"^{BUILD_TESTING}:\w+=(.*)$", re.MULTILINE)


def unset_definitions(words: Sequence[str]) -> Iterator[Problem]:
    """Yield definitions without a value, which CMake rejects."""
    for argument in cmake_arguments(words):
        if argument.option == "-D" and argument.definition is None:
            name = argument.value
            hint = f"write -D{name}=ON, or another value" if name else "write -DNAME=VALUE"
            yield Problem(f"--cmake-args contains '-D{name}' without a value", hint=hint)


def defined(arguments: Sequence[str]) -> frozenset[str]:
    return frozenset(name for name, _ in definitions(arguments))


def unused_variables(output: bytes) -> frozenset[str]:
    """Return the variables that CMake warns about in the output of one configure run."""
    name_lists = (match[1].decode(errors="replace").split() for match in _UNUSED.finditer(output))
    return frozenset(name for names in name_lists for name in names)


def builds_tests(package: Package, cmake_args: Sequence[str], ament_cmake_args: Sequence[str]) -> bool | None:
    """Return whether CMake's arguments, global and its own, turn a package's tests on; None if neither."""
    words = [*cmake_args]
    if package.build_type in CMAKE_TYPES:
        words += package.option_values("cmake-args")
    if package.build_type == "ament_cmake":
        words += (*ament_cmake_args, *package.option_values("ament-cmake-args"))
    value = dict(definitions(words)).get(BUILD_TESTING)
    return None if value is None else _FALSE.fullmatch(value) is None


def was_built_without_tests(build_dir: Path) -> bool:
    """Return whether the last build of a CMake package excluded its tests."""
    match = _CACHED.search(text_or_nothing(build_dir / "CMakeCache.txt"))
    return match is not None and _FALSE.fullmatch(match[1].strip()) is not None


class UnusedVariables:
    """Collects variables passed to all packages that no package uses."""

    def __init__(self, shared: frozenset[str]) -> None:
        """`shared` are the names passed to all packages."""
        self._shared = shared
        self._used: set[str] = set()
        self._asked = False

    def take(self, output: bytes) -> bytes:
        """Return the output of a configured package without warnings about shared variables."""

        def without_shared(match: re.Match[bytes]) -> bytes:
            own = [name for name in match[1].decode(errors="replace").split() if name not in self._shared]
            if not own:
                return b""
            lines = "".join(f"    {name}\n" for name in own).encode()
            return match[0].replace(match[1], lines)

        rest = _UNUSED.sub(without_shared, output)
        self._used |= self._shared - unused_variables(output)
        self._asked = True
        return rest

    @property
    def names(self) -> tuple[str, ...]:
        """The variables that no package used, sorted; empty before a package was configured."""
        unused = self._shared - self._used if self._asked else ()
        # The default of a policy affects only projects that do not set the policy.
        return tuple(sorted(name for name in unused if not name.startswith(_POLICY_DEFAULT)))
