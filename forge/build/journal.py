"""The build journal: an append-only file of JSON lines below the build folder.

The first line is the format version. A line {"externals": [...]} extends the table of files outside the
workspace, which later lines refer to by index. A line {"package": ...} replaces the earlier record of that
package. A package that started and did not finish has an incomplete record and is not up to date. Unreadable
lines and files of another version are ignored with a note; the affected packages are rebuilt. A line
{"ended": false} means that a build started to change the install folder; without a following {"ended": true}
it was killed before it wrote the workspace's scripts. A line {"scripts": ...} contains the stamp of these
scripts.
"""

from __future__ import annotations

import contextlib
import json
import time
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from forge.base.files import naming, replace_file
from forge.base.layout import BUILD_RESULT, JOURNAL_FILE
from forge.build.events import Aborted, Finished, Started
from forge.build.model import BuildInputs, BuildRecord, Fingerprint

if TYPE_CHECKING:
    from collections.abc import Mapping
    from io import FileIO
    from pathlib import Path
    from typing import Any

    from forge.build.events import Event
    from forge.build.tasks import BuildPlan

_HEADER = {"forge_journal": 6}
_INVALID_ENTRY = (ArithmeticError, LookupError, TypeError, ValueError)
"""Exceptions raised by torn lines and lines that forge did not write."""


class Journal:
    """The records of one build folder; owned by the build loop."""

    def __init__(self, path: Path) -> None:
        """Start empty; use `open_journal` to read an existing journal."""
        self.path = path
        self.records: dict[str, BuildRecord] = {}
        self.ended = True
        """False if the last build that changed the install folder was killed."""
        self.stamp = ""
        """The stamp of all external files if it matches every record, else empty."""
        self.scripts = ""
        """The stamp of the workspace's scripts as last written."""
        self._externals: dict[str, int] = {}
        self._lines = 0
        self._stream: FileIO | None = None

    def record(self, event: Event, plan: BuildPlan) -> None:
        """Record the start of a package, which makes its last record incomplete, or its result."""
        match event:
            case Started(name, inputs):
                self.end(ended=False)
                before = self.records.get(name) or BuildRecord(inputs)
                self.set_record(name, replace(before, inputs=inputs, complete=False, began=time.time()))
            case Finished(name, code):
                if event.record is not None:
                    self.set_record(name, event.record)
                _write_result(plan, name, str(code))
            case Aborted(name):
                _write_result(plan, name, "SIGINT")
            case _:
                pass

    @property
    def externals(self) -> list[str]:
        """All external files that records refer to, and some that are no longer referred to."""
        return list(self._externals)

    def end(self, *, ended: bool) -> None:
        """Record that a build started to change the install folder, or that it finished doing so."""
        if ended != self.ended:
            self.ended = ended
            self._append({"ended": ended})

    def set_stamp(self, stamp: str) -> None:
        """Record the stamp of all external files; every record must match their current contents."""
        if stamp != self.stamp:
            self.stamp = stamp
            self._append({"stamp": stamp})

    def clear_stamp(self) -> None:
        """Drop the stamp of all external files, so that each is checked again."""
        self.stamp = ""

    def note_scripts(self, stamp: str) -> None:
        """Record the stamp of the workspace's scripts."""
        if stamp != self.scripts:
            self.scripts = stamp
            self._append({"scripts": stamp})

    def set_record(self, name: str, record: BuildRecord) -> None:
        """Add or replace the record of a package."""
        self.records[name] = record
        new = [path for path in dict.fromkeys(record.externals) if path not in self._externals]
        if new:
            self._append({"externals": new})
            self._number(new)
        self._append(self._entry(name, record))

    def forget(self, name: str) -> None:
        """Remove the record of a package."""
        if self.records.pop(name, None):
            self._append({"package": name})

    def close(self) -> None:
        """Close the file; compact it if it has grown long."""
        if self._stream:
            self._stream.close()
            self._stream = None
        if self._lines > 3 * len(self.records) + 100:
            used = sorted({path for record in self.records.values() for path in record.externals})
            self._externals.clear()
            self._number(used)
            lines: list[Mapping[str, object]] = [_HEADER, {"externals": used}]
            lines += [{"scripts": self.scripts}] if self.scripts else []
            lines += [self._entry(name, record) for name, record in sorted(self.records.items())]
            replace_file(self.path, "".join(json.dumps(line) + "\n" for line in lines).encode())
            self._lines = len(lines)
            self.stamp = ""

    def read(self, text: str) -> None:
        """Read the lines of a journal."""
        lines = text.splitlines()
        if not lines or _parsed(lines[0]) != _HEADER:
            return
        self._lines = len(lines)
        table: list[str] = []
        for line in lines[1:]:
            entry = _parsed(line)
            with contextlib.suppress(*_INVALID_ENTRY):
                if "ended" in entry:
                    self.ended = entry["ended"] is True
                elif "stamp" in entry:
                    self.stamp = _text(entry["stamp"])
                elif "scripts" in entry:
                    self.scripts = _text(entry["scripts"])
                elif "externals" in entry and "package" not in entry:
                    table += _texts(entry["externals"])
                elif "inputs" in entry:
                    self.records[_text(entry["package"])] = _record(entry, table)
                else:
                    self.records.pop(entry["package"], None)
        self._number(table)

    def _number(self, paths: list[str]) -> None:
        for path in paths:
            self._externals.setdefault(path, len(self._externals))

    def _entry(self, name: str, record: BuildRecord) -> Mapping[str, object]:
        # Not asdict(), which would make a deep copy of the record.
        data = {field.name: getattr(record, field.name) for field in fields(record)}
        for part in ("inputs", "sources", "installed"):
            data[part] = {field.name: getattr(data[part], field.name) for field in fields(data[part])}
        data["externals"] = [self._externals[path] for path in record.externals]
        return {"package": name, **data}

    def _append(self, line: Mapping[str, object]) -> None:
        with naming(self.path):
            if self._stream is None:
                new = not self._lines
                self._stream = self.path.open("wb" if new else "ab", buffering=0)
                # Terminate a torn last line before appending.
                self._write(_HEADER if new else None)
            self._write(line)
        self._lines += 1

    def _write(self, line: Mapping[str, object] | None) -> None:
        """Write one line, or an empty one, unbuffered; raises OSError if it cannot be written completely."""
        assert self._stream is not None
        content = b"\n" if line is None else json.dumps(line).encode() + b"\n"
        while content:
            content = content[self._stream.write(content) or 0 :]


def open_journal(build: Path) -> Journal:
    """Return the journal of a build folder; an unreadable one counts as empty."""
    journal = Journal(build / JOURNAL_FILE)
    with contextlib.suppress(OSError):
        journal.read(journal.path.read_text(encoding="utf-8", errors="surrogateescape"))
    return journal


def _record(entry: Mapping[str, Any], table: list[str]) -> BuildRecord:
    """Return the record in a line; raises one of _INVALID_ENTRY if it is invalid."""
    inputs = entry["inputs"]
    return BuildRecord(
        inputs=BuildInputs(
            forge=_text(inputs["forge"]),
            options=_texts(inputs["options"]),
            tools=_pairs(inputs["tools"]),
            environment=_pairs(inputs["environment"]),
            sources=_text(inputs["sources"]),
            needs=_pairs(inputs["needs"]),
            underlays=_text(inputs["underlays"]),
        ),
        complete=entry["complete"] is True,
        sources=_fingerprint(entry["sources"]),
        installed=_fingerprint(entry["installed"]),
        files=_texts(entry["files"]),
        externals=tuple(table[number] for number in entry["externals"]),
        external=_text(entry["external"]),
        seconds=float(entry["seconds"]),
        began=float(entry["began"]),
        tree=_text(entry.get("tree", "")),
        saved=_texts(entry["saved"]),
        from_empty=entry["from_empty"] is True,
        read_from=_texts(entry["read_from"]),
        folders=_texts(entry["folders"]),
    )


def _pairs(data: list[list[str]]) -> tuple[tuple[str, str], ...]:
    return tuple((_text(name), _text(value)) for name, value in data)


def _fingerprint(data: Mapping[str, object]) -> Fingerprint:
    return Fingerprint(**{name: _text(value) for name, value in data.items()})


def _texts(data: object) -> tuple[str, ...]:
    if not isinstance(data, list):
        raise TypeError("expected a list")
    if {*map(type, data)} - {str}:
        raise TypeError("expected strings")
    return tuple(data)


def _text(data: object) -> str:
    if not isinstance(data, str):
        raise TypeError("expected a string")
    return data


def _parsed(line: str) -> dict[str, Any]:
    """Return the object in a line; blank, torn and foreign lines become {"package": None}."""
    try:
        value = json.loads(line) if line else {}
    except (ValueError, RecursionError):
        value = None
    return value if isinstance(value, dict) and value else {"package": None}


def _write_result(plan: BuildPlan, name: str, result: str) -> None:
    """Write colcon_build.rc with the result of a package, which colcon's selection options read."""
    folder = plan.tasks[name].build_dir
    if folder.is_dir():
        replace_file(folder / BUILD_RESULT, f"{result}\n".encode())
