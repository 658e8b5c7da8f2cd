"""Finds the first error in the output of a failed program."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import islice, takewhile

from forge.base.colours import colourless
from forge.base.frozen import frozen
from forge.execution.worker_client import DECLINED_PREFIX

_INTERFACE = re.compile(r"^(?!\s).+\.(msg|srv|action|idl)(:\d+)*: error: ")
_COMPILER = re.compile(r"^(?!\s).+:\d+(:\d+)?: (fatal )?error: ")
_CMAKE = re.compile(r"^CMake Error\b")
_OWN_LISTS = re.compile(r"^(CMake Error (?:at|in) )(?=(?:[\w.-]+/)*CMakeLists\.txt\b)", re.MULTILINE)
_LINKER = re.compile(
    r"(undefined reference to|ld: cannot find|multiple definition of|file in wrong format|ld\.lld: error: )"
)
_OTHER = re.compile(
    r"^(error: |/.+: error: |forge: |\w*(Error|Exception): |(ninja|make): \*\*\* )", re.IGNORECASE
)
_FAILED = "FAILED: "
_NINJA = re.compile(rf"\[\d+/\d+\] |{_FAILED}|ninja: ")
"""Lines that Ninja prints after the output of a command."""
_MAX_SAID = 8


@frozen
class FirstError:
    """The lines of an error, and whether it is an error in an interface definition."""

    lines: tuple[str, ...]
    interface: bool = False


def first_error(output: Sequence[str], folder: str = "") -> FirstError | None:
    """Return the first error in `output`, trying the most specific patterns first, else None.

    Paths are completed as by `with_paths`.
    """
    plain = [colourless(line.rstrip("\r\n")) for line in output]
    for pattern, extent in ((_INTERFACE, 4), (_COMPILER, 3), (_CMAKE, 4), (_LINKER, 1), (_OTHER, 2)):
        for index, line in enumerate(plain):
            if pattern.search(line) and not line.startswith(DECLINED_PREFIX):
                rest = []
                for other in plain[index + 1 : index + extent]:
                    if not (other.startswith((" ", "hint:")) or (not other and line.startswith("CMake"))):
                        break
                    if other.strip():
                        rest.append(other)
                return FirstError((with_paths(line, folder), *rest), pattern is _INTERFACE)
    failed = next((index for index, line in enumerate(plain) if line.startswith(_FAILED)), None)
    if failed is None:
        return None
    # Ninja prints the command, followed by its output.
    printed = takewhile(lambda line: not _NINJA.match(line), plain[failed + 2 :])
    lines = (line for line in printed if line.strip() and not line.startswith(DECLINED_PREFIX))
    return FirstError((*islice(lines, _MAX_SAID),) or (plain[failed],))


def with_paths(output: str, folder: str) -> str:
    """Return the output with `folder` before each CMakeLists.txt of an error, so that editors can open it."""
    return _OWN_LISTS.sub(lambda match: match[1] + (f"{folder}/" if folder else ""), output)
