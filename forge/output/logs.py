"""Log files, as colcon writes them: a folder per run, with a folder per package and files of all events.

log/build_2026-11-21_09-30-00/events.log           all events, for colcon-dashboard and similar tools
log/build_2026-11-21_09-30-00/events.jsonl         all events except output, as JSON
log/build_2026-11-21_09-30-00/logger_all.log       the command line, and the commands of all packages
log/build_2026-11-21_09-30-00/PACKAGE/command.log  commands, their folders and exit codes
log/build_2026-11-21_09-30-00/PACKAGE/{stdout,stderr,stdout_stderr,streams}.log
log/latest_build -> build_2026-11-21_09-30-00, log/latest -> latest_build
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import threading
import time
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from forge.base.env_vars import without_passwords
from forge.base.errors import HostError, Location, Problem
from forge.base.layout import IGNORE_MARK
from forge.base.text import split_lines
from forge.build.events import (
    Aborted,
    Event,
    Finished,
    Fresh,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)
from forge.build.folder_marks import is_own_log_link

_OF_PACKAGE = ("command.log", "stderr.log", "stdout.log", "stdout_stderr.log", "streams.log")
_COLOUR = re.compile(rb"\x1b\[[\d;]*[mK]")
_HEARTBEAT = 1.0
"""Seconds between timer events, which show readers of events.log that a silent build is still running."""


class LogWriter:
    def __init__(self, folder: Path | None) -> None:
        """Write below `folder`, or nowhere if it is None."""
        self.folder = folder
        self.coloured = False
        """Whether forge asked compilers for colours, which logs do not contain."""
        self._begun = time.monotonic()
        self._files: dict[str, BinaryIO] = {}
        self._started: dict[str, float] = {}
        self._closed = threading.Event()
        self._heart = threading.Thread(target=self._beat, daemon=True)
        if folder is not None:
            self._append("events.log", b"[0.000000] (-) TimerEvent: {}\n")

    def close(self) -> None:
        """Write the last event and close every file."""
        self._closed.set()
        if self._heart.is_alive():
            self._heart.join()
        if self.folder is not None:
            self._note_event("-", "EventReactorShutdown", "{}")
        self._close(*self._files)

    def announce(
        self,
        jobs: Mapping[str, Mapping[str, Path]],
        *,
        unselected: Iterable[str] = (),
        fresh: Iterable[str] = (),
    ) -> None:
        """Write the packages of the run with the prefixes of their dependencies, and the other packages.

        Packages that are `fresh` start and end at once.
        """
        if self.folder is None:
            return
        stamp = f"[{time.monotonic() - self._begun:f}]"
        lines = [f"{stamp} (-) JobUnselected: {{'identifier': {name!r}}}\n" for name in sorted(unselected)]
        prefixes = {path: repr(str(path)) for needs in jobs.values() for path in needs.values()}
        for name, needs in jobs.items():
            pairs = ", ".join([f"({need!r}, {prefixes[path]})" for need, path in needs.items()])
            dependencies = f"OrderedDict([{pairs}])" if pairs else "OrderedDict()"
            members = f"{{'identifier': {name!r}, 'dependencies': {dependencies}}}"
            lines.append(f"{stamp} ({name}) JobQueued: {members}\n")
        for name in fresh:
            lines.append(f"{stamp} ({name}) JobStarted: {{'identifier': {name!r}}}\n")
            lines.append(f"{stamp} ({name}) JobEnded: {{'identifier': {name!r}, 'rc': 0}}\n")
        self._append("events.log", "".join(lines).encode(errors="surrogateescape"))

    def write(self, event: Event, *, failed_tests: bool = False) -> None:
        """Append an event to its files; `failed_tests` is True if tests of its package failed."""
        if self.folder is None:
            return
        name = event.task
        identifier = {"identifier": name}
        match event:
            case Started():
                self._start(name)
            case StepStarted(_, step):
                self._note_event(name, "JobProgress", {**identifier, "progress": step.label})
                self._note_event(name, "Command", _command(event))
                self._note_command(event)
            case Output(_, lines, stderr):
                if self.coloured:
                    lines = _COLOUR.sub(b"", lines)
                separate = split_lines(lines)
                kind = "StderrLine" if stderr else "StdoutLine"
                start = f"[{time.monotonic() - self._begun:f}] ({name}) {kind}: "
                noted = "".join([f"{start}{{'line': {line!r}}}\n" for line in separate])
                self._append("events.log", noted.encode())
                stamp = self._stamp(name)
                self._append_for(name, "stderr.log" if stderr else "stdout.log", lines)
                self._append_for(name, "stdout_stderr.log", lines)
                self._append_for(name, "streams.log", b"".join([stamp + line for line in separate]))
            case StepFinished(_, _, code):
                self._note_event(name, "CommandEnded", {"returncode": code})
                self._note_command(event)
            case Fresh():
                self._start(name)
                self._end(name, 0)
            case Finished():
                self._end(name, event.code, failed_tests=failed_tests)
            case Aborted():
                self._end(name, "SIGINT")
            case Skipped():
                self._note_event(name, "JobSkipped", identifier)

    def note(self, line: bytes) -> None:
        """Append a line to the file of all events as JSON."""
        if self.folder is not None:
            self._append("events.jsonl", line)

    def _start(self, name: str) -> None:
        if self._heart.ident is None:
            self._heart.start()
        self._started[name] = time.monotonic()
        self._note_event(name, "JobStarted", {"identifier": name})

    def _end(self, name: str, code: int | str, *, failed_tests: bool = False) -> None:
        if failed_tests:
            self._note_event(name, "TestFailure", {"identifier": name})
        self._note_event(name, "JobEnded", {"identifier": name, "rc": code})
        self._close(*(f"{name}/{file}" for file in _OF_PACKAGE))

    def _note_event(self, name: str, kind: str, members: object) -> None:
        """Append an event in colcon's notation; `members` are a dictionary, or its representation."""
        line = f"[{time.monotonic() - self._begun:f}] ({name}) {kind}: {members}\n"
        self._append("events.log", line.encode(errors="surrogateescape"))

    def _note_command(self, event: StepStarted | StepFinished) -> None:
        text, name = _command_line(event), event.task
        self._append_for(name, "command.log", text)
        self._append_for(name, "streams.log", self._stamp(name) + text)
        stamp = f"[{time.monotonic() - self._begun:.3f}s] DEBUG:colcon.colcon_core.event_handler.log_command:"
        self._append("logger_all.log", stamp.encode() + text)

    def _beat(self) -> None:
        while not self._closed.wait(_HEARTBEAT):
            with contextlib.suppress(OSError):  # the next event reports the error
                self._note_event("-", "TimerEvent", "{}")

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
        try:
            stream.write(content)
        except OSError as error:
            error.filename = error.filename or str(stream.name)
            raise

    def _close(self, *names: str) -> None:
        for stream in filter(None, [self._files.pop(name, None) for name in names]):
            stream.close()


def open_log(logs: Path | None, verb: str, argv: list[str], **options: object) -> LogWriter:
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
        parsed = ", ".join(f"{name}={value!r}" for name, value in {"verb_name": verb, **options}.items())
        (folder / "logger_all.log").write_text(
            f"[0.000s] DEBUG:colcon:Command line arguments: {[without_passwords(word) for word in argv]}\n"
            f"[0.000s] DEBUG:colcon:Parsed command line arguments: Namespace({parsed})\n",
            encoding="utf-8",
        )
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


def _command_line(event: StepStarted | StepFinished) -> bytes:
    command = shlex.join(event.step.argv)
    if isinstance(event, StepFinished):
        return f"Invoked command in '{event.step.cwd}' returned '{event.code}': {command}\n".encode()
    words = []
    for name, value in event.environment:
        head, inherited, tail = _parts(name, value)
        quoted = [shlex.quote(text) if text or not inherited else "" for text in (head, tail)]
        words.append(f"{name}={quoted[0]}${{{name}}}{quoted[1]}" if inherited else f"{name}={quoted[0]}")
    return f"Invoking command in '{event.step.cwd}': {' '.join((*words, command))}\n".encode()


def _command(event: StepStarted) -> str:
    """Return the members of colcon's event for a command."""
    step, environment = event.step, []
    for name, value in event.environment:
        head, inherited, tail = _parts(name, value)
        environment.append((name, f"{head}${{{name}}}{tail}" if inherited else value))
    members = f"'env': OrderedDict({environment or ''}), 'shell': False"
    return f"{{'cmd': {list(step.argv)}, 'cwd': {str(step.cwd)!r}, {members}}}"


def _parts(name: str, value: str) -> tuple[str, str, str]:
    """Return the text before the inherited value of a variable, this value ('' without it), and the rest.

    The inherited value is not logged, because it may be a secret.
    """
    inherited = os.environ.get(name)
    return value.partition(inherited) if inherited else (value, "", "")
