"""What recipes are told and what they return."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from forge.freshness import MANIFEST
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Kind, Package, Pairs, Step


@frozen
class Kitchen:
    """The tools and options that all packages of one build share.

    `python` is the workspace's
    interpreter, `site_packages` its folder for modules below a prefix. `wheels` is the argv that builds
    a Python package, `generator` the one that CMake starts for each interface package, `tools` what
    tells the tools apart from others of their name.
    """

    root: Path
    layout: Layout
    python: Path
    site_packages: str
    wheels: tuple[str, ...]
    generator: tuple[str, ...]
    tools: Pairs = ()
    cmake: Path | None = None
    ninja: Path | None = None
    make: Path | None = None
    only_make: frozenset[str] = frozenset()
    """Packages that Ninja cannot build."""
    load_limit: float | None = None
    cmake_args: tuple[str, ...] = ()
    ament_cmake_args: tuple[str, ...] = ()
    launcher: Path | None = None
    """What is started before the compilers."""
    test_results: Path | None = None
    """Where tests of ament are to leave their results, instead of in the build folders."""
    force_configure: bool = False
    clean_cache: bool = False
    clean_first: bool = False
    target: str | None = None
    skip_target: bool = False
    """Packages without the target go without it."""
    environment_generator: str | None = None
    path_maps: Pairs = ()
    """For each language of CMake, the flags that keep paths of the workspace out of what is compiled."""
    flags: Pairs = ()
    """For each of these languages, what the environment says of its flags."""

    def of(self, package: Package) -> Kitchen:
        """Return the kitchen with what the package's own settings add to the options of all.

        What forge brings along compiles nothing and is told only what can concern it.
        """
        if package.embedded:
            return replace(
                self,
                cmake_args=tuple(_without_compiling(self.cmake_args)),
                ament_cmake_args=(),
                test_results=None,
                path_maps=(),
            )
        if not package.settings:
            return self
        return replace(
            self,
            cmake_args=(*self.cmake_args, *package.words("cmake-args")),
            ament_cmake_args=(*self.ament_cmake_args, *package.words("ament-cmake-args")),
            target=self.target or next(iter(package.words("cmake-target")), None),
            skip_target=self.skip_target or bool(package.settings.get("cmake-target-skip-unavailable")),
        )


@frozen
class Recipe:
    """The steps of one package, and the files that forge writes before the first."""

    steps: tuple[Step, ...]
    files: tuple[tuple[Path, str], ...] = ()


@frozen
class BuildType:
    """A row of the table.

    `options` are the words whose change must be noticed; a fresh package needs only these, not a recipe.
    """

    recipe: Callable[[Package, Kitchen], Recipe]
    options: Callable[[Package, Kitchen], tuple[str, ...]]


COMPILING = (
    r"CMAKE_(BUILD_TYPE|EXPORT_COMPILE_COMMANDS|VERBOSE_MAKEFILE|COLOR_(DIAGNOSTICS|MAKEFILE)"
    r"|(C|CXX|CUDA|Fortran)_(COMPILER|COMPILER_LAUNCHER|FLAGS|FLAGS_[A-Z]+|STANDARD|STANDARD_REQUIRED|EXTENSIONS)"
    r"|(EXE|SHARED|MODULE|STATIC)_LINKER_FLAGS(_[A-Z]+)?|POSITION_INDEPENDENT_CODE|INTERPROCEDURAL_OPTIMIZATION"
    r"|UNITY_BUILD|LINKER_TYPE|BUILD_RPATH|INSTALL_RPATH|INSTALL_RPATH_USE_LINK_PATH)"
)
"""Variables of CMake that only concern what is compiled, linked, or shown meanwhile."""


def _without_compiling(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the arguments of CMake without definitions that only concern what is compiled."""
    words = iter(arguments)
    for word in words:
        said = (word, next(words, "")) if word == "-D" else (word,)
        name, separator, _ = "".join(said).removeprefix("-D").partition("=")
        if not (word.startswith("-D") and separator and re.fullmatch(COMPILING, name.partition(":")[0])):
            yield from said


def places(package: Package, kitchen: Kitchen) -> tuple[str, ...]:
    """Return what every build type has as options.

    Where a package comes from and goes to, for which Python, and what its manifest comes to.
    """
    layout = kitchen.layout
    return (
        str(kitchen.root / package.path),
        str(layout.build_dir(package.name)),
        str(layout.prefix(package.name)),
        f"{layout.word}{' links' if layout.symlink and not package.embedded else ''}",
        str(kitchen.python),
        kitchen.site_packages,
        *(() if package.embedded else (f"{MANIFEST} {_manifest(package)}",)),
    )


def _manifest(package: Package) -> str:
    """Return a digest of what conditions, groups and settings outside of the package make of its manifest."""
    manifest = package.manifest
    said = [package.type, *package.hooks, "", *manifest.groups, "", *manifest.group_dependencies, ""]
    for dependency in manifest.dependencies:
        said += (dependency.name, _kinds(dependency.kinds), *map("".join, dependency.versions))
    return hashlib.blake2b("\0".join(said).encode(errors="surrogateescape"), digest_size=8).hexdigest()


@cache
def _kinds(kinds: frozenset[Kind]) -> str:
    return " ".join(sorted(kind.value for kind in kinds))
