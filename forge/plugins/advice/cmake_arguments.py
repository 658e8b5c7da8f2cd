"""Finds mistakes in --cmake-args: words that are no definitions, misspelled variables."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from forge.base.cmake_syntax import cmake_arguments
from forge.base.errors import Problem
from forge.base.names import nearest
from forge.workspace.model import Package

_WITHOUT_D = re.compile(r"[A-Za-z_]\w*(?::[A-Z]+)?=")
_DEFINED_WITHIN = re.compile(r"\s-D\s*([A-Za-z_]\w*)(?::[A-Z]+)?=")
_HOLDS_FLAGS = re.compile(r".*(FLAGS|OPTIONS|DEFINITIONS|ARGS|COMMAND)", re.IGNORECASE)
_SIMILAR = 0.85

_WELL_KNOWN = (
    *("BUILD_SHARED_LIBS", "BUILD_TESTING", "CMAKE_BUILD_TYPE", "CMAKE_CXX_COMPILER", "CMAKE_CXX_FLAGS"),
    *("CMAKE_CXX_STANDARD", "CMAKE_C_COMPILER", "CMAKE_C_FLAGS", "CMAKE_EXPORT_COMPILE_COMMANDS"),
    *("CMAKE_INTERPROCEDURAL_OPTIMIZATION", "CMAKE_MODULE_PATH", "CMAKE_POSITION_INDEPENDENT_CODE"),
    *("CMAKE_PREFIX_PATH", "CMAKE_TOOLCHAIN_FILE", "CMAKE_VERBOSE_MAKEFILE"),
)
"""Variables of CMake that users set on the command line."""


def suspicious_arguments(words: Sequence[str]) -> Iterator[Problem]:
    """Yield arguments that CMake treats as a path, or as one definition, but that look like definitions."""
    for argument in cmake_arguments(words):
        word = argument.words[0]
        text = " ".join(argument.words)
        within = _DEFINED_WITHIN.findall(text)
        # In -DCMAKE_CXX_FLAGS="-DA=1 -DB=2", the latter are macros; CMake's own variables are not.
        is_flags = argument.definition and _HOLDS_FLAGS.fullmatch(argument.definition[0])
        if within and not (is_flags and not any(map(_is_of_cmake, within))):
            message = (
                f"--cmake-args contains '{text}' as one argument, so that CMake does not see '{within[0]}'"
            )
            yield Problem(
                message, hint=f"remove the quotes around it, or in a file, write a list: {text.split()}"
            )
        elif _WITHOUT_D.match(word):
            name = re.split("[:=]", word[1:])[0]
            meant = word[0] == "D" and _is_of_cmake(name)
            hint = f"write -{word}" if meant else f"write -D{word}"
            yield Problem(f"--cmake-args contains '{word}', which CMake treats as a path", hint=hint)


def _is_of_cmake(name: str) -> bool:
    return name in _WELL_KNOWN or name.startswith("CMAKE_")


def probable_variable(name: str) -> str | None:
    """Return the variable of CMake that was probably meant by an unused one, or None."""
    return None if name in _WELL_KNOWN else nearest(name, _WELL_KNOWN, _SIMILAR)


def tested_anyway(
    packages: Iterable[Package], is_tested: Callable[[Package], bool | None]
) -> Iterator[Problem]:
    """Yield a warning if arguments for CMake turn tests on in spite of --no-test-dependencies."""
    tested = sorted(each.name for each in packages if each.only_tested_with and is_tested(each))
    if tested:
        which = f"'{tested[0]}'" if len(tested) == 1 else f"{len(tested)} packages, such as '{tested[0]}'"
        message = f"'--no-test-dependencies' has no effect on {which}: BUILD_TESTING is turned on"
        hint = "remove the option, or BUILD_TESTING from the arguments for CMake"
        yield Problem(message, hint=hint)
