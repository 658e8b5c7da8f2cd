"""Remedies for failures of builds for another platform."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

_NO_LOADER = re.compile(r"qemu-\w+: Could not open '/lib[\w/.-]*/(ld-[\w.-]+)'")
_NOT_FOUND = re.compile(r"^(?:/bin/)?sh: (?:\d+: |line \d+: )?(\S+): (?:command )?not found$", re.MULTILINE)
_WRONG_FORMAT = re.compile(
    r"\bld: (.+): error adding symbols: file in wrong format|\bld\.lld: error: (.+) is incompatible with "
)
_NO_GLIBC = re.compile(r'unable to provide libc for target "\S*-gnu\w*\.([\d.]+)"')
_FOREIGN = re.compile(r"Exec format error|cannot execute binary file")


def remedy_for_platform(output: str, targets: Collection[str]) -> str | None:
    """Return a remedy if a program, library or version of glibc is for another platform, or None.

    `targets` are those of the package's CMakeLists.txt: without an emulator, CMake leaves the name of a
    target in a command as it is.
    """
    if match := _NO_LOADER.search(output):
        return (
            f"'{match[1]}', a part of the target's C library, is missing: install it, on Debian for example "
            "with `apt install libc6-arm64-cross`, or pass a '--sysroot'"
        )
    if any(name in targets for name in _NOT_FOUND.findall(output)):
        return "the build runs a program that it has compiled for another platform: install qemu-user"
    if _FOREIGN.search(output):
        return (
            "the build runs a program for another platform: install qemu-user, and pass the target itself to "
            "add_custom_command(COMMAND ...), so that CMake starts it with qemu"
        )
    if match := _WRONG_FORMAT.search(output):
        return (
            f"'{PurePath(match[1] or match[2]).name}' was built for another platform: source only workspaces "
            "of this build's platform, or pass theirs as '--target'"
        )
    if match := _NO_GLIBC.search(output):
        return f"zig has no glibc {match[1]}: pass a newer version in '--target', such as 2.31"
    return None
