"""Errors, warnings and failed tests of a run with their locations in the repository, and its counts."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.colours import colourless
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import IGNORE_MARK
from forge.output.reporters import Reporter, Run

_PLACE = r"(?P<file>[^\s:](?:[^:\n]|:(?!\s))*?):(?P<line>\d+)(?::(?P<column>\d+))?"
"""A location; the name of a file may contain colons."""
_DIAGNOSTIC = re.compile(
    rf"^{_PLACE}: (?:fatal )?"
    r"(?P<severity>error|warning): (?P<message>.*)$"
    r"|^CMake (?P<kind>Error|Warning)(?: \(dev\))? at (?P<list>[^:\n]+):(?P<number>\d+) \(.*\):\n"
    r"(?P<text>(?:[ \t]*\n)*(?:  .*\n)*)",
    re.MULTILINE,
)
"""Messages of GCC, Clang, forge's interface compiler and CMake."""
_ORIGINS = (
    re.compile(
        rf"^{_PLACE}:(?:\s+required from here| note: in instantiation of .* requested here)$", re.MULTILINE
    ),
    re.compile(rf"^(?:In file included|\s+) from {_PLACE}[:,]$", re.MULTILINE),
)
"""Lines that give the origin of an error in a header; Clang prints those about templates after the error."""
_ERROR = re.compile(r"^.*: error: ", re.MULTILINE)
_LOG = "stdout_stderr.log"
_MOST_LINES = 1000
"""The maximum number of lines of a log that are printed; the log folder contains all of them."""
_LONGEST = 500
"""The maximum number of characters of a line in a message; GitHub rejects long annotations and summaries."""


@frozen
class Finding:
    """An error or warning; `file` is relative to the repository, '' if it is elsewhere."""

    severity: str
    title: str
    message: str
    file: str = ""
    line: int = 0
    column: int = 0


def diagnostics(text: str) -> Iterator[Finding]:
    """Yield the errors and warnings in the output of a package without titles; file names are as printed."""
    for match in _DIAGNOSTIC.finditer(colourless(text)):
        if match["kind"]:
            message = " ".join(match["text"].split())
            yield Finding(match["kind"].lower(), "", message, match["list"], int(match["number"]))
        else:
            place = match["file"], int(match["line"]), int(match["column"] or 0)
            yield Finding(match["severity"], "", match["message"], *place)


class CiReporter(Reporter):
    """Collects the events of a run; subclasses write them as a service expects them."""

    checkout = ""
    """The variable with the folder of the repository."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.events: list[Mapping[str, Any]] = []
        self.findings: list[Finding] = []
        self._repository = _repository(run.root, run.variables.get(self.checkout))
        self._warned: set[tuple[str, int, str]] = set()

    def observe(self, event: Mapping[str, Any]) -> Iterator[str]:
        event = {**event, **{key: [*map(_cut, event[key])] for key in ("error", "message") if key in event}}
        if event["event"] in {"Finished", "TestFailure", "Launcher", "Summary"}:
            self.events.append(event)
        findings: list[Finding] = []
        match event["event"]:
            case "Finished" if not event["embedded"] or event["code"]:
                is_bad = event["code"] or event["test_failures"]
                if is_bad and (lines := self._text(event["package"]).splitlines()[-_MOST_LINES:]):
                    yield from self.log(f"log of {event['package']}", lines)
                findings += self._failure(event) if event["code"] else ()
                findings += self._warnings(event["package"]) if self.run.command == "build" else ()
            case "TestFailure":
                findings.append(self._failed_test(event))
        self.findings += findings
        for finding in findings:
            yield from self.announce(finding)

    def fold(self, title: str, block: str) -> str:
        return "".join(f"{line}\n" for line in self.log(title, block.rstrip("\n").split("\n")))

    def log(self, title: str, lines: Iterable[str]) -> Iterable[str]:
        """Return the lines of a log, folded."""
        return ()

    def announce(self, finding: Finding) -> Iterable[str]:
        """Return lines to print for a finding."""
        return ()

    def _failure(self, event: Mapping[str, Any]) -> Iterator[Finding]:
        lines, name, step = event["error"], event["package"], event["step"]
        title = f"{name}: step '{step}' failed" if step else f"{name} failed"
        more = [f"hint: {event['hint']}"] if event["hint"] else []
        text = "".join(f"{line}\n" for line in lines)
        place = next((each for each in diagnostics(text) if each.severity == "error"), None)
        full_message = "\n".join((*lines, *more)) or title
        if place and (file := self._relative(place.file, name)):
            # The location is shown beside the message; CMake's message is in the lines after it.
            rest = () if lines[0].startswith("CMake Error") else lines[1:]
            yield replace(place, title=title, message="\n".join((place.message, *rest, *more)), file=file)
        else:
            yield Finding("error", title, full_message, *(self._origin(name, lines[0]) if place else ()))

    def _origin(self, name: str, error: str) -> tuple[str, int, int] | tuple[()]:
        """Return the nearest location in the repository that includes an outside header with an error."""
        before, _, after = colourless(self._text(name)).partition(error)
        before, after = _ERROR.split(before)[-1], _ERROR.split(after)[0]
        for pattern in _ORIGINS:
            for match in (*reversed([*pattern.finditer(before)]), *pattern.finditer(after)):
                if file := self._relative(match["file"], name):
                    return file, int(match["line"]), int(match["column"] or 0)
        return ()

    def _warnings(self, name: str) -> Iterator[Finding]:
        """Yield the warnings of a package in files of the repository that no package has printed yet."""
        for place in diagnostics(self._text(name)):
            file = self._relative(place.file, name) if place.severity == "warning" else ""
            key = (file, place.line, place.message)
            if file and key not in self._warned:
                self._warned.add(key)
                yield replace(place, title=name, file=file)

    def _failed_test(self, event: Mapping[str, Any]) -> Finding:
        title = f"{event['package']}: {event['test']}"
        file = self._relative(event["file"], event["package"]) if event["file"] else ""
        message = "\n".join(event["message"]) or "the test failed"
        return Finding("error", title, message, file, event["line"] or 0 if file else 0)

    def _text(self, name: str) -> str:
        return text_or_nothing(self.run.log_folder / name / _LOG) if self.run.log_folder else ""

    def _relative(self, file: str, name: str) -> str:
        """Return the path of a file in the repository, '' if it is elsewhere or generated."""
        task = self.run.plan.tasks.get(name)
        folders = (self.run.root / task.package.path, self.run.root, task.build_dir) if task else ()
        for folder in (*folders, self.run.root):
            path = Path(os.path.realpath(folder / file))
            if path.is_file() and path.is_relative_to(self._repository):
                relative = path.relative_to(self._repository)
                generated = any((self._repository / each / IGNORE_MARK).exists() for each in relative.parents)
                return "" if generated else relative.as_posix()
        return ""

    @property
    def summary(self) -> Mapping[str, Any]:
        return next((event for event in self.events if event["event"] == "Summary"), {})


def _cut(line: str) -> str:
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]}..."


def _repository(root: Path, checkout: str | None) -> Path:
    """Return the folder of the repository: that of the service if the workspace is in it, else git's."""
    real = Path(os.path.realpath(root))
    if checkout and real.is_relative_to(os.path.realpath(checkout)):
        return Path(os.path.realpath(checkout))
    return next((folder for folder in (real, *real.parents) if (folder / ".git").exists()), real)
