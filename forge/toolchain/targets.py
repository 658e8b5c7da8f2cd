"""Building for other platforms: `--target`, its options, and the toolchains that plugins provide.

A toolchain of another distribution is an entry point of the group 'forge.toolchains' with the name of its
platform. It refers to a module with the functions of `Toolchain`. forge's plugin 'cross' supports all other
platforms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from forge.base.env_vars import expand_home
from forge.base.errors import ForgeError, Problem, SelectionError
from forge.base.extensions import TOOLCHAINS, call, entry_points, find, is_installed, load
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.options import option
from forge.workspace.model import Package

_OWN = "cross"


def _absolute(path: str) -> Path:
    return expand_home(path).absolute()


def _python_version(text: str) -> tuple[int, int]:
    major, _, minor = text.partition(".")
    if major != "3" or not minor.isdecimal():
        raise ValueError(f"expected a version such as '3.10', not '{text}'")
    return int(major), int(minor)


@frozen
class CrossOptions:
    """The options for building for another platform."""

    GROUP = "cross compilation"

    toolchain_file: Path | None = option(
        "CMake toolchain file with the compilers for --target (default: zig's, from the extra 'cross')",
        parse=_absolute,
        metavar="FILE",
    )
    sysroot: Path | None = option(
        "copy of the target's file system with libraries and headers, for --toolchain-file",
        parse=_absolute,
        metavar="DIR",
    )
    target_python: tuple[int, int] | None = option(
        "version of Python on the target, such as '3.10' (default: that of the sysroot, else that of this "
        "machine)",
        parse=_python_version,
        metavar="VERSION",
    )

    def check(self, target: object) -> None:
        """Raise SelectionError for options that have no effect without --target."""
        given = (f"--{each.name.replace('_', '-')}" for each in fields(self) if getattr(self, each.name))
        word = next(given, "")
        if word and target is None:
            hint = "add the platform, for example '--target aarch64-linux-gnu'"
            raise SelectionError(Problem(f"{word} has no effect without --target", hint=hint))


@frozen
class CrossBuild:
    """The settings of a build for a platform."""

    cmake_args: tuple[str, ...] = ()
    """CMake arguments for all packages, such as -DCMAKE_TOOLCHAIN_FILE=..."""
    variables: Mapping[str, str] = field(default_factory=dict)
    """Variables for the steps of packages."""
    programs: tuple[Path, ...] = ()
    """Compilers and other files whose changes rebuild packages; the package cache's keys also contain them.

    Programs that the arguments and the variables name need not be repeated.
    """
    python_version: tuple[int, int] | None = None
    """The version of Python on the platform, None if it is the same as on this machine."""
    prepare_compilers: Callable[[Iterable[Package]], Iterable[Problem]] = lambda _packages: ()
    """Called with the packages before the first one is built; returns warnings."""


class Toolchain(Protocol):
    """The interface of a toolchain's module."""

    def prepare(
        self, target: str, layout: Layout, variables: Mapping[str, str], options: CrossOptions
    ) -> CrossBuild:
        """Return the build settings for the value of --target; raises ForgeError if that is impossible.

        Files that builds need belong in `layout.build / TOOLCHAIN_DIR`.
        """

    def has_emulator(self, layout: Layout) -> bool:
        """Return whether the last build was able to run programs of the platform on this machine."""


@frozen
class Target:
    """A platform to build for."""

    name: str
    """The name of its folders."""
    word: str
    """The value of --target."""
    toolchain: Toolchain

    def prepare(self, layout: Layout, variables: Mapping[str, str], options: CrossOptions) -> CrossBuild:
        """Return its build settings; raises ForgeError if the toolchain does not support it."""
        what = f"the toolchain of '{self.name}'"
        build = call(what, self.toolchain.prepare, self.word, layout, variables, options)
        if not isinstance(build, CrossBuild):
            raise ForgeError(Problem(f"{what} returned {type(build).__name__} instead of a CrossBuild"))
        return replace(build, prepare_compilers=partial(call, what, build.prepare_compilers))

    def has_emulator(self, layout: Layout) -> bool:
        """Return whether this machine can run the programs of the last build."""
        return call(f"the toolchain of '{self.name}'", self.toolchain.has_emulator, layout)


def find_target(word: str) -> Target:
    """Return a platform; raises ValueError for an invalid name, ForgeError if the toolchain is missing."""
    own: Any = find(TOOLCHAINS, _OWN, "toolchain") if is_installed(TOOLCHAINS, _OWN) else None
    name, is_known = own.platform(word) if own else (word, False)
    if not is_known and (entry := entry_points(TOOLCHAINS).get(word)):
        return Target(word, word, load(entry, "toolchain", ("prepare", "has_emulator")))
    return Target(name, word, own or find(TOOLCHAINS, _OWN, "toolchain"))
