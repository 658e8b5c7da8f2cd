"""What recipes are told and what they return."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Package, Pairs, Step


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
        """Return the kitchen with what the package's own settings add to the options of all."""
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


def places(package: Package, kitchen: Kitchen) -> tuple[str, ...]:
    """Return where a package comes from and goes to, and for which Python, as every build type's options."""
    layout = kitchen.layout
    return (
        str(kitchen.root / package.path),
        str(layout.build_dir(package.name)),
        str(layout.prefix(package.name)),
        f"{layout.word}{' links' if layout.symlink and not package.embedded else ''}",
        str(kitchen.python),
        kitchen.site_packages,
    )
