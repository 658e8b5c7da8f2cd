"""What was built from what: an append-only file of JSON lines below the build folder.

The first line names the version of the format. A line {"externals": [...]} adds to the table of files
outside the workspace that later lines number; a line {"package": ...} replaces what earlier lines said
of that package. A package that began and did not end has an incomplete record, which makes no package
fresh. A line that cannot be read, or a file of another version, counts as nothing: the package is built
again, with a note. A line {"ended": false} says that a build began to change the install folder; unless
{"ended": true} follows, it was killed before it wrote the workspace's scripts. A line {"scripts": ...} has
the stamp of these scripts.
"""

from __future__ import annotations

import contextlib
import json
import time
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from forge.files import naming, replace_file
from forge.model import Aborted, Finished, Mark, Parts, Record, Started

if TYPE_CHECKING:
    from collections.abc import Mapping
    from io import FileIO
    from pathlib import Path
    from typing import Any

    from forge.model import BuildPlan, Event

FILE = "forge_journal.jsonl"
_HEADER = {"forge_journal": 3}
_NONSENSE = (ArithmeticError, LookupError, TypeError, ValueError)
"""What a line that was not written by forge, or not wholly, may raise."""


class Journal:
    """The records of one build folder; owned by the loop of the command."""

    def __init__(self, path: Path) -> None:
        """Begin empty; `open_journal` reads what there is."""
        self.path = path
        self.records: dict[str, Record] = {}
        self.damaged = False
        self.ended = True
        """Whether the last build that ran anything came to its end."""
        self.stamp = ""
        """The stamp of all external files when every record agreed with them, else empty."""
        self.scripts = ""
        """The stamp of the workspace's scripts as they were last written."""
        self._externals: dict[str, int] = {}
        self._lines = 0
        self._stream: FileIO | None = None

    def record(self, event: Event, plan: BuildPlan) -> None:
        """Note that a package began, which makes its last record incomplete, or how it ended."""
        match event:
            case Started(name, parts):
                self.end(ended=False)
                before = self.records.get(name) or Record(parts)
                self.remember(name, replace(before, parts=parts, complete=False, began=time.time()))
            case Finished(name, code):
                if event.record is not None:
                    self.remember(name, event.record)
                _write_result(plan, name, str(code))
            case Aborted(name):
                _write_result(plan, name, "SIGINT")
            case _:
                pass

    @property
    def externals(self) -> list[str]:
        """All external files that records number, and some that none does any more."""
        return list(self._externals)

    def end(self, *, ended: bool) -> None:
        """Note that a build began to change the install folder, or that all is written."""
        if ended != self.ended:
            self.ended = ended
            self._append({"ended": ended})

    def agree(self, stamp: str) -> None:
        """Note the stamp of all external files at a moment when every record agrees with them."""
        if stamp != self.stamp:
            self.stamp = stamp
            self._append({"stamp": stamp})

    def doubt(self) -> None:
        """Forget the stamp of all external files, which must be looked at again."""
        self.stamp = ""

    def note_scripts(self, stamp: str) -> None:
        """Note the stamp of the workspace's scripts."""
        if stamp != self.scripts:
            self.scripts = stamp
            self._append({"scripts": stamp})

    def remember(self, name: str, record: Record) -> None:
        """Replace what is known of a package."""
        self.records[name] = record
        new = [path for path in dict.fromkeys(record.externals) if path not in self._externals]
        if new:
            self._append({"externals": new})
            self._number(new)
        self._append(self._written(name, record))

    def forget(self, name: str) -> None:
        """Forget a package."""
        if self.records.pop(name, None):
            self._append({"package": name})

    def close(self) -> None:
        """Close the file, rewritten short when it had grown long."""
        if self._stream:
            self._stream.close()
            self._stream = None
        if self._lines > 3 * len(self.records) + 100:
            used = sorted({path for record in self.records.values() for path in record.externals})
            self._externals.clear()
            self._number(used)
            lines: list[Mapping[str, object]] = [_HEADER, {"externals": used}]
            lines += [{"scripts": self.scripts}] if self.scripts else []
            lines += [self._written(name, record) for name, record in sorted(self.records.items())]
            replace_file(self.path, "".join(json.dumps(line) + "\n" for line in lines).encode())
            self._lines = len(lines)
            self.stamp = ""

    def read(self, text: str) -> None:
        """Take in the lines of a journal."""
        lines = text.splitlines()
        if not lines or _parsed(lines[0]) != _HEADER:
            self.damaged = bool(lines)
            return
        self._lines = len(lines)
        table: list[str] = []
        for line in lines[1:]:
            entry = _parsed(line)
            try:
                if "ended" in entry:
                    self.ended = entry["ended"] is True
                elif "stamp" in entry:
                    self.stamp = _text(entry["stamp"])
                elif "scripts" in entry:
                    self.scripts = _text(entry["scripts"])
                elif "externals" in entry and "package" not in entry:
                    table += _texts(entry["externals"])
                elif "parts" in entry:
                    self.records[_text(entry["package"])] = _record(entry, table)
                else:
                    self.records.pop(entry["package"], None)
            except _NONSENSE:
                self.damaged = True
        self._number(table)

    def _number(self, paths: list[str]) -> None:
        for path in paths:
            self._externals.setdefault(path, len(self._externals))

    def _written(self, name: str, record: Record) -> Mapping[str, object]:
        # Not asdict(), which copies every word of a record that is written at once.
        said = {field.name: getattr(record, field.name) for field in fields(record)}
        for part in ("parts", "sources", "installed"):
            said[part] = {field.name: getattr(said[part], field.name) for field in fields(said[part])}
        said["externals"] = [self._externals[path] for path in record.externals]
        return {"package": name, **said}

    def _append(self, line: Mapping[str, object]) -> None:
        with naming(self.path):
            if self._stream is None:
                new = not self._lines
                self._stream = self.path.open("wb" if new else "ab", buffering=0)
                # A torn last line must not swallow the next one.
                self._write(_HEADER if new else None)
            self._write(line)
        self._lines += 1

    def _write(self, line: Mapping[str, object] | None) -> None:
        """Write a line, or an empty one, at once; raises OSError when only a part of it found room."""
        assert self._stream is not None  # noqa: S101  (opened above)
        content = b"\n" if line is None else json.dumps(line).encode() + b"\n"
        while content:
            content = content[self._stream.write(content) or 0 :]


def open_journal(build: Path) -> Journal:
    """Return the journal of a build folder; an unreadable one is an empty one."""
    journal = Journal(build / FILE)
    with contextlib.suppress(OSError):
        journal.read(journal.path.read_text(encoding="utf-8", errors="surrogateescape"))
    return journal


def _record(entry: Mapping[str, Any], table: list[str]) -> Record:
    """Return the record that a line holds; raises one of _NONSENSE for anything else."""
    parts = entry["parts"]
    return Record(
        parts=Parts(
            forge=_text(parts["forge"]),
            options=_texts(parts["options"]),
            tools=_pairs(parts["tools"]),
            environment=_pairs(parts["environment"]),
            sources=_text(parts["sources"]),
            needs=_pairs(parts["needs"]),
            underlays=_text(parts["underlays"]),
        ),
        complete=entry["complete"] is True,
        sources=_mark(entry["sources"]),
        installed=_mark(entry["installed"]),
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


def _pairs(said: list[list[str]]) -> tuple[tuple[str, str], ...]:
    return tuple((_text(name), _text(value)) for name, value in said)


def _mark(said: Mapping[str, object]) -> Mark:
    return Mark(**{name: _text(value) for name, value in said.items()})


def _texts(said: object) -> tuple[str, ...]:
    if not isinstance(said, list):
        raise TypeError("this is no list")
    return tuple(map(_text, said))


def _text(said: object) -> str:
    if not isinstance(said, str):
        raise TypeError("this is no text")
    return said


def _parsed(line: str) -> dict[str, Any]:
    """Return the object on a line; a blank, torn or foreign line is one about no package."""
    try:
        value = json.loads(line) if line else {}
    except (ValueError, RecursionError):
        value = None
    return value if isinstance(value, dict) and value else {"package": None}


def _write_result(plan: BuildPlan, name: str, result: str) -> None:
    """Leave colcon's own note of how a package ended, which its selection options read."""
    folder = plan.tasks[name].build_dir
    if folder.is_dir():
        replace_file(folder / "colcon_build.rc", f"{result}\n".encode())
