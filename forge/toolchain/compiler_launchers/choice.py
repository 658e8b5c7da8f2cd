"""The supported compiler launchers, their languages, and CMake's variables for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.base.frozen import Pairs

NONE = "none"
"""Overrides a launcher set in a file or variable."""

_LANGUAGES = ("C", "CXX", "CUDA")
_OF_GCC = ("C", "CXX")


@frozen
class Launcher:
    """A compiler launcher: the languages it supports, and how to install it."""

    languages: tuple[str, ...]
    hint: str


_PACKAGE = "install the package '{}' of your distribution, or remove '--compiler-launcher'"

LAUNCHERS: Mapping[str, Launcher] = {
    "ccache": Launcher(_LANGUAGES, _PACKAGE.format("ccache")),
    "sccache": Launcher(
        _LANGUAGES,
        "install it with `cargo install sccache` or your distribution's package 'sccache'; it must be "
        "on PATH",
    ),
    "distcc": Launcher(_OF_GCC, _PACKAGE.format("distcc")),
    "icecc": Launcher(_OF_GCC, _PACKAGE.format("icecc")),
    "recc": Launcher(_OF_GCC, "it is part of BuildBox; put it on PATH, or remove '--compiler-launcher'"),
}
"""The values of --compiler-launcher."""


def selected_launcher(word: str | None) -> str:
    """Return the selected launcher, '' for none; raises SelectionError for an unknown one."""
    if not word or word == NONE:
        return ""
    if word not in LAUNCHERS:
        # Command line and files are validated when parsed: the name is from the environment.
        hint = f"use {', '.join(LAUNCHERS)} or {NONE}"
        raise SelectionError(
            Problem(f"FORGE_COMPILER_LAUNCHER: unknown compiler launcher '{word}'", hint=hint)
        )
    return word


def not_found(name: str) -> Problem:
    return Problem(f"compiler launcher '{name}' not found on PATH", hint=LAUNCHERS[name].hint)


def launcher_variables(program: Path | None) -> Pairs:
    """Return CMake's variables for each language; the value is empty for languages without launcher.

    The launcher's absolute path is used, independent of later changes of PATH.
    """
    languages = LAUNCHERS[program.name].languages if program else ()
    return tuple(
        (f"CMAKE_{language}_COMPILER_LAUNCHER", str(program) if language in languages else "")
        for language in _LANGUAGES
    )
