"""Log files, as colcon writes them: a folder per run, with a folder per package.

log/build_2026-11-21_09-30-00/events.jsonl         all events except output, as JSON
log/build_2026-11-21_09-30-00/PACKAGE/command.log  commands, their folders and exit codes
log/build_2026-11-21_09-30-00/PACKAGE/{stdout,stderr,stdout_stderr,streams}.log
log/latest_build -> build_2026-11-21_09-30-00, log/latest -> latest_build
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import time
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from forge.base.errors import HostError, Location, Problem
from forge.base.files import naming
from forge.base.layout import IGNORE_MARK
from forge.base.text import split_lines
from forge.build.events import Aborted, Event, Finished, Fresh, Output, Started, StepFinished, StepStarted
from forge.build.folder_marks import is_own_log_link

EVENTS_FILE = "events.jsonl"
_OF_PACKAGE = ("command.log", "stderr.log", "stdout.log", "stdout_stderr.log", "streams.log")
_COLOUR = re.compile(rb"\x1b\[[\d;]*[mK]")


class LogWriter:
    def __init__(self, folder: Path | None) -> None:
        """Write below `folder`, or nowhere if it is None."""
        self.folder = folder
        self.coloured = False
        """Whether forge asked compilers for colours, which logs do not contain."""
        self._begun = time.monotonic()
        self._files: dict[str, BinaryIO] = {}
        self._started: dict[str, float] = {}

    def close(self) -> None:
        for stream in self._files.values():
            stream.close()

    def write(self, event: Event) -> None:
        """Append an event to the files of its package."""
        if self.folder is None:
            return
        name = event.task
        match event:
            case Started():
                self._started[name] = time.monotonic()
            case StepStarted() | StepFinished():
                text = command_line(event).encode(errors="surrogateescape")
                self._append_for(name, "command.log", text)
                self._append_for(name, "streams.log", self._stamp(name) + text)
            case Output(_, lines, stderr):
                lines = without_colours(lines) if self.coloured else lines
                stamp = self._stamp(name)
                self._append_for(name, "stderr.log" if stderr else "stdout.log", lines)
                self._append_for(name, "stdout_stderr.log", lines)
                self._append_for(name, "streams.log", b"".join([stamp + line for line in split_lines(lines)]))
            case Fresh() | Finished() | Aborted():
                for file in _OF_PACKAGE:
                    if stream := self._files.pop(f"{name}/{file}", None):
                        stream.close()

    def note(self, line: bytes) -> None:
        """Append a line to the file of all events as JSON."""
        if self.folder is not None:
            self._append(EVENTS_FILE, line)

    def _stamp(self, name: str) -> bytes:
        return f"[{time.monotonic() - self._started.get(name, self._begun):.3f}s] ".encode()

    def _append_for(self, name: str, file: str, content: bytes) -> None:
        """Append to a file of a package; the first call creates all of its files, as readers expect."""
        path = f"{name}/{file}"
        if path not in self._files:
            assert self.folder is not None
            (self.folder / name).mkdir(exist_ok=True)
            for each in _OF_PACKAGE:
                self._append(f"{name}/{each}", b"")
        self._append(path, content)

    def _append(self, name: str, content: bytes) -> None:
        stream = self._files.get(name)
        if stream is None:
            assert self.folder is not None
            stream = self._files[name] = (self.folder / name).open("ab", buffering=0)
        with naming(stream.name):
            stream.write(content)


def open_log(logs: Path | None, verb: str) -> LogWriter:
    """Create the log folder of a run and point `latest` to it; raises HostError."""
    if logs is None:
        return LogWriter(None)
    try:
        logs.mkdir(parents=True, exist_ok=True)
        if not os.path.lexists(logs / IGNORE_MARK):
            (logs / IGNORE_MARK).touch()
        name = datetime.now().astimezone().strftime(f"{verb}_%Y-%m-%d_%H-%M-%S")
        for suffix in ("", *(f"_{number}" for number in range(2, 1000))):
            folder = logs / f"{name}{suffix}"
            with contextlib.suppress(FileExistsError):
                folder.mkdir()
                break
        else:
            raise FileExistsError(0, "too many runs within a second", str(logs))
        (folder / EVENTS_FILE).touch()
        _point(logs / f"latest_{verb}", folder.name)
        _point(logs / "latest", f"latest_{verb}")
    except OSError as error:
        hint = "choose another folder with --log-base DIR"
        raise HostError(Problem(f"cannot write logs: {error.strerror}", Location(logs), hint)) from None
    return LogWriter(folder)


def _point(link: Path, target: str) -> None:
    """Create or replace a link to the latest run; keep anything else with that name."""
    if is_own_log_link(link):
        link.unlink(missing_ok=True)
    # A concurrent run may have created it meanwhile, or it may be a file of the user.
    with contextlib.suppress(FileExistsError):
        link.symlink_to(target)


def without_colours(output: bytes) -> bytes:
    return _COLOUR.sub(b"", output)


def command_line(event: StepStarted | StepFinished) -> str:
    """Return colcon's line about the start or end of a command."""
    command = shlex.join(event.step.argv)
    if isinstance(event, StepFinished):
        return f"Invoked command in '{event.step.cwd}' returned '{event.code}': {command}\n"
    words = []
    for name, value in event.environment:
        head, inherited, tail = inherited_parts(name, value)
        quoted = [shlex.quote(text) if text or not inherited else "" for text in (head, tail)]
        words.append(f"{name}={quoted[0]}${{{name}}}{quoted[1]}" if inherited else f"{name}={quoted[0]}")
    return f"Invoking command in '{event.step.cwd}': {' '.join((*words, command))}\n"


def inherited_parts(name: str, value: str) -> tuple[str, str, str]:
    """Return the text before the inherited value of a variable, this value ('' without it), and the rest.

    The inherited value is not logged, because it may be a secret.
    """
    inherited = os.environ.get(name)
    return value.partition(inherited) if inherited else (value, "", "")
