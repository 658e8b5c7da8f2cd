"""Log files: a folder per run, with a folder per package and a file of all events.

log/build_2026-11-21_09-30-00/events.jsonl         all events except output, one per line
log/build_2026-11-21_09-30-00/PACKAGE/command.log  commands, their folders and exit codes
log/build_2026-11-21_09-30-00/PACKAGE/{stdout,stderr,stdout_stderr,streams}.log
log/latest_build -> build_2026-11-21_09-30-00, log/latest -> latest_build
"""

from __future__ import annotations

import contextlib
import os
import shlex
import time
from datetime import datetime
from typing import TYPE_CHECKING

from forge.base.env_vars import without_passwords
from forge.base.errors import EnvironmentFault, Location, Problem
from forge.base.files import naming
from forge.base.layout import IGNORE_MARK
from forge.base.text import split_lines
from forge.build.events import Output, StepFinished, StepStarted

if TYPE_CHECKING:
    from pathlib import Path
    from typing import BinaryIO

    from forge.build.events import Event


class LogWriter:
    """Writes the log of one run."""

    def __init__(self, folder: Path | None) -> None:
        """Write below `folder`, or nowhere if it is None."""
        self.folder = folder
        self._begun = time.monotonic()
        self._files: dict[Path, BinaryIO] = {}

    def close(self) -> None:
        """Close every file."""
        for stream in self._files.values():
            stream.close()
        self._files.clear()

    def write(self, event: Event) -> None:
        """Append an event to its files."""
        if self.folder is None:
            return
        match event:
            case Output(task, lines, stderr):
                own = "stderr" if stderr else "stdout"
                for name in (own, "stdout_stderr"):
                    self._append(f"{task}/{name}.log", lines)
                stamp = self._stamp()
                stamped = b"".join(stamp + line for line in split_lines(lines))
                self._append(f"{task}/streams.log", stamped)
            case StepStarted() | StepFinished():
                text = _command_line(event)
                self._append(f"{event.task}/command.log", text)
                self._append(f"{event.task}/streams.log", self._stamp() + text)
            case _:
                pass

    def note(self, line: bytes) -> None:
        """Append a line to the file of all events."""
        if self.folder is not None:
            self._append("events.jsonl", line)

    def _stamp(self) -> bytes:
        return f"[{time.monotonic() - self._begun:.3f}s] ".encode()

    def _append(self, name: str, content: bytes) -> None:
        assert self.folder is not None  # noqa: S101  (checked by callers)
        path = self.folder / name
        stream = self._files.get(path)
        if stream is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            stream = self._files[path] = path.open("ab", buffering=0)
        with naming(path):
            stream.write(content)


def open_log(logs: Path | None, verb: str, argv: list[str]) -> LogWriter:
    """Create the log folder of a run and point `latest` to it; raises EnvironmentFault."""
    if logs is None:
        return LogWriter(None)
    try:
        folder = _new_folder(logs, verb)
        command = shlex.join(map(without_passwords, argv))
        (folder / "logger_all.log").write_text(f"command line: {command}\n", encoding="utf-8")
        _point(logs / f"latest_{verb}", folder.name)
        _point(logs / "latest", f"latest_{verb}")
    except OSError as error:
        problem = Problem(
            f"cannot write logs: {error.strerror}",
            Location(logs),
            "choose another folder with --log-base DIR",
        )
        raise EnvironmentFault(problem) from None
    return LogWriter(folder)


def _new_folder(logs: Path, verb: str) -> Path:
    logs.mkdir(parents=True, exist_ok=True)
    (logs / IGNORE_MARK).touch()
    name = datetime.now().astimezone().strftime(f"{verb}_%Y-%m-%d_%H-%M-%S")
    for suffix in ("", *(f"_{number}" for number in range(2, 1000))):
        with contextlib.suppress(FileExistsError):
            (logs / (name + suffix)).mkdir()
            return logs / (name + suffix)
    raise FileExistsError(0, "too many runs within a second", str(logs))


def _point(link: Path, target: str) -> None:
    """Create or replace a relative symbolic link; keep anything else with that name."""
    if link.is_symlink():
        link.unlink()
    elif link.exists():
        return
    # A concurrent run may have created the link meanwhile.
    with contextlib.suppress(FileExistsError):
        link.symlink_to(target)


def _command_line(event: StepStarted | StepFinished) -> bytes:
    command = shlex.join(event.step.argv)
    if isinstance(event, StepFinished):
        return f"Invoked command in '{event.step.cwd}' returned '{event.code}': {command}\n".encode()
    variables = "".join(f"{_assignment(name, value)} " for name, value in event.environment)
    return f"Invoking command in '{event.step.cwd}': {variables}{command}\n".encode()


def _assignment(name: str, value: str) -> str:
    """Return a change of a variable in shell syntax, without its own value, which may be a secret."""
    inherited = os.environ.get(name)
    if not inherited or inherited not in value:
        return f"{name}={shlex.quote(value)}"
    head, _, tail = value.partition(inherited)
    return f"{name}={shlex.quote(head) if head else ''}${{{name}}}{shlex.quote(tail) if tail else ''}"
