"""Remedies for failures of builds for another platform."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

_NO_LOADER = re.compile(r"qemu-\w+: Could not open '/lib[\w/.-]*/(ld-[\w.-]+)'")
_NOT_FOUND = re.compile(r"^(?:/bin/)?sh: (?:\d+: |line \d+: )?(\S+): (?:command )?not found$", re.MULTILINE)
_FOREIGN = re.compile(r"Exec format error|cannot execute binary file")


def remedy_for_platform(output: str, targets: Collection[str]) -> str | None:
    """Return a remedy if a build failed to run a program for another platform, or None.

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
    return None
