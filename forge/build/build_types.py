"""The build types: those of CMake, `ament_python`, and those of plugins.

A build type of a plugin is an entry point of the group 'forge.build_types'. It refers to a module (or another
object) with the fields of BuildType as attributes:

    [project.entry-points."forge.build_types"]
    make = "my_distribution.make"

Entry points are searched only for a build type that forge does not know.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from forge.base.errors import ForgeError, GroupedProblems, Location, Problem
from forge.base.extensions import BUILD_TYPES, absent, checked, entry_points, installed
from forge.base.frozen import frozen
from forge.base.graph import closure
from forge.base.names import did_you_mean
from forge.base.text import digest
from forge.build.recipes import cmake, python
from forge.build.recipes.context import BuildContext, Recipe, common_options
from forge.build.up_to_date import BUILD_TYPE

if TYPE_CHECKING:
    from forge.build.tests.recipes import TestContext
    from forge.workspace.identity import Folder, Identity
    from forge.workspace.model import Manifest, Package


@frozen
class BuildType:
    """The interface of a build type. Only `toolchain` runs programs, and no function writes files.

    The fields without a default and `identify` are required of plugins.
    """

    options: Callable[[Package, BuildContext], tuple[str, ...]]
    """Returns the inputs besides sources, dependencies and tools: `common_options` and further ones.

    A package is rebuilt when one of them changes.
    """
    recipe: Callable[[Package, BuildContext], Recipe]
    """Returns the steps that build the package and install it into its prefix."""
    tests: Callable[[Package, TestContext], Recipe]
    """Returns the steps that test the package, none if it has no tests."""
    identify: Callable[[Folder], Identity | None] | None = None
    """Returns the package in a folder without package.xml, None if it is not of this build type."""
    toolchain: (
        Callable[[Sequence[Package], BuildContext | TestContext, Mapping[str, str]], tuple[str, str]] | None
    ) = None
    """Returns the name of the toolchain of some packages, and a text that changes if the toolchain does.

    Raises HostError if it is not installed. The last parameter is the environment of the build.
    """
    tool_folders: Callable[[Mapping[str, str]], tuple[str, ...]] | None = None
    """Returns the folders of tools, whose files `toolchain` stands for: they are not inputs one by one.

    The parameter is the environment of the build.
    """
    staged: bool = False
    """Nothing but `install_tree` writes into the prefix, so that forge need not observe the steps."""
    tests_need_build: bool = True
    """The tests need the files in the build folder, which a package restored from the cache lacks."""
    code: str = ""
    """Identifies the code of another distribution's build type; set by forge."""


OWN: Mapping[str, BuildType] = {
    "ament_cmake": BuildType(cmake.options, cmake.recipe, cmake.tests),
    "ament_python": BuildType(common_options, python.recipe, python.tests, tests_need_build=False),
    "cmake": BuildType(cmake.options, cmake.recipe, cmake.tests),
}


def find_build_type(name: str) -> BuildType | None:
    """Return a build type, None if it is unknown; raises ForgeError for a plugin that cannot be loaded."""
    if name in OWN:
        return OWN[name]
    from forge.workspace.identity import plugin

    module = plugin(name)
    if module is None:
        return None
    names = (field.name for field in fields(BuildType))
    build_type = BuildType(**{field: getattr(module, field) for field in names if hasattr(module, field)})
    if name in installed(BUILD_TYPES):
        return build_type
    from forge.build.inputs.fingerprints import code_digest

    # Exceptions and wrong results of another distribution become ForgeErrors.
    what, code = f"the build type '{name}'", code_digest(module)
    options = checked(what, build_type.options, tuple)
    return replace(
        build_type,
        code=code,
        options=lambda *arguments: (*options(*arguments), f"{BUILD_TYPE}'{name}' {code}"),
        recipe=checked(what, build_type.recipe, Recipe),
        tests=checked(what, build_type.tests, Recipe),
        toolchain=build_type.toolchain and checked(what, build_type.toolchain, tuple),
        tool_folders=build_type.tool_folders and checked(what, build_type.tool_folders, tuple),
    )


def by_toolchain(
    packages: Sequence[Package],
) -> Iterator[tuple[Callable[..., tuple[str, str]], list[Package]]]:
    """Yield the `toolchain` functions of the packages' build types, each with its packages."""
    types = {name: find_build_type(name) for name in sorted({each.build_type for each in packages})}
    functions = {name: each.toolchain for name, each in types.items() if each and each.toolchain}
    for function in dict.fromkeys(functions.values()):
        yield function, [package for package in packages if functions.get(package.build_type) is function]


def with_toolchains(
    context: BuildContext, packages: Sequence[Package], variables: Mapping[str, str]
) -> BuildContext:
    """Return the context with the toolchains of build types; raises HostError for those not installed."""
    options = {}
    for toolchain, of_type in by_toolchain(packages):
        name, identity = toolchain(of_type, context, variables)
        option = f"the {name} toolchain {digest(identity)}"
        options.update(dict.fromkeys((package.build_type for package in of_type), option))
    return replace(context, toolchains=tuple(options.items()))


def known_types() -> tuple[str, ...]:
    """Return the names of all build types without loading plugins."""
    return tuple(sorted({*OWN, *installed(BUILD_TYPES), *entry_points(BUILD_TYPES)}))


def build_type_of(package: Package) -> BuildType:
    """Return the build type of a package; raises ForgeError if it is unknown."""
    build_type = find_build_type(package.build_type)
    if build_type is None:
        raise ForgeError(unknown_type(package.manifest))
    return build_type


def unknown_types(packages: Iterable[Package]) -> frozenset[str]:
    return frozenset(package.name for package in packages if find_build_type(package.build_type) is None)


def leave_out(
    names: Sequence[str],
    packages: Mapping[str, Package],
    needs: Mapping[str, frozenset[str]],
    requested: Container[str],
) -> tuple[tuple[str, ...], tuple[Problem, ...]]:
    """Return `names` without packages of unknown build types, and warnings about these.

    Those that are `requested`, or needed by another package, remain: planning reports them as errors.
    """
    unknown = unknown_types(packages[name] for name in names)
    if not unknown:
        return tuple(names), ()
    built = [name for name in names if name not in unknown or name in requested]
    left_out = unknown - closure(needs, built)
    problems = []
    for package in (packages[name] for name in names if name in left_out):
        kind, hint = package.build_type, hint_on_type(package.build_type, package.name)
        group = GroupedProblems(
            f"skipping {{}}: unknown build type '{kind}'", package.name, hint_on_type(kind)
        )
        message = f"skipping '{package.name}': unknown build type '{kind}'"
        problems.append(Problem(message, Location(package.manifest.path), hint, group))
    return tuple(name for name in names if name not in left_out), tuple(problems)


def unknown_type(manifest: Manifest) -> Problem:
    message = f"unsupported build type '{manifest.build_type}' of package '{manifest.name}'"
    return Problem(message, Location(manifest.path), hint_on_type(manifest.build_type, manifest.name))


def hint_on_type(build_type: str, name: str = "NAME") -> str:
    if build_type == "catkin":
        what = "catkin, the build type of a package.xml that names none, is for ROS 1"
        return f"{what}; check out a branch for ROS 2, add a build type, or pass --packages-skip {name}"
    if problem := absent(BUILD_TYPES, build_type, "build type"):
        return f"{problem.message}; {problem.hint}"
    names = sorted({*OWN, *installed(BUILD_TYPES)})
    near = did_you_mean(build_type, names)
    suggestion = f"{near} Others" if near else f"supported build types: {', '.join(names)}; others"
    return f"{suggestion} need a plugin, see `forge extensions`"
