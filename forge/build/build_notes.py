"""What a build folder notes of its builds: when and from what they began, how they ended, what was saved."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from forge.build.input_manifest import read_manifest, write_manifest
from forge.build.native_graph import read_native_graph
from forge.digests import contents_of, tree_stats
from forge.externals import written_by_backend
from forge.files import replace_file
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.build.input_manifest import InputManifest
    from forge.digests import FileTable

RECORDS = "handover"
"""The folder in a build folder that is forge's own."""
BEGUN, ENDED = "begun.json", "ended.json"
EXTERNALS = "externals.json"


@frozen
class LastBuild:
    """What the last build that ended well noted: inputs saved meanwhile, and the files it read elsewhere."""

    saved: frozenset[str]
    externals: InputManifest


@frozen
class BegunBuild:
    """A build that runs: the package's folder, its sources when it began, and what the last one noted.

    `as_planned` tells if the sources were still what they had been when the whole build was planned.
    """

    source: str
    sources: InputManifest
    last: LastBuild
    as_planned: bool = True


def finish_build_dir(build: Path, externals: InputManifest, saved: Iterable[str]) -> None:
    """Note that a build ended well, what it read elsewhere, and which inputs were saved meanwhile."""
    folder = build / RECORDS
    write_manifest(folder / EXTERNALS, externals)
    replace_file(folder / ENDED, json.dumps({"saved": sorted(saved)}).encode())


def read_last(build: Path) -> LastBuild:
    """Return what the last build that ended well in a folder noted of its inputs."""
    said = read_json(build / RECORDS / ENDED)
    return LastBuild(frozenset(said.get("saved", ())), read_manifest(build / RECORDS / EXTERNALS) or {})


def saved_meanwhile(
    build: Path, begun: BegunBuild, externals: InputManifest, table: FileTable
) -> frozenset[str]:
    """Return the inputs that were written since the build began, whatever they say now.

    What the native tool or a build backend itself made among the sources does not count, nor does a file
    that was written during the last build, too, and says what it said: the build writes it.
    """
    note = read_json(build / RECORDS / BEGUN)
    then, now, last = begun.sources, tree_stats(begun.source), begun.last
    paths = then.keys() | now.keys()
    changed = {path for path in paths if path not in then or then[path].stats != now.get(path)}
    if changed:
        made = {output for edge in read_native_graph(build).edges for output in edge.outputs}
        made.update(written_by_backend(build))
        before = {path: then[path].content for path in changed & then.keys()}
        contents = contents_of(sorted(changed), table)
        changed = {
            path
            for path in changed
            if path not in made and not (path in last.saved and before.get(path) == contents[path])
        }
    elsewhere = {path for path in externals if written_since(path, note["began"])}
    for path in elsewhere:
        known = last.externals.get(path)
        if not (path in last.saved and known is not None and known.content == externals[path].content):
            changed.add(path)
    return frozenset(changed)


def began(build: Path) -> float:
    """Return when the last build in a folder began, in seconds since the epoch; 0 when nobody knows."""
    said = read_json(build / RECORDS / BEGUN).get("began")
    try:
        return said / 1e9 if isinstance(said, int) else 0.0
    except OverflowError:
        return 0.0


def began_empty(build: Path) -> bool:
    """Tell if the last build in a folder found it empty."""
    return read_json(build / RECORDS / BEGUN).get("empty") is True


def written_since(path: str, when: int) -> bool:
    """Tell if a file was written, or came here, since a moment in nanoseconds; a missing one was not."""
    try:
        status = os.stat(path)  # noqa: PTH116
    except OSError:
        return False
    return max(status.st_mtime_ns, status.st_ctime_ns) >= when


def read_json(path: Path) -> dict[str, Any]:
    """Return the object that a file holds; an empty one when there is none that can be read."""
    try:
        said = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}
