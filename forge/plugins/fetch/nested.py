"""A `forge build` inside a `forge build`, reported in two lines except for failures.

Its log contains everything else. It is a separate process, since it has another folder, environment and
signals.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from forge.base.layout import LAST_COMMAND, SCRATCH_DIR
from forge.base.text import duration


class Report:
    """Collects the events of a nested build; with `status`, a terminal shows its progress.

    When the first package starts, `head` is printed with the number of packages to build.
    """

    def __init__(self, folder: Path, head: Callable[[int], str] | None, *, status: bool) -> None:
        self.folder = folder
        self._head = head
        self.good: set[str] = set()
        """Packages that are up to date or were built."""
        self.failed: list[str] = []
        self.built = 0
        self.text: list[str] = []
        """Lines that are not events: errors that prevent the build, and warnings."""
        self._total = 0
        self._started = False
        self._running: list[str] = []
        dumb = os.environ.get("TERM", "") in {"", "dumb"}
        self._status = status and sys.stderr.isatty() and not dumb

    def take(self, line: str) -> str:
        """Process a line of output, and return the kind of its event, '' for other lines."""
        try:
            event = json.loads(line) if line.startswith('{"event"') else None
        except ValueError:
            event = None
        if event is None:
            self.text.append(line)
            return ""
        kind, name = str(event["event"]), event.get("package", "")
        match kind:
            case "Planned":
                self._total += 1
            case "Fresh":
                self.good.add(name)
            case "Started":
                if self._head and not self._started:
                    print(self._head(self._total), file=sys.stderr, flush=True)
                self._started = True
                self._running.append(name)
            case "Finished" | "Aborted" | "Skipped" if name in self._running:
                self._running.remove(name)
        if kind == "Finished" and event["code"]:
            self.failed.append(name)
            self.erase()
            print(*_failure(event, self.folder), sep="\n", file=sys.stderr, flush=True)
        elif kind == "Finished":
            self.good.add(name)
            self.built += 1
        self._draw()
        return kind

    def erase(self) -> None:
        if self._status:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def _draw(self) -> None:
        if self._status and self._running:
            line = f"[{self.built}/{self._total}] {' '.join(self._running)}"
            width = shutil.get_terminal_size().columns - 1
            print(f"\r\x1b[K{line[:width]}", end="", file=sys.stderr, flush=True)


def run(
    argv: Sequence[str],
    variables: Mapping[str, str],
    report: Report,
    record: Callable[[set[str]], object],
) -> int:
    """Run the command, which prints events, and return its exit code.

    `record` is called with the names of usable packages: once they are known, after each built package, and
    at the end, even after errors. An interrupt is passed on, and raised after the nested build has ended its
    processes.
    """
    code, interrupted, planned = None, False, False
    with subprocess.Popen(
        argv,
        cwd=report.folder,
        env=dict(variables),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
        # The nested build joins the jobserver of a parent make by its descriptors.
        close_fds=False,
        # A terminal sends Ctrl-C only to the outer build, which forwards it: a second signal would kill.
        start_new_session=True,
    ) as process:
        try:
            while code is None:
                try:
                    for line in process.stdout or ():
                        kind = report.take(line)
                        if kind == "Finished" or (kind == "Started" and not planned):
                            planned = True
                            record(report.good)
                    code = process.wait()
                except KeyboardInterrupt:  # noqa: PERF203  (once a run)
                    interrupted = True
                    os.kill(process.pid, signal.SIGINT)
        finally:
            report.erase()
            record(report.good)
    if interrupted:
        raise KeyboardInterrupt
    return code


def _failure(event: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Yield the lines that forge prints for a failed package, with absolute paths."""
    command = folder / "build" / event["package"] / SCRATCH_DIR / LAST_COMMAND
    seconds = duration(event["seconds"])
    yield f"Failed   <<< {event['package']} [{seconds}, exited with code {event['code']}]"
    if event.get("error"):
        yield f"  first error in step '{event['step']}':"
        yield from (f"    {line}" for line in event["error"])
    if event.get("hint"):
        yield f"  hint: {event['hint']}"
    if event.get("log"):
        yield f"  log: {event['log']}/stdout_stderr.log"
    if event.get("repeat"):
        yield f"  repeat: {f'sh {shlex.quote(str(command))}' if command.is_file() else event['repeat']}"
