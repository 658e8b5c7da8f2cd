"""Compiler launchers: programs that cache compilations or distribute them to other machines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path

from forge.base.errors import Problem, SelectionError
from forge.base.frozen import Pairs, frozen
from forge.base.text import counted

NONE = "none"
"""Overrides a launcher set in a file or variable."""

_PACKAGE = "install the package '{}' of your distribution, or remove '--compiler-launcher'"
LAUNCHERS: Mapping[str, str] = {
    "ccache": _PACKAGE.format("ccache"),
    "sccache": "install it with `cargo install sccache` or your distribution's package 'sccache'; it must be "
    "on PATH",
    "distcc": _PACKAGE.format("distcc"),
    "icecc": _PACKAGE.format("icecc"),
    "recc": "it is part of BuildBox; put it on PATH, or remove '--compiler-launcher'",
}
"""The values of --compiler-launcher, and how to install each."""
_CUDA_LAUNCHERS = frozenset({"ccache", "sccache"})


def selected_launcher(word: str | None) -> str:
    """Return the selected launcher, '' for none; raises SelectionError for an unknown one."""
    if not word or word == NONE:
        return ""
    if word not in LAUNCHERS:
        # Names in files and on the command line are validated when parsed: this one is from the environment.
        message = f"FORGE_COMPILER_LAUNCHER: unknown compiler launcher '{word}'"
        raise SelectionError(Problem(message, hint=f"use {', '.join(LAUNCHERS)} or {NONE}"))
    return word


def launcher_variables(program: Path | None) -> Pairs:
    """Return CMake's variables with the absolute path of the launcher, '' for languages without one."""
    word = str(program or "")
    cuda = word if program and program.name in _CUDA_LAUNCHERS else ""
    values = {"C": word, "CXX": word, "CUDA": cuda}
    return tuple((f"CMAKE_{language}_COMPILER_LAUNCHER", value) for language, value in values.items())


@frozen
class LauncherSummary:
    """For a cache, its hits; for a distributed compiler, its hosts and job slots."""

    launcher: str
    compilations: int | None = None
    from_cache: int | None = None
    hosts: int | None = None
    slots: int | None = None

    @property
    def words(self) -> str:
        if self.compilations is not None:
            total = counted(self.compilations, "compilation")
            return f"{self.launcher}: {self.from_cache} of {total} from the cache"
        return f"{self.launcher}: {counted(self.hosts or 0, 'host')} with {counted(self.slots or 0, 'slot')}"


@frozen
class LauncherStats:
    """The launcher of one build: variables, remote job slots, a warning, and statistics by `finish`."""

    variables: Mapping[str, str] = field(default_factory=dict)
    slots: int = 0
    problem: Problem | None = None
    finish: Callable[[], tuple[LauncherSummary, ...]] = tuple
