"""The build journal: an append-only file of JSON lines below the build folder.

The first line is the format version. A line {"externals": [...]} extends the table of files outside the
workspace, which later lines refer to by index. A line {"package": ...} replaces the earlier record of that
package, and a line {"started": ...} makes it incomplete: it is not up to date until it has finished.
Unreadable lines and files of another version are ignored; the affected packages are rebuilt. A line
{"ended": false} means that a build started to change the install folder; without a following {"ended": true}
it was killed before it wrote the workspace's scripts. A line {"scripts": ...} contains the stamp of these
scripts.
"""

from __future__ import annotations

import contextlib
import json
import time
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from forge.base.files import naming, replace_file
from forge.base.layout import BUILD_RESULT, JOURNAL_FILE
from forge.build.events import Aborted, Event, Finished, Started
from forge.build.model import BuildInputs, BuildRecord, Fingerprint

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from io import FileIO
    from pathlib import Path

    from forge.build.tasks import BuildPlan

_HEADER = {"forge_journal": 7}
_MUCH = 1 << 20
"""The tolerated number of characters in obsolete lines."""
_INVALID_ENTRY = (ArithmeticError, LookupError, TypeError, ValueError)
"""Exceptions raised by torn lines and lines that forge did not write."""


class Journal:
    """The records of one build folder; owned by the build loop."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: dict[str, BuildRecord] = {}
        self.ended = True
        """False if the last build that changed the install folder was killed."""
        self.stamp = ""
        """The stamp of all external files if it matches every record; else empty: each is checked again."""
        self.scripts = ""
        """The stamp of the workspace's scripts as last written."""
        self._externals: dict[str, int] = {}
        self._lines = 0
        self._size = 0
        """The number of characters in the file."""
        self._sizes: dict[str, int] = {}
        """The number of characters of each package's last record."""
        self._stream: FileIO | None = None

    def record(self, event: Event, plan: BuildPlan) -> None:
        """Record the start of a package, which makes its last record incomplete, or its result."""
        match event:
            case Started(name, inputs):
                self.note("ended", False)
                began = time.time()
                self._start(name, inputs, began)
                self._append({"started": name, "inputs": _data(inputs), "began": began})
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

    def note(self, name: Literal["ended", "stamp", "scripts"], value: bool | str) -> None:
        """Set one of the attributes, and record it if it was different."""
        if value != getattr(self, name):
            setattr(self, name, value)
            self._append({name: value})

    def set_record(self, name: str, record: BuildRecord) -> None:
        self.records[name] = record
        new = [path for path in dict.fromkeys(record.externals) if path not in self._externals]
        if new:
            self._append({"externals": new})
            self._number(new)
        self._sizes[name] = self._append(self._entry(name, record))

    def _start(self, name: str, inputs: BuildInputs, began: float) -> None:
        before = self.records.get(name) or BuildRecord(inputs)
        self.records[name] = replace(before, inputs=inputs, complete=False, began=began)

    def forget(self, name: str) -> None:
        """Remove the record of a package; others may have installed files that it replaced."""
        record = self.records.pop(name, None)
        if record is None:
            return
        self._append({"package": name})
        files = frozenset(record.files)
        for other, each in [*self.records.items()]:
            if each.installed.stamp and not files.isdisjoint(each.files):
                self.set_record(other, replace(each, installed=replace(each.installed, stamp="")))

    def close(self) -> None:
        """Close the file; compact it if most of it is obsolete."""
        if self._stream:
            self._stream.close()
            self._stream = None
        sizes = sum(self._sizes.get(name, 0) for name in self.records)
        if self._lines > 3 * len(self.records) + 100 or self._size > 3 * sizes + _MUCH:
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
        lines = text.splitlines()
        if not lines or _parsed(lines[0]) != _HEADER:
            return
        self._lines, self._size = len(lines), len(text)
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
                elif "started" in entry:
                    inputs, began = _value(BuildInputs, entry["inputs"]), float(entry["began"])
                    self._start(_text(entry["started"]), inputs, began)
                elif "inputs" in entry:
                    externals = [table[number] for number in entry["externals"]]
                    name = _text(entry["package"])
                    self.records[name] = _value(BuildRecord, {**entry, "externals": externals})
                    self._sizes[name] = len(line)
                else:
                    self.records.pop(entry["package"], None)
        self._number(table)

    def _number(self, paths: list[str]) -> None:
        for path in paths:
            self._externals.setdefault(path, len(self._externals))

    def _entry(self, name: str, record: BuildRecord) -> Mapping[str, object]:
        externals = [self._externals[path] for path in record.externals]
        return {"package": name, **_data(record), "externals": externals}

    def _append(self, line: Mapping[str, object]) -> int:
        """Write a line, unbuffered; return its length. Raises OSError if it cannot be written completely."""
        with naming(self.path):
            new = not self._lines
            content = b""
            if self._stream is None:
                self._stream = self.path.open("wb" if new else "ab", buffering=0)
                # Terminate a torn last line before appending.
                content = json.dumps(_HEADER).encode() + b"\n" if new else b"\n"
            text = json.dumps(line).encode() + b"\n"
            content += text
            while content:
                content = content[self._stream.write(content) or 0 :]
        self._lines += 1
        self._size += len(text)
        return len(text)


def open_journal(build: Path) -> Journal:
    """Return the journal of a build folder; an unreadable one counts as empty."""
    journal = Journal(build / JOURNAL_FILE)
    with contextlib.suppress(OSError):
        journal.read(journal.path.read_text(encoding="utf-8", errors="surrogateescape"))
    return journal


def _data(value: BuildRecord | BuildInputs | Fingerprint) -> dict[str, object]:
    """Return a value as JSON data; unlike asdict(), without a deep copy."""
    values = ((field.name, getattr(value, field.name)) for field in fields(value))
    return {
        name: _data(each) if isinstance(each, BuildInputs | Fingerprint) else each for name, each in values
    }


def _value(type_: type[_Type], data: Mapping[str, Any]) -> _Type:
    """Return the value of a frozen class; raises one of _INVALID_ENTRY for invalid data."""
    arguments: dict[str, Any] = {field.name: _READ[field.type](data[field.name]) for field in fields(type_)}
    return type_(**arguments)


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


_Type = TypeVar("_Type", BuildRecord, BuildInputs, Fingerprint)
_READ: Mapping[Any, Callable[[Any], object]] = {
    "BuildInputs": partial(_value, BuildInputs),
    "Fingerprint": partial(_value, Fingerprint),
    "Pairs": lambda data: tuple((_text(name), _text(value)) for name, value in data),
    "bool": lambda data: data is True,
    "float": float,
    "str": _text,
    "tuple[str, ...]": _texts,
}
"""Decoders for fields of records, by type."""


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
