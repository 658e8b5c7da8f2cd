"""Which compiler launchers there are, which languages each takes, and what CMake is told of one; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Problem, SelectionError
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.model import Pairs

NONE = "none"
"""The word that takes back what a file or a variable asks for."""

_LANGUAGES = ("C", "CXX", "CUDA")
_OF_GCC = ("C", "CXX")


@frozen
class Launcher:
    """A compiler launcher: the languages whose compilers it understands, and how people come by it."""

    languages: tuple[str, ...]
    hint: str


_PACKAGE = "install the package '{}' of your distribution, or leave out '--compiler-launcher'"

LAUNCHERS: Mapping[str, Launcher] = {
    "ccache": Launcher(_LANGUAGES, _PACKAGE.format("ccache")),
    "sccache": Launcher(
        _LANGUAGES,
        "`cargo install sccache` builds it, some distributions have it as 'sccache'; it must be on PATH",
    ),
    "distcc": Launcher(_OF_GCC, _PACKAGE.format("distcc")),
    "icecc": Launcher(_OF_GCC, _PACKAGE.format("icecc")),
    "recc": Launcher(_OF_GCC, "it is a part of BuildBox; put it on PATH, or leave out '--compiler-launcher'"),
}
"""The launchers that --compiler-launcher knows."""


def chosen(word: str | None) -> str:
    """Return the launcher that is asked for, '' for none; raises SelectionError for one that nobody knows."""
    if not word or word == NONE:
        return ""
    if word not in LAUNCHERS:
        # The command line and files were looked at when they were read: only a variable can say this.
        hint = f"forge knows {', '.join(LAUNCHERS)} and {NONE}"
        raise SelectionError(Problem(f"FORGE_COMPILER_LAUNCHER names '{word}', which is none", hint=hint))
    return word


def not_found(name: str) -> Problem:
    """Say that a launcher is not on this machine."""
    return Problem(f"the compiler launcher '{name}' was not found on PATH", hint=LAUNCHERS[name].hint)


def launcher_variables(program: Path | None) -> Pairs:
    """Return CMake's variables for each language that may have a launcher; an empty value is for none.

    The program stands there with its path: a package is built with the same one whatever PATH says later.
    """
    languages = LAUNCHERS[program.name].languages if program else ()
    return tuple(
        (f"CMAKE_{language}_COMPILER_LAUNCHER", str(program) if language in languages else "")
        for language in _LANGUAGES
    )
