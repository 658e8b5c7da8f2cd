"""What was built from what: an append-only file of JSON lines below the build folder.

The first line names the version of the format. A later line about a package replaces an earlier one;
a line that cannot be read, or a file of another version, counts as nothing: the package is built again.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.files import replace_file
from forge.model import Aborted, Finished, Started

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import TextIO

    from forge.model import BuildPlan, Event

FILE = "forge_journal.jsonl"
_HEADER = {"forge_journal": 1}


class Journal:
    """The records of one build folder; owned by the loop of the command."""

    def __init__(self, path: Path, digests: Mapping[str, str], lines: int) -> None:
        """Begin with what was read; `open_journal` does that."""
        self.path = path
        self.digests = dict(digests)
        self._lines = lines
        self._stream: TextIO | None = None

    def record(self, event: Event, plan: BuildPlan) -> None:
        """Note that a package began, which forgets its last build, or ended well."""
        match event:
            case Started(task):
                self.digests.pop(task, None)
                self._append({"package": task})
            case Finished(task, code) if code == 0:
                digest = plan.tasks[task].digest
                self.digests[task] = digest
                self._append({"package": task, "digest": digest, "seconds": round(event.seconds, 3)})
                self._write_result(plan, task, "0")
            case Finished(task, code):
                self._write_result(plan, task, str(code))
            case Aborted(task):
                self._write_result(plan, task, "SIGINT")
            case _:
                pass

    def close(self) -> None:
        """Close the file, rewritten short when it had grown long."""
        if self._stream:
            self._stream.close()
            self._stream = None
        if self._lines > 4 * len(self.digests) + 100:
            lines = [_HEADER, *({"package": p, "digest": d} for p, d in sorted(self.digests.items()))]
            replace_file(self.path, "".join(json.dumps(line) + "\n" for line in lines).encode())

    def _append(self, line: Mapping[str, object]) -> None:
        if self._stream is None:
            new = not self._lines
            self._stream = self.path.open("w" if new else "a", encoding="utf-8")
            if new:
                self._stream.write(json.dumps(_HEADER) + "\n")
        self._stream.write(json.dumps(line) + "\n")
        self._stream.flush()
        self._lines += 1

    def _write_result(self, plan: BuildPlan, task: str, result: str) -> None:
        """Leave colcon's own note of how a package ended, which its selection options read."""
        folder = plan.tasks[task].build_dir
        if folder.is_dir():
            (folder / "colcon_build.rc").write_text(result + "\n", encoding="utf-8")


def open_journal(build: Path) -> Journal:
    """Return the journal of a build folder; an unreadable one is an empty one."""
    path = build / FILE
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    if not lines or _parsed(lines[0]) != _HEADER:
        return Journal(path, {}, 0)
    digests: dict[str, str] = {}
    for line in lines[1:]:
        entry = _parsed(line)
        name, digest = entry.get("package"), entry.get("digest")
        if isinstance(name, str):
            digests.pop(name, None)
            if isinstance(digest, str):
                digests[name] = digest
    return Journal(path, digests, len(lines))


def _parsed(line: str) -> dict[str, object]:
    """Return the object on a line; a torn or foreign line is an empty one."""
    try:
        value = json.loads(line)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}
