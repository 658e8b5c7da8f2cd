"""Events to the terminal, in colcon's words (workspace spec 6.2), and the closing summary.

Progress goes to stdout and failures to stderr, where colcon's readers expect them.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Protocol

from forge.caching.model import RESTORED
from forge.durations import duration
from forge.errors import Problem, SelectionError, raise_if_any
from forge.excerpts import Excerpt
from forge.frozen import frozen
from forge.interrupts import heard_by_somebody
from forge.model import (
    CONFIGURE,
    TEST_FAILURES,
    Aborted,
    Finished,
    Fresh,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)
from forge.names import did_you_mean
from forge.steps import environment_file, step_line
from forge.unused_variables import UnusedVariables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from forge.diagnosis import FirstError
    from forge.launching.outcome import Outcome
    from forge.model import BuildPlan, Event, Package

HANDLERS = {
    "console_start_end": True,
    "console_stderr": True,
    "summary": True,
    "status": True,
    "console_direct": False,
    "console_cohesion": False,
    "console_package_list": False,
    # Known to colcon's users; forge always, or never, does what they name.
    "log": True,
    "event_log": True,
    "log_command": True,
    "store_result": True,
    "compile_commands": True,
    "desktop_notification": False,
    "parallel_status": False,
    "terminal_title": False,
}
"""The event handlers that --event-handlers knows, and whether they are on by default."""

_PROSE = ("console_start_end", "console_cohesion", "console_direct", "console_package_list", "summary")
"""The event handlers that print for people on stdout."""


def handlers_of(words: Sequence[str]) -> dict[str, bool]:
    """Return which event handlers are on; raises SelectionError for one that nobody knows."""
    unknown = [word for word in words if word.rstrip("+-") not in HANDLERS or word[-1] not in "+-"]
    raise_if_any(
        (
            Problem(
                f"--event-handlers takes names with '+' or '-' at the end, not '{word}'",
                hint=did_you_mean(word.rstrip("+-"), HANDLERS),
            )
            for word in unknown
        ),
        SelectionError,
    )
    return {**HANDLERS, **{word[:-1]: word.endswith("+") for word in words}}


def without_prose(handlers: Mapping[str, bool]) -> dict[str, bool]:
    """Return the event handlers without those that would print between lines for a program."""
    return {**handlers, **dict.fromkeys(_PROSE, False)}


class Screen(Protocol):
    """Where a report is printed; `quiet_starts` where something else shows what begins."""

    quiet_starts: bool

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        """Write bytes as they are: a package's output may be in any encoding."""


class _Plain:
    """The streams themselves."""

    quiet_starts = False

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        stream = sys.stderr if stderr else sys.stdout
        with heard_by_somebody(1):
            sys.stdout.flush()
        with heard_by_somebody(2 if stderr else 1):
            binary = getattr(stream, "buffer", None)
            if binary is None:
                stream.write(content.decode(errors="replace"))
            else:
                binary.write(content)
            stream.flush()


PLAIN: Screen = _Plain()


@frozen
class Tally:
    """What came of the packages, by name and sorted; embedded ones that are fresh go without saying."""

    finished: tuple[str, ...] = ()
    unchanged: tuple[str, ...] = ()
    embedded: tuple[str, ...] = ()
    """Those of forge that finished too."""
    failed: tuple[str, ...] = ()
    aborted: tuple[str, ...] = ()
    stderr: tuple[str, ...] = ()
    """Those that said something there."""
    test_failures: tuple[str, ...] = ()
    restored: tuple[str, ...] = ()
    """Those, embedded ones too, that came from the cache."""
    not_processed: tuple[str, ...] = ()


@frozen
class Fault:
    """Why a package failed, as far as its output tells, what to do, and the line that repeats its step."""

    error: FirstError | None
    repeat: str | None
    hint: str | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines a person would look for."""
        return self.error.lines if self.error else ()


class Report:
    """What a build has to say; owned by the loop of the command."""

    def __init__(
        self,
        plan: BuildPlan,
        packages: Mapping[str, Package],
        handlers: dict[str, bool],
        logs: Path | None,
        shared: frozenset[str] = frozenset(),
    ) -> None:
        """Begin with nothing to say.

        `logs` is the folder that failures point at, `shared` the CMake variables that all packages get.
        """
        self.screen = PLAIN
        self.python = "python3"
        """The interpreter of the workspace, as hints name it."""
        self.outcomes: tuple[Outcome, ...] = ()
        """What a compiler launcher did."""
        self.packages = packages
        self._tasks = plan.tasks
        self._on = handlers
        self.logs = logs
        self._output: dict[str, Excerpt] = {}
        self._unused = UnusedVariables(shared)
        self._configured: set[str] = set()
        self._stderr: set[str] = set()
        self._listed = False
        self._finished: list[str] = []
        self._failed: dict[str, Fault] = {}
        self._aborted: list[str] = []
        self._skipped: list[str] = []
        self._fresh = list(plan.fresh)
        self._failed_tests: set[str] = set()
        self._restored: list[str] = []

    @property
    def failed_tests(self) -> frozenset[str]:
        """The packages whose tests failed, though the programs that ran them did their work."""
        return frozenset(self._failed_tests)

    @property
    def exit_code(self) -> int:
        """0, 1 when a package failed, 2 when all that failed did so over an interface definition."""
        if not self._failed:
            return 0
        errors = [fault.error for fault in self._failed.values()]
        return 2 if all(error and error.interface for error in errors) else 1

    @property
    def tally(self) -> Tally:
        """What came of the packages up to now."""
        return Tally(
            finished=tuple(sorted(name for name in self._finished if not self._embedded(name))),
            unchanged=tuple(sorted(name for name in self._fresh if not self._embedded(name))),
            embedded=tuple(sorted(filter(self._embedded, self._finished))),
            failed=tuple(sorted(self._failed)),
            aborted=tuple(sorted(self._aborted)),
            stderr=tuple(sorted(self._stderr)),
            test_failures=tuple(sorted(self._failed_tests)),
            restored=tuple(sorted(self._restored)),
            not_processed=tuple(sorted(self._skipped)),
        )

    def fault(self, task: str) -> Fault | None:
        """Return why a package failed, or None when it did not."""
        return self._failed.get(task)

    def show(self, event: Event) -> None:
        """Print what `event` means to a person."""
        match event:
            case Started(task):
                self._list()
                self._start(task)
            case Output(task, lines, stderr):
                self._take(task, lines, stderr=stderr)
            case Finished():
                self._finish(event)
            case Aborted(task, seconds):
                self._aborted.append(task)
                self._progress(f"Aborted  <<< {self._label(task)} [{duration(seconds)}]")
            case Skipped(task):
                self._skipped.append(task)
            case Fresh(task):
                self._fresh.append(task)
            case StepFinished(task, step, code):
                if step.label == CONFIGURE:
                    self._configured.add(task)
                # Of a step that repeats another, the last word counts.
                failed = step.meaning(code) == TEST_FAILURES
                (self._failed_tests.add if failed else self._failed_tests.discard)(task)
            case StepStarted():
                pass

    def summarise(self, seconds: float) -> None:
        """Print the closing lines; embedded packages are counted apart."""
        if not self._on["summary"]:
            return
        tally = self.tally
        unchanged = f", {_count(tally.unchanged)} unchanged" if tally.unchanged else ""
        self._out(f"\nSummary: {_count(tally.finished)} finished{unchanged} [{duration(seconds)}]")
        brought = len(tally.embedded)
        if brought:
            self._out(f"  {brought} embedded package{'s' if brought > 1 else ''} of forge finished too")
        if tally.restored:
            self._out(f"  {_count(tally.restored)} came from the cache")
        for outcome in self.outcomes:
            self._out(f"  {outcome.words}")
        for names, words in (
            (tally.failed, "failed"),
            (tally.aborted, "aborted"),
            (tally.stderr, "had stderr output"),
            (tally.test_failures, f"had {TEST_FAILURES}"),
        ):
            if names:
                self._out(f"  {_count(names)} {words}: {' '.join(names)}")
        if tally.not_processed:
            self._out(f"  {_count(tally.not_processed)} not processed")
        if self._unused.names:
            self._out(f"  no package used what --cmake-args defines: {' '.join(self._unused.names)}")

    def _start(self, task: str) -> None:
        if not self.screen.quiet_starts:
            self._progress(f"Starting >>> {self._label(task)}")

    def _list(self) -> None:
        """Print what may be built and in which order, once and where that was asked for."""
        if self._on["console_package_list"] and not self._listed:
            own = [task.package for task in self._tasks.values() if not task.embedded]
            self._out("\n".join(("Topological order", *(f"- {one.name} ({one.type})" for one in own))))
        self._listed = True

    def _progress(self, line: str) -> None:
        if self._on["console_start_end"]:
            self._out(line)

    def _out(self, line: str) -> None:
        self.screen.write(f"{line}\n".encode())

    def _label(self, task: str) -> str:
        return f"{task} (embedded)" if self._embedded(task) else task

    def _embedded(self, name: str) -> bool:
        return self.packages[name].embedded

    def _take(self, task: str, lines: bytes, *, stderr: bool) -> None:
        self._output.setdefault(task, Excerpt()).add(lines, stderr=stderr)
        if self._on["console_direct"] and not self._embedded(task):
            self.screen.write(lines, stderr=stderr)

    def _close(self, task: str) -> None:
        """Show a task's output as one piece where that was asked for."""
        said = self._output.get(task, Excerpt())
        errors = said.errors
        if task in self._configured:
            errors = self._unused.take(errors)
        if errors:
            self._stderr.add(task)
        if self._on["console_cohesion"] and said.everything and not self._on["console_direct"]:
            self.screen.write(f"--- output: {task}\n".encode() + said.everything + b"---\n")
        elif self._on["console_stderr"] and task in self._stderr and not self._on["console_direct"]:
            self.screen.write(f"--- stderr: {task}\n".encode(), stderr=True)
            self.screen.write(errors, stderr=True)
            self.screen.write(b"---\n", stderr=True)

    def _finish(self, event: Finished) -> None:
        task = event.task
        self._close(task)
        if event.code:
            self._fail(event)
            return
        self._finished.append(task)
        self._output.pop(task, None)
        remark = f"\t[ with {TEST_FAILURES} ]" if task in self._failed_tests else ""
        if event.cache == RESTORED:
            self._restored.append(task)
            remark = f"\t[ {RESTORED} ]"
        self._progress(f"Finished <<< {self._label(task)} [{duration(event.seconds)}]{remark}")

    def _fail(self, event: Finished) -> None:
        """Name the package, the step, the first error, the log and the command to repeat."""
        from forge.diagnosis import first_error  # noqa: PLC0415  (only a failure pays for it)

        task = event.task
        text = self._output.pop(task, Excerpt()).everything.decode(errors="replace")
        error = first_error(text.split("\n"), self.packages[task].path.as_posix())
        repeat = step_line(event.step, environment_file(self._tasks[task])) if event.step else None
        hint = self._hint(task, text)
        self._failed[task] = Fault(error, repeat, hint)
        lines = [
            f"Failed   <<< {self._label(task)} [{duration(event.seconds)}, exited with code {event.code}]"
        ]
        if error:
            lines += [f"  first error in step '{event.step.label if event.step else ''}':"]
            lines += [f"    {line}" for line in error.lines]
        if hint:
            lines.append(f"  hint: {hint}")
        if self.logs:
            lines.append(f"  log: {self.logs / task / 'stdout_stderr.log'}")
        if repeat:
            lines.append(f"  repeat: {repeat}")
        self.screen.write(("\n".join(lines) + "\n").encode(), stderr=True)

    def _hint(self, task: str, text: str) -> str | None:
        """Return what to do about a failure whose cause is known."""
        from forge.hints import hint_of  # noqa: PLC0415  (only a failure pays for it)
        from forge.scenes import scene_of  # noqa: PLC0415

        return hint_of(text, scene_of(self.packages[task], self.packages, self.python))


def _count(names: Sequence[str]) -> str:
    return f"{len(names)} package{'' if len(names) == 1 else 's'}"
