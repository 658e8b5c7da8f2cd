"""Tells which missing packages make CMake certainly fail.

CMake may find a package in many places that neither package.xml nor a sourced workspace names. Where any of
them is possible, CMake is asked by running it.
"""

from __future__ import annotations

import os
import re
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import cmake_arguments
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.graph import closure
from forge.environment.prefixes import SYSTEM
from forge.toolchain.config_search import ConfigSearch, prefixes_of_path
from forge.toolchain.programs import CMAKE_TYPES
from forge.workspace.cmake_text import changes_search, requirements
from forge.workspace.resolve import INTERFACE_GROUP, is_ros_name

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from forge.base.cmake_syntax import CMakeArgument
    from forge.base.layout import Layout
    from forge.workspace.model import Package
    from forge.workspace.resolve import DependencyResolution

_PREFIX_VARIABLES = ("CMAKE_PREFIX_PATH", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH")
_ROOT, _OPTIONAL = Path("/"), Path("/opt")


@frozen
class CMakeSearch:
    """Where CMake looks for packages: the workspace, the environment, and options on the command line."""

    resolution: DependencyResolution
    layout: Layout
    variables: Mapping[str, str]
    cmake_args: tuple[str, ...] = ()

    def certainly_missing(self, package: Package, names: Collection[str]) -> frozenset[str]:
        """Return those of `names`, which no known prefix contains, without which configuring fails."""
        options = (
            *self.cmake_args,
            *package.option_values("cmake-args"),
            *package.option_values("ament-cmake-args"),
        )
        if (
            package.build_type not in CMAKE_TYPES
            or "CMAKE_TOOLCHAIN_FILE" in self.variables
            or not all(map(_keeps_search, cmake_arguments(options)))
        ):
            return frozenset()
        text = text_or_nothing(package.path / "CMakeLists.txt")
        required = requirements(text, self._is_inert).intersection(names)
        return frozenset(name for name in required if not self._may_be_found(name, package))

    def _is_inert(self, name: str) -> bool:
        """Tell whether finding a package changes nothing for later ones: those of forge and of ROS."""
        own = self.resolution.packages.get(name)
        return own.embedded if own else is_ros_name(name)

    def _may_be_found(self, name: str, package: Package) -> bool:
        variables = (f"{name}_DIR", f"{name}_ROOT", f"{name.upper()}_ROOT")
        return (
            not self.variables.keys().isdisjoint(variables)
            or any(package.path.rglob(f"Find{name}.cmake"))
            or self._is_cached(name, package)
            or any(self._may_provide(name, other) for other in self._dependencies(package))
            or any(ConfigSearch().folder(str(prefix), name) for prefix in self._prefixes())
            or (Path(self.variables.get("HOME", "/")) / ".cmake/packages" / name).exists()
        )

    def _is_cached(self, name: str, package: Package) -> bool:
        """Tell whether an earlier build found the package, perhaps with options of its own."""
        cache = text_or_nothing(self.layout.build_dir(package.name) / "CMakeCache.txt")
        folder = re.search(rf"^{re.escape(name)}_DIR:\w+=(.*)$", cache, re.MULTILINE)
        return bool(folder) and not str(folder and folder[1]).endswith("-NOTFOUND")

    def _dependencies(self, package: Package) -> Iterator[Package]:
        """Yield the packages of the workspace whose prefixes CMake searches."""
        needs = self.resolution.needs
        others = (self.resolution.packages[name] for name in closure(needs, needs[package.name]))
        return (other for other in others if not other.embedded)

    def _may_provide(self, name: str, other: Package) -> bool:
        """Tell whether a package of the workspace may install a config of that name; few certainly do not."""
        if other.build_type == "ament_python":
            return False
        text = text_or_nothing(other.path / "CMakeLists.txt")
        return INTERFACE_GROUP not in other.manifest.groups or bool(
            re.search(rf"{re.escape(name)}|CONFIG_EXTRAS|\b(?:include|add_subdirectory)\s*\(", text)
        )

    def _prefixes(self) -> Iterator[Path | str]:
        listed = (self.variables.get(name, "").split(os.pathsep) for name in _PREFIX_VARIABLES)
        folders = self.variables.get("PATH", "").split(os.pathsep)
        return filter(None, chain(*listed, prefixes_of_path(folders), SYSTEM, (_ROOT, _OPTIONAL)))


def _keeps_search(argument: CMakeArgument) -> bool:
    """Tell whether an argument of CMake changes nothing about the search for packages."""
    if argument.definition:
        return not changes_search(argument.definition[:1])
    return argument.words[0].startswith(("-G", "-W", "--warn", "--no-warn", "--log-level"))
