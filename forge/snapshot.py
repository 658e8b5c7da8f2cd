"""What is on disk before a build: digests today, records of yesterday."""

from __future__ import annotations

import hashlib
import os
import re
from typing import TYPE_CHECKING

from forge.model import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Package

_GENERATOR = re.compile(rb"^CMAKE_GENERATOR:INTERNAL=(.*)$", re.MULTILINE)


def take_snapshot(packages: Iterable[Package], layout: Layout, records: Mapping[str, str]) -> Snapshot:
    """Look at the folders of `packages`; `records` is what the journal remembers of each."""
    sources, configured, installed = {}, {}, set()
    for package in packages:
        if package.embedded:
            sources[package.name] = _digest_of_tree(package.path)
        if (layout.prefix(package.name) / "share" / package.name / "package.sh").is_file():
            installed.add(package.name)
        state = _configured(layout.build_dir(package.name))
        if state:
            configured[package.name] = state
    return Snapshot(records, sources, configured, frozenset(installed))


def _configured(build: Path) -> tuple[str, str] | None:
    """Return (generator, record) of a build folder that CMake configured completely."""
    try:
        cache = (build / "CMakeCache.txt").read_bytes()
    except OSError:
        return None
    match = _GENERATOR.search(cache)
    if match is None or not any((build / name).is_file() for name in ("build.ninja", "Makefile")):
        return (match.group(1).decode(errors="replace") if match else ""), ""
    try:
        record = (build / "handover" / "configured").read_text(encoding="utf-8")
    except OSError:
        record = ""
    return match.group(1).decode(errors="replace"), record


def _digest_of_tree(root: Path) -> str:
    """Return a digest of names, sizes and times below `root`: what an upgrade of forge changes."""
    digest = hashlib.sha256()
    for folder, names, files in os.walk(root):
        names[:] = sorted(name for name in names if name != "__pycache__")
        for name in sorted(files):
            path = f"{folder}/{name}"
            status = os.stat(path)  # noqa: PTH116  (hundreds of files before every build)
            digest.update(f"{path}\0{status.st_size}\0{status.st_mtime_ns}\n".encode())
    return digest.hexdigest()
