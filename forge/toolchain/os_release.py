"""Reads /etc/os-release: the fields, and the family of the operating system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from forge.base.files import text_or_nothing

OS_RELEASE = (Path("/etc/os-release"), Path("/usr/lib/os-release"))

DEBIAN = frozenset({"debian", "ubuntu", "linuxmint", "pop", "raspbian", "zorin", "elementary"})
RED_HAT = frozenset({"fedora", "rhel", "centos", "rocky", "almalinux", "ol", "openeuler", "amzn"})


def os_release(files: Iterable[Path] = OS_RELEASE) -> dict[str, str]:
    """Return the unquoted fields of os-release; empty without such a file."""
    for file in files:
        if text := text_or_nothing(file):
            pairs = (line.partition("=") for line in text.splitlines() if "=" in line and line[0] != "#")
            return {name.strip(): value.strip().strip("\"'") for name, _, value in pairs}
    return {}


def families(fields: Mapping[str, str]) -> tuple[str, ...]:
    """Return the ids of the system and of those in its ID_LIKE."""
    return (fields.get("ID", "linux").lower(), *fields.get("ID_LIKE", "").lower().split())
