"""The records in a build folder: start and end of its last build, external inputs, inputs saved meanwhile."""

from __future__ import annotations

import hashlib
import json
import os
from typing import TYPE_CHECKING, Any

from forge.base.files import replace_file, text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import SCRATCH_DIR
from forge.build.inputs.depfiles import written_by_backend
from forge.build.inputs.fingerprints import contents_of, tree_stats
from forge.build.inputs.input_manifest import read_manifest, write_manifest

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.build.inputs.fingerprints import FileTable
    from forge.build.inputs.input_manifest import InputManifest

BEGUN, ENDED = "begun.json", "ended.json"
EXTERNALS = "externals.json"
SOURCES = "sources.json"
"""The sources at the start of the last build, successful or not."""
_GENERATED = (
    "CMakeCache.txt",
    "build.ninja",
    "CMakeFiles/rules.ninja",
    "Makefile",
    "CMakeFiles/Makefile2",
    "cmake_install.cmake",
)
"""What CMake generates for the native tool, which may not be able to read a damaged file."""


@frozen
class LastBuild:
    """Inputs of the last successful build: those saved while it ran, and those outside the package."""

    saved: frozenset[str]
    externals: InputManifest


@frozen
class BegunBuild:
    """A running build: the source folder, the sources at its start, and the inputs of the last build.

    `as_planned` is True if the sources had not changed since the plan was made.
    """

    source: str
    sources: InputManifest
    last: LastBuild
    as_planned: bool = True


def finish_build_dir(build: Path, externals: InputManifest, saved: Iterable[str]) -> None:
    """Record that a build succeeded, its external inputs, and the inputs saved while it ran."""
    folder = build / SCRATCH_DIR
    write_manifest(folder / EXTERNALS, externals)
    note = {"saved": sorted(saved), "generated": generated_digest(build)}
    replace_file(folder / ENDED, json.dumps(note).encode())


def generated_digest(build: Path) -> str:
    """Return a digest of what CMake generated in a build folder."""
    digest = hashlib.sha256()
    for name in _GENERATED:
        text = text_or_nothing(build / name)
        digest.update(hashlib.sha256(text.encode(errors="surrogateescape")).digest())
    return digest.hexdigest()


def read_last(build: Path) -> LastBuild:
    """Return the recorded inputs of the last successful build in a folder."""
    data = read_json(build / SCRATCH_DIR / ENDED)
    return LastBuild(frozenset(data.get("saved", ())), read_manifest(build / SCRATCH_DIR / EXTERNALS) or {})


def saved_during_build(
    build: Path, begun: BegunBuild, externals: InputManifest, table: FileTable, observed: frozenset[str]
) -> frozenset[str]:
    """Return the inputs that were written since the build started, even if with the same content.

    Files that the steps were `observed` to write, or a build backend, are excluded, and so are files that
    were also written during the last build and have the same content: the build writes them.
    """
    note = read_json(build / SCRATCH_DIR / BEGUN)
    written = observed.union(written_by_backend(build))
    then, now, last = begun.sources, tree_stats(begun.source), begun.last
    paths = then.keys() | now.keys()
    changed = {path for path in paths if path not in then or then[path].stats != now.get(path)}
    if changed:
        before = {path: then[path].content for path in changed & then.keys()}
        contents = contents_of(sorted(changed), table)
        changed = {
            path
            for path in changed
            if path not in written and not (path in last.saved and before.get(path) == contents[path])
        }
    recent_externals = {path for path in externals.keys() - written if written_since(path, note["began"])}
    for path in recent_externals:
        known = last.externals.get(path)
        if not (path in last.saved and known is not None and known.content == externals[path].content):
            changed.add(path)
    return frozenset(changed)


def start_time(build: Path) -> float:
    """Return the start of the last build in a folder, in seconds since the epoch; 0 if unknown."""
    data = read_json(build / SCRATCH_DIR / BEGUN).get("began")
    try:
        return data / 1e9 if isinstance(data, int) else 0.0
    except OverflowError:
        return 0.0


def started_empty(build: Path) -> bool:
    """Return True if the last build in a folder started from empty."""
    return read_json(build / SCRATCH_DIR / BEGUN).get("empty") is True


def written_since(path: str, when: int) -> bool:
    """Return True if a file exists and was written or moved here since `when` (nanoseconds)."""
    try:
        status = os.stat(path)  # noqa: PTH116
    except OSError:
        return False
    return max(status.st_mtime_ns, status.st_ctime_ns) >= when


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file, or {} if it is missing or invalid."""
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}
