"""CMake's syntax: the arguments of its command line, and quoted text in its files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import islice

from forge.base.frozen import frozen

_SHORT = frozenset({"-A", "-C", "-D", "-G", "-P", "-T", "-U"})
_LONG = frozenset({"--preset", "--toolchain"})
"""Options of CMake with a value, which may be a separate argument."""


@frozen
class CMakeArgument:
    """An argument of CMake, in one or two words; `option` is '' if it is not an option with a value."""

    words: tuple[str, ...]
    option: str = ""
    value: str = ""

    @property
    def definition(self) -> tuple[str, str] | None:
        name, separator, value = self.value.partition("=")
        return (name.partition(":")[0], value) if self.option == "-D" and separator else None


def cmake_arguments(words: Iterable[str]) -> Iterator[CMakeArgument]:
    remaining = iter(words)
    for word in remaining:
        name = word.partition("=")[0]
        option = word[:2] if word[:2] in _SHORT else name if name in _LONG else ""
        if option and word == option:
            value = tuple(islice(remaining, 1))
            yield CMakeArgument((word, *value), option, "".join(value))
        else:
            yield CMakeArgument((word,), option, word[len(option) + (option in _LONG) :] if option else "")


def definitions(words: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield name and value of each variable that the arguments define."""
    return (definition for argument in cmake_arguments(words) if (definition := argument.definition))


def quoted(*elements: str) -> str:
    """Return a quoted CMake argument: the list of the elements, which may contain any character."""
    escaped = (re.sub(r'([\\"$])', r"\\\1", element).replace(";", r"\;") for element in elements)
    return '"' + ";".join(escaped) + '"'
