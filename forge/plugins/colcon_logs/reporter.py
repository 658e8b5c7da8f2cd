"""Write `events.log` and `logger_all.log` as colcon does, for colcon-dashboard and similar tools."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

from forge.base.env_vars import without_passwords
from forge.base.files import naming
from forge.base.text import split_lines
from forge.build.events import Event, Output, StepFinished, StepStarted
from forge.output.logs import command_line, inherited_parts, without_colours
from forge.output.reporters import Reporter, Run

_HEARTBEAT = 1.0
"""Seconds between timer events, which show readers of events.log that a silent build is still running."""
_MOST_NEEDS = 100_000
"""Writing this number of dependencies to the log takes a tenth of a second."""


class EventLog(Reporter):
    def __init__(self, run: Run) -> None:
        assert run.log_folder is not None
        self._run = run
        self._events = (run.log_folder / "events.log").open("ab", buffering=0)
        self._commands = (run.log_folder / "logger_all.log").open("ab", buffering=0)
        self._closed = threading.Event()
        self._heart = threading.Thread(target=self._beat, daemon=True)
        argv = [without_passwords(word) for word in sys.argv]
        parsed = ", ".join(f"{name}={value!r}" for name, value in self._options().items())
        self._note_command(f"[0.000s] DEBUG:colcon:Command line arguments: {argv}\n")
        self._note_command(f"[0.000s] DEBUG:colcon:Parsed command line arguments: Namespace({parsed})\n")
        self._append("[0.000000] (-) TimerEvent: {}\n")
        self._announce()

    def observe(self, event: Mapping[str, Any]) -> tuple[()]:
        name = str(event.get("package"))
        match event["event"]:
            case "Started":
                if self._heart.ident is None:
                    self._heart.start()
                self._note(name, "JobStarted", {"identifier": name})
            case "Fresh":
                self._note(name, "JobStarted", {"identifier": name})
                self._note(name, "JobEnded", {"identifier": name, "rc": 0})
            case "Finished":
                if name not in self._run.plan.tasks:  # it cannot be tested
                    self._queue(name, {})
                    self._note(name, "JobStarted", {"identifier": name})
                if event["test_failures"]:
                    self._note(name, "TestFailure", {"identifier": name})
                self._note(name, "JobEnded", {"identifier": name, "rc": event["code"]})
            case "Aborted":
                self._note(name, "JobEnded", {"identifier": name, "rc": "SIGINT"})
            case "Skipped":
                self._note(name, "JobSkipped", {"identifier": name})
        return ()

    def follow(self, event: Event) -> None:
        name = event.task
        match event:
            case StepStarted(_, step, changes):
                self._note(name, "JobProgress", {"identifier": name, "progress": step.label})
                parts = [(variable, inherited_parts(variable, value)) for variable, value in changes]
                variables = [
                    (variable, f"{head}${{{variable}}}{tail}" if inherited else head)
                    for variable, (head, inherited, tail) in parts
                ]
                environment = f"'env': OrderedDict({variables or ''}), 'shell': False"
                members = f"'cmd': {list(step.argv)}, 'cwd': {str(step.cwd)!r}, {environment}"
                self._note(name, "Command", f"{{{members}}}")
            case StepFinished(_, _, code):
                self._note(name, "CommandEnded", {"returncode": code})
            case Output(_, lines, stderr):
                lines = without_colours(lines) if self._run.coloured else lines
                kind = "StderrLine" if stderr else "StdoutLine"
                start = f"{self._stamp} ({name}) {kind}: "
                self._append("".join([f"{start}{{'line': {line!r}}}\n" for line in split_lines(lines)]))
                return
            case _:
                return
        seconds = time.monotonic() - self._run.clock
        stamp = f"[{seconds:.3f}s] DEBUG:colcon.colcon_core.event_handler.log_command:"
        self._note_command(f"{stamp}{command_line(event)}")

    def close(self) -> None:
        self._closed.set()
        if self._heart.is_alive():
            self._heart.join()
        with self._events, self._commands:
            self._note("-", "EventReactorShutdown", "{}")

    def _options(self) -> dict[str, object]:
        """Return the options by their names in colcon."""
        layout, query = self._run.layout, self._run.query
        return {
            "verb_name": self._run.command,
            "build_base": str(layout.build),
            "install_base": str(layout.install),
            "merge_install": layout.merged,
            "symlink_install": layout.symlink,
            "base_paths": list(query.search.base_paths),
            "packages_select": None if query.select is None else list(query.select),
            "packages_skip": list(query.skip),
        }

    def _announce(self) -> None:
        """Write the packages of the run with the prefixes of their dependencies, and the other packages.

        Indirect dependencies are omitted for packages that are up to date, and for all packages if there are
        too many. colcon lists other packages only when it builds.
        """
        plan, needs = self._run.plan, self._run.needs
        jobs = {name: needs.get(name, ()) for name in plan.fresh}
        direct = sum(len(task.needs) for task in plan.tasks.values()) > _MOST_NEEDS
        for name, task in plan.tasks.items():
            jobs[name] = needs.get(name, ()) if direct else task.needs or needs.get(name, ())
        others = self._run.packages.items() if self._run.command == "build" else ()
        for name in sorted(name for name, each in others if name not in jobs and not each.embedded):
            self._note("-", "JobUnselected", {"identifier": name})
        prefixes = {need: repr(str(self._run.layout.prefix(need))) for all in jobs.values() for need in all}
        for name, wanted in jobs.items():
            self._queue(name, {need: prefixes[need] for need in wanted})

    def _queue(self, name: str, prefixes: Mapping[str, str]) -> None:
        pairs = ", ".join([f"({need!r}, {prefix})" for need, prefix in prefixes.items()])
        dependencies = f"OrderedDict([{pairs}])" if pairs else "OrderedDict()"
        self._note(name, "JobQueued", f"{{'identifier': {name!r}, 'dependencies': {dependencies}}}")

    def _beat(self) -> None:
        while not self._closed.wait(_HEARTBEAT):
            with contextlib.suppress(OSError):  # the next event reports the error
                self._note("-", "TimerEvent", "{}")

    @property
    def _stamp(self) -> str:
        return f"[{time.monotonic() - self._run.clock:f}]"

    def _note(self, name: str, kind: str, members: object) -> None:
        """Append an event in colcon's notation; `members` are a dictionary, or its representation."""
        self._append(f"{self._stamp} ({name}) {kind}: {members}\n")

    def _append(self, text: str) -> None:
        with naming(self._events.name):
            self._events.write(text.encode(errors="surrogateescape"))

    def _note_command(self, text: str) -> None:
        with naming(self._commands.name):
            self._commands.write(text.encode(errors="surrogateescape"))


start = EventLog
