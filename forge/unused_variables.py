"""CMake's complaint about variables that a project does not use, and who complains about which; pure.

What --cmake-args gives to all packages is meant for some of them. A complaint from each of the others
would bury what matters, so it is kept back, and told in one line where nobody used the variable.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_WITHOUT_D = re.compile(r"[A-Za-z_]\w*(?::[A-Z]+)?=")
_WANTING = frozenset({"-D", "-C", "-G", "-T", "-A", "-P", "-U", "--toolchain", "--preset"})
"""The options of CMake whose value is a word of its own."""

_DEFINITION = re.compile(r"-D([^:=]+)")
_COMPLAINT = re.compile(
    rb"CMake Warning(?: \(unused-cli\))?:\r?\n"
    rb"  Manually-specified variables were not used by the project:\r?\n\r?\n"
    rb"((?:    \S+\r?\n)+)(?:\r?\n)*"
)


def odd_words(words: Sequence[str]) -> Iterator[Problem]:
    """Yield the words that CMake would take for a path, though they are meant to define something."""
    for before, word in zip(("", *words), words, strict=False):
        if _WITHOUT_D.match(word) and before not in _WANTING:
            hint = f"write -D{word}"
            yield Problem(f"--cmake-args has '{word}', which CMake takes for a path", hint=hint)


def defined(arguments: Sequence[str]) -> frozenset[str]:
    """Return the names that arguments of cmake define: -DNAME=VALUE or -D NAME:TYPE=VALUE."""
    joined = re.sub(r"(?m)^-D\n", "-D", "\n".join(arguments))
    return frozenset(match[1] for match in map(_DEFINITION.match, joined.split("\n")) if match)


class UnusedVariables:
    """Of the variables that all packages are given, those that packages say they do not use."""

    def __init__(self, shared: frozenset[str]) -> None:
        """Begin with nobody asked; `shared` are the names given to all."""
        self._shared = shared
        self._used: set[str] = set()
        self._asked = False

    def take(self, said: bytes) -> bytes:
        """Return what a package that was configured said, without complaints about shared variables."""
        unused: set[str] = set()

        def without_shared(match: re.Match[bytes]) -> bytes:
            names = match[1].decode(errors="replace").split()
            unused.update(names)
            own = [name for name in names if name not in self._shared]
            if not own:
                return b""
            lines = "".join(f"    {name}\n" for name in own).encode()
            return match[0].replace(match[1], lines)

        rest = _COMPLAINT.sub(without_shared, said)
        self._used |= self._shared - unused
        self._asked = True
        return rest

    @property
    def names(self) -> tuple[str, ...]:
        """The variables that no package used, sorted; none before a package was configured."""
        return tuple(sorted(self._shared - self._used)) if self._asked else ()
