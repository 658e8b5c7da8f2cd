"""The record of a build folder: the inputs of its contents, and the accesses of its commands.

The journal records the inputs of successful builds only. A build that failed or was killed leaves objects
made from other inputs. Therefore each build folder has its own record. The first line of the file is
written before the first step, after mismatching files were removed. Further lines are appended
when the steps have ended, and when the build has succeeded. A damaged record, or one of another version, is
ignored: the next build begins in an empty folder.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import field
from functools import lru_cache
from pathlib import Path

from forge.base.files import naming, replace_file
from forge.base.frozen import frozen
from forge.base.layout import RECORD_FILE, SCRATCH_DIR
from forge.build.inputs.fingerprints import FileState, Manifest
from forge.engine.accesses import NOT_OBSERVED, ObservedCommands, decode_commands, encode_commands

_VERSION = 5
_INVALID = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


@frozen
class FolderRecord:
    """The inputs of the contents of a build folder.

    `base` is a digest of inputs that no native build tool tracks: forge, tools, variables. `shape` is a
    digest of inputs that take effect at configure time: options, packages in underlays. `needs` are the
    digests of the dependencies' installed files, `sources` the package's own files at the start. `began` is
    the time in nanoseconds.
    """

    base: str
    shape: str
    needs: Mapping[str, str]
    sources: Manifest
    began: int = 0
    from_empty: bool = False
    """The build started in an empty folder."""
    unplanned: bool = False
    """The sources have changed between the plan and the start of the package."""
    dropped: frozenset[str] = frozenset()
    """Products in the renamed folder that are not restored after CMake has run."""
    commands: ObservedCommands = NOT_OBSERVED
    """Accesses of CMake and the commands that created the contents; those of killed steps are unknown."""
    complete: bool = False
    """The build has succeeded."""
    externals: Mapping[str, str] | None = None
    """Digests of the files outside the package that the last successful build read; None before a success.
    """
    saved: frozenset[str] = frozenset()
    """Inputs that were written while the build ran."""
    generated: str = ""
    """A digest of the files that CMake generated for the native tool."""
    products: Mapping[str, str] = field(default_factory=dict)
    """Kind, size and time of the files that native commands wrote, as of the end of the build."""


def begin_record(build: Path, record: FolderRecord) -> None:
    """Write the record of a build whose first step is about to start."""
    data = {
        "version": _VERSION,
        **{name: getattr(record, name) for name in _AT_BEGIN},
        "dropped": sorted(record.dropped),
    }
    replace_file(build / SCRATCH_DIR / RECORD_FILE, json.dumps(data).encode() + b"\n")


_AT_BEGIN = ("base", "shape", "needs", "sources", "began", "externals")


def add_commands(build: Path, commands: ObservedCommands) -> None:
    _append(build, {"commands": encode_commands(commands)})


def complete_record(
    build: Path,
    externals: Mapping[str, str],
    saved: frozenset[str],
    generated: str,
    products: Mapping[str, str],
) -> None:
    data = {"externals": externals, "saved": sorted(saved), "generated": generated, "products": products}
    _append(build, {**data, "complete": True})


def add_saved(build: Path, paths: frozenset[str]) -> None:
    """Record after a build that these inputs, too, were written while it ran."""
    if record := read_record(build):
        _append(build, {"saved": sorted(record.saved | paths)})


def _append(build: Path, data: Mapping[str, object]) -> None:
    path = build / SCRATCH_DIR / RECORD_FILE
    content = json.dumps(data).encode() + b"\n"
    # If the steps have removed the file, the next build starts from empty.
    with contextlib.suppress(FileNotFoundError), naming(path), path.open("r+b") as stream:
        stream.seek(0, os.SEEK_END)
        stream.write(content)


def read_record(build: Path) -> FolderRecord | None:
    """Return the record of a build folder, None without a valid one."""
    path = build / SCRATCH_DIR / RECORD_FILE
    try:
        status = path.stat()
    except OSError:
        return None
    return _record(path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


@lru_cache(maxsize=8)
def _record(path: Path, *_state_of_file: int) -> FolderRecord | None:
    """Return the record in a file; cached, because several stages of a build read it."""
    try:
        first, *more = path.read_bytes().splitlines()
        data = json.loads(first)
        if data.pop("version") != _VERSION or not 0 <= data["began"] < 1 << 63:
            return None
        for line in more:
            data.update(json.loads(line))
        return FolderRecord(
            **{
                **data,
                "needs": dict(data["needs"]),
                "sources": {path: FileState(*state) for path, state in data["sources"].items()},
                "externals": data["externals"] and dict(data["externals"]),
                "dropped": frozenset(data["dropped"]),
                "commands": decode_commands(data["commands"]) if "commands" in data else NOT_OBSERVED,
                "saved": frozenset(data.get("saved", ())),
            }
        )
    except (OSError, *_INVALID):
        return None
