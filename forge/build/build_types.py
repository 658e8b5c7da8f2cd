"""The build types: forge's own, and those of other distributions.

A build type of another distribution is an entry point of the group 'forge.build_types'. It refers to a module
(or another object) with the functions of BuildType and of forge.workspace.finders.Finder:

    [project.entry-points."forge.build_types"]
    make = "my_distribution.make"

Entry points are searched only for a build type that is not one of OWN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.base.errors import ForgeError, GroupedProblems, Location, Problem
from forge.base.frozen import frozen
from forge.base.graph import closure
from forge.base.names import did_you_mean
from forge.build.recipes import cmake, python
from forge.build.recipes.context import common_options

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Mapping, Sequence

    from forge.build.recipes.context import BuildContext, Recipe
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Manifest, Package


class BuildType(Protocol):
    """What forge asks a build type. The functions return values; they run no programs and write no files."""

    def options(self, package: Package, context: BuildContext, /) -> tuple[str, ...]:
        """Return the inputs besides sources, dependencies and tools: `common_options` and further ones.

        A package is built again when one of them changes.
        """

    def recipe(self, package: Package, context: BuildContext, /) -> Recipe:
        """Return the steps that build the package and install it into its prefix."""

    def tests(self, package: Package, context: TestContext, /) -> Recipe:
        """Return the steps that test the package, none if it has no tests."""


@frozen
class _Own:
    """One of forge's own build types."""

    options: Callable[[Package, BuildContext], tuple[str, ...]]
    recipe: Callable[[Package, BuildContext], Recipe]
    tests: Callable[[Package, TestContext], Recipe]


class _Rust:
    """The build types of Rust packages; their recipes are only imported if there are such packages."""

    def options(self, package: Package, context: BuildContext) -> tuple[str, ...]:
        from forge.build.recipes import cargo

        return cargo.options(package, context)

    def recipe(self, package: Package, context: BuildContext) -> Recipe:
        from forge.build.recipes import cargo

        return cargo.recipe(package, context)

    def tests(self, package: Package, context: TestContext) -> Recipe:
        from forge.build.recipes import cargo

        return cargo.tests(package, context)


OWN: Mapping[str, BuildType] = {
    "ament_cmake": _Own(cmake.ament_options, cmake.ament_recipe, cmake.tests),
    "ament_python": _Own(common_options, python.recipe, python.tests),
    "ament_cargo": _Rust(),
    "cargo": _Rust(),
    "cmake": _Own(cmake.plain_options, cmake.plain_recipe, cmake.tests),
    "python": _Own(common_options, python.plain_recipe, python.tests),
}


def find_build_type(name: str) -> BuildType | None:
    """Return a build type, None if it is unknown; raises ForgeError for a plugin that cannot be loaded."""
    return OWN[name] if name in OWN else _plugin(name)


def known_types() -> tuple[str, ...]:
    """Return the names of all build types, without loading those of other distributions."""
    return tuple(sorted({*OWN, *_plugin_names()}))


def is_known_type(name: str) -> bool:
    """Tell whether there is a build type of this name, without loading it."""
    return name in OWN or name in _plugin_names()


def build_type_of(package: Package) -> BuildType:
    """Return the build type of a package; raises ForgeError if it is unknown."""
    found = find_build_type(package.build_type)
    if found is None:
        raise ForgeError(unknown_type(package.manifest))
    return found


def unknown_types(packages: Iterable[Package]) -> frozenset[str]:
    """Return the names of the packages whose build type is unknown."""
    return frozenset(package.name for package in packages if find_build_type(package.build_type) is None)


def leave_out(
    names: Sequence[str],
    packages: Mapping[str, Package],
    needs: Mapping[str, frozenset[str]],
    requested: Container[str],
) -> tuple[tuple[str, ...], tuple[Problem, ...]]:
    """Return `names` without packages of unknown build types, and warnings about these.

    A package that is `requested` or needed by another one of a known build type remains: planning reports it
    as an error.
    """
    unknown = unknown_types(packages[name] for name in names)
    if not unknown:
        return tuple(names), ()
    built = [name for name in names if name not in unknown or name in requested]
    left_out = unknown - closure(needs, built)
    problems = (_left_out(packages[name]) for name in names if name in left_out)
    return tuple(name for name in names if name not in left_out), tuple(problems)


def _left_out(package: Package) -> Problem:
    kind, hint = package.build_type, hint_on_type(package.build_type, package.name)
    group = GroupedProblems(f"skipping {{}}: unknown build type '{kind}'", package.name, hint_on_type(kind))
    location = Location(package.manifest.path)
    return Problem(f"skipping '{package.name}': unknown build type '{kind}'", location, hint, group)


def unknown_type(manifest: Manifest) -> Problem:
    """Return the problem of a package that cannot be built because its build type is unknown."""
    message = f"unsupported build type '{manifest.build_type}' of package '{manifest.name}'"
    return Problem(message, Location(manifest.path), hint_on_type(manifest.build_type, manifest.name))


def hint_on_type(build_type: str, name: str = "NAME") -> str:
    """Return what to do about an unknown build type."""
    if build_type == "catkin":
        what = "catkin, the build type of a package.xml that names none, is for ROS 1"
        return f"{what}; check out a branch for ROS 2, add a build type, or pass --packages-skip {name}"
    near = did_you_mean(build_type, OWN)
    known = f"{near} Others" if near else f"supported build types: {', '.join(sorted(OWN))}; others"
    return f"{known} need a plugin, see `forge extensions`"


def _plugin_names() -> frozenset[str]:
    from forge.workspace.finders import plugin_names

    return plugin_names()


def _plugin(name: str) -> BuildType | None:
    """Return the build type of another distribution."""
    from forge.build.plugins import find_plugin

    return find_plugin(name)
