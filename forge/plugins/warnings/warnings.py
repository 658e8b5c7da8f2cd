"""Find the warnings of compilers in the output of packages, and those that another package has printed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator

_COMMAND = re.compile(rb"\[\d+/\d+\] ")
_WARNING = re.compile(rb":(?: |\x1b\[[\d;]*[mK])*warning: ")
"""The message of a compiler or linker, perhaps coloured."""
_MOST = 1_000_000
"""The maximum number of bytes kept of the output of one package."""

_CMAKE = re.compile(
    rb"^CMake (?:Deprecation )?Warning[^\n]*\n"
    rb"(?:(?:[ \t][^\n]*|\r?|Call Stack \([^\n]*|This warning is for project developers[^\n]*)\n)*",
    re.MULTILINE,
)
_LOCATION = re.compile(rb"\A(CMake [^\n]*?) (?:at|in) [^\n]*?:\d+")
_SHORT = 2
"""Names of this length are probably words, as in 'a future version'."""

_CALL_STACK = re.compile(rb"^Call Stack \(.*", re.MULTILINE | re.DOTALL)


class CompilerWarnings:
    """Collects the output of the commands of one package that print warnings.

    With make, warnings of compilers reach the user on stderr. Ninja prints them to its own stdout: a line for
    each command that has ended, followed by everything that the command printed.
    """

    def __init__(self) -> None:
        self._command: list[bytes] | None = None
        self._found: list[bytes] = []
        self._room = _MOST

    def add(self, lines: bytes) -> None:
        """Read complete lines of a build tool's stdout."""
        for line in lines.splitlines(keepends=True):
            if _COMMAND.match(line):
                self.end_step()
                self._command = []
            elif self._command is not None and self._room > 0:
                self._command.append(line)
                self._room -= len(line)

    def end_step(self) -> None:
        """Drop the output of the current command unless it contains a warning."""
        text = b"".join(self._command or ())
        if _WARNING.search(text):
            self._found.append(text)
        else:
            self._room += len(text)
        self._command = None

    @property
    def text(self) -> bytes:
        return b"".join(self._found)


class RepeatedWarnings:
    """The kinds of warnings of one build, and the packages that printed each.

    CMake prints the same deprecation for every package of a workspace, and so does setuptools; each kind is
    shown once. Two warnings are of the same kind if they differ only in their location and in the name of the
    package.
    """

    def __init__(self) -> None:
        self._first: dict[bytes, str] = {}
        self._repeated: dict[str, dict[str, None]] = {}

    def take(self, package: str, output: bytes) -> bytes:
        """Return the output of a package without the warnings that an earlier package printed."""
        return b"".join(text for text in _texts(output) if self._is_new(package, text))

    def _is_new(self, package: str, text: bytes) -> bool:
        # Ignore differences between packages, such as line breaks that depend on names.
        text = _CALL_STACK.sub(b"", _LOCATION.sub(rb"\1", text)) if text.startswith(b"CMake ") else text
        if len(package) > _SHORT:
            name = re.escape(package.encode())
            text = re.sub(rb"(?<![\w-])" + name + rb"(?![\w-])", b"<package>", text)
        first = self._first.setdefault(b" ".join(text.split()), package)
        if first != package and text.strip():
            self._repeated.setdefault(first, {})[package] = None
        return first == package

    @property
    def packages(self) -> dict[str, tuple[str, ...]]:
        """The packages whose warnings were left out, by the package that printed them first."""
        return {first: tuple(sorted(others)) for first, others in sorted(self._repeated.items())}


def _texts(output: bytes) -> Iterator[bytes]:
    """Yield each warning of CMake and the texts between them."""
    end = 0
    for match in _CMAKE.finditer(output):
        yield output[end : match.start()]
        yield match[0]
        end = match.end()
    yield output[end:]


class PackageWarnings:
    """The warnings of one run: those of compilers by package, and those that several packages print."""

    def __init__(self) -> None:
        self.of_compilers: defaultdict[str, CompilerWarnings] = defaultdict(CompilerWarnings)
        self.repeated = RepeatedWarnings()
