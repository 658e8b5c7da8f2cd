"""Prints events and the summary in colcon's format.

As in colcon, progress goes to stdout and failures go to stderr.
"""

from __future__ import annotations

import shlex
import sys
from collections import defaultdict
from typing import TYPE_CHECKING, Any

from forge.base.colours import Palette, colourless, palette_of
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import frozen
from forge.base.layout import LAST_COMMAND
from forge.base.signals import ignore_closed_output
from forge.base.text import Excerpt, counted, duration
from forge.build.events import Aborted, Finished, Fresh, Output, Skipped, Started, StepFinished, StepStarted
from forge.build.tasks import CACHED, NOT_CACHED, TEST_FAILURES, StepKind, environment_file, step_line
from forge.cache.model import RESTORED
from forge.toolchain.cmake_variables import UnusedVariables
from forge.workspace.model import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    from forge.base.colours import Meaning
    from forge.build.events import Event
    from forge.build.tasks import BuildPlan
    from forge.testing.outcomes import Counts
    from forge.toolchain.compiler_launchers import LauncherSummary
    from forge.workspace.model import Package


class Screen:
    """The output of a report: stdout and stderr. With `quiet_starts`, another view shows running packages."""

    quiet_starts = False

    def palette(self, *, stderr: bool = False) -> Palette:
        return palette_of(sys.stderr if stderr else sys.stdout)

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        """Write bytes unchanged, because output of packages may have any encoding."""
        stream = sys.stderr if stderr else sys.stdout
        with ignore_closed_output(1):
            sys.stdout.flush()
        with ignore_closed_output(2 if stderr else 1):
            binary = getattr(stream, "buffer", None)
            if binary is None:
                stream.write(content.decode(errors="replace"))
            else:
                binary.write(content)
            stream.flush()


PLAIN = Screen()


_VISIBLE_LINES = 20
"""An error at most this number of lines above the report of a failure is still visible."""


@frozen
class Tally:
    """The results of packages, as sorted names; embedded packages that are up to date are left out.

    `embedded` are embedded packages that finished, `cached` those whose passed tests were replayed.
    """

    finished: tuple[str, ...] = ()
    unchanged: tuple[str, ...] = ()
    embedded: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    aborted: tuple[str, ...] = ()
    stderr: tuple[str, ...] = ()
    test_failures: tuple[str, ...] = ()
    restored: tuple[str, ...] = ()
    cached: tuple[str, ...] = ()
    not_processed: tuple[str, ...] = ()
    not_tested: tuple[str, ...] = ()


@frozen
class PackageFailure:
    """The exit code and first error of a failed package, a command that repeats its step, and a hint."""

    code: int
    error: Any
    """The `FirstError` of the plugin that finds it, None if it is unknown."""
    repeat: str | None
    hint: str | None = None


class ConsoleReporter:
    """Prints events and collects results; owned by the main loop."""

    def __init__(
        self,
        plan: BuildPlan,
        packages: Mapping[str, Package],
        handlers: dict[str, bool],
        logs: Path | None,
        shared: frozenset[str] = frozenset(),
    ) -> None:
        """`logs` is the log folder named in failures, `shared` the CMake variables passed to all packages."""
        self.screen = PLAIN
        self.surroundings: Mapping[str, Any] = {}
        """Context for hints about failed packages: arguments of Failure."""
        self.collapsed: frozenset[str] = frozenset()
        """Packages that get no separate lines unless they fail; the summary counts them."""
        self.launcher_summaries: tuple[LauncherSummary, ...] = ()
        self.test_counts: Counts | None = None
        """The numbers of tests, if the packages were tested."""
        self.no_test_ran = False
        """Whether the packages were tested, but had no tests or skipped all of them."""
        self.flaky_tests = 0
        self.not_tested: tuple[str, ...] = ()
        """Packages that should have been tested, but could not be."""
        self.displayed: Callable[[Path], str] = str
        """Returns how to display a path, such as relative to the folder in which the command was typed."""
        self.folds: list[Callable[[str, str], str]] = []
        """Functions of reporters that return a titled block of output as it is to be displayed."""
        self.folds_on_stderr = False
        self.guards: list[Callable[[str], str]] = []
        """Functions of reporters that return text with output of packages as it is to be displayed."""
        self.packages = packages
        self._tasks = plan.tasks
        self._on = handlers
        self.logs = logs
        self._output: dict[str, Excerpt] = {}
        self._warnings: Any = None
        """The plugin that finds warnings, None before the first output."""
        self._unused = UnusedVariables(shared)
        self._configured: set[str] = set()
        self._listed = False
        self.failures: dict[str, PackageFailure] = {}
        """The failed packages."""
        # The names of the tally, by field.
        self._names: defaultdict[str, set[str]] = defaultdict(set)
        self._names["unchanged"].update(name for name in plan.fresh if not self._embedded(name))
        self.failed_tests = self._names["test_failures"]
        """The packages with failed tests, although their test programs ran successfully."""

    @property
    def exit_code(self) -> int:
        """0, 1 if a package failed, 2 if all failures are errors in interface definitions."""
        if not self.failures:
            return 0
        errors = [failure.error for failure in self.failures.values()]
        return 2 if all(error and error.interface for error in errors) else 1

    @property
    def tally(self) -> Tally:
        names = {field: tuple(sorted(names)) for field, names in self._names.items()}
        return Tally(**names, failed=tuple(sorted(self.failures)), not_tested=self.not_tested)

    def show(self, event: Event) -> None:
        match event:
            case Started(task):
                if self._on["console_package_list"] and not self._listed:
                    own = [task.package for task in self._tasks.values() if not task.embedded]
                    self._out("\n".join(("Topological order", *(f"- {p.name} ({p.type})" for p in own))))
                self._listed = True
                if not self.screen.quiet_starts and task not in self.collapsed:
                    self._progress(f"Starting >>> {self._label(task)}")
            case Output(task, lines, stderr):
                self._output.setdefault(task, Excerpt()).add(lines, stderr=stderr)
                if self._warnings is None and (plugin := own_plugin(OPTIONS, "warnings")):
                    self._warnings = plugin.PackageWarnings()
                if self._warnings and not stderr and not self._embedded(task):
                    self._warnings.of_compilers[task].add(lines)
                if self._on["console_direct"] and not self._embedded(task):
                    self.quote(lines.decode(errors="surrogateescape"), stderr=stderr)
            case Finished():
                self._finish(event)
            case Aborted(task, seconds):
                self._names["aborted"].add(task)
                verb = self.screen.palette().paint("warning", "Aborted ")
                self._progress(f"{verb} <<< {self._label(task)} [{duration(seconds)}]")
            case Skipped(task):
                self._names["not_processed"].add(task)
            case Fresh(task):
                if not self._embedded(task):
                    self._names["unchanged"].add(task)
            case StepFinished():
                package = event.task
                if event.step.kind is StepKind.CONFIGURE:
                    self._configured.add(package)
                if self._warnings and package in self._warnings.of_compilers:
                    self._warnings.of_compilers[package].end_step()
                # Only the last result of a repeated step counts.
                failed = event.step.meaning(event.code) == TEST_FAILURES
                (self.failed_tests.add if failed else self.failed_tests.discard)(package)
            case StepStarted():
                pass

    def show_report(self, lines: Iterable[str]) -> None:
        """Print the lines of a reporter, as part of the summary."""
        if self._on["summary"]:
            self._out("\n" + "\n".join(lines))

    def summarise(self, seconds: float) -> None:
        """Print the summary; embedded packages are counted separately."""
        if not self._on["summary"]:
            return
        tally = self.tally
        palette = self.screen.palette()
        unchanged = f", {counted(len(tally.unchanged), 'package')} unchanged" if tally.unchanged else ""
        bad = tally.failed or tally.aborted or tally.test_failures or tally.not_tested
        head = palette.paint("failure" if bad else "success", "Summary:")
        finished = f"{counted(len(tally.finished), 'package')} finished"
        self._out(f"\n{head} {finished}{unchanged} [{duration(seconds)}]")
        if self.test_counts is not None:
            none = f"\n  {palette.paint('warning', 'no test ran')}" if self.no_test_ran else ""
            flaky = f"  ({self.flaky_tests} flaky)" if self.flaky_tests else ""
            self._out(f"  {self.test_counts}{flaky}{none}")
        for names, noun, verb in (
            (tally.embedded, "embedded package", "finished"),
            (tally.restored, "package", "came from the cache"),
            (tally.cached, "package", "cached"),
        ):
            if names:
                self._out(f"  {counted(len(names), noun)} {verb}")
        for outcome in self.launcher_summaries:
            self._out(f"  {outcome.words}")
        repeated = self._warnings.repeated.packages if self._warnings else {}
        listed: tuple[tuple[tuple[str, ...], str, Meaning], ...] = (
            (tally.failed, "failed", "failure"),
            (tally.aborted, "aborted", "warning"),
            (tally.stderr, "had stderr output", "warning"),
            *((names, f"repeated warnings of {one}", "warning") for one, names in repeated.items()),
            (tally.test_failures, f"had {TEST_FAILURES}", "failure"),
            (tally.not_tested, "not tested", "failure"),
        )
        for names, words, meaning in listed:
            if names:
                shown = palette.paint("name", " ".join(names))
                self._out(f"  {counted(len(names), 'package')} {palette.paint(meaning, words)}: {shown}")
        if tally.not_processed:
            self._out(f"  {counted(len(tally.not_processed), 'package')} not processed")
        own = {p.name for p in self.packages.values() if p.build_type in CMAKE_TYPES and not p.embedded}
        # Packages that were not configured in this run may use them.
        if own <= self._configured and (unused := self._unused.names):
            self._out(f"  CMake variables not used by any package: {' '.join(unused)}")
            hint = palette.paint("hint", "hint:")
            advice = own_plugin(OPTIONS, "advice-cmake-arguments")
            for variable in unused if advice else ():
                if advice and (near := advice.probable_variable(variable)):
                    self._out(f"  {hint} did you mean '{near}' instead of '{variable}'?")

    def _progress(self, line: str) -> None:
        if self._on["console_start_end"]:
            self._out(line)

    def _out(self, line: str) -> None:
        self.screen.write(f"{line}\n".encode())

    def _label(self, task: str, *, stderr: bool = False) -> str:
        palette = self.screen.palette(stderr=stderr)
        name = palette.paint("name", task)
        return f"{name} {palette.paint('detail', '(embedded)')}" if self._embedded(task) else name

    def _embedded(self, name: str) -> bool:
        return self.packages[name].embedded

    def quote(self, text: str, *, stderr: bool = False) -> None:
        """Print text that contains output of packages."""
        guarded = text
        for guard in self.guards:
            guarded = guard(guarded)
        stderr = stderr if guarded == text else self.folds_on_stderr
        self.screen.write(guarded.encode(errors="surrogateescape"), stderr=stderr)

    def _close(self, task: str, *, failed: bool) -> str:
        """Print the output of a package as a block, depending on the event handlers; return its errors."""
        output = self._output.get(task, Excerpt())
        errors = output.errors
        if task in self._configured:
            errors = self._unused.take(errors)
        if self._warnings and task in self._warnings.of_compilers and not failed:
            errors += self._warnings.of_compilers.pop(task).text
        if errors:
            self._names["stderr"].add(task)
        if self._on["console_cohesion"] and output.everything and not self._on["console_direct"]:
            everything = output.everything.decode(errors="surrogateescape")
            self.quote(f"--- output: {task}\n{everything}---\n")
        elif self._on["console_stderr"] and task in self._names["stderr"] and not self._on["console_direct"]:
            if self._warnings and self._on["summary"] and not failed:  # which names the omitted packages
                errors = self._warnings.repeated.take(task, errors)
            text = errors.decode(errors="surrogateescape")
            if failed and (plugin := own_plugin(OPTIONS, "first-error")):
                text = plugin.with_paths(text, self.packages[task].path.as_posix())
            if text.strip():
                block = f"--- stderr: {task}\n{text}---\n"
                folded = block
                for fold in self.folds if not failed else ():
                    folded = fold(f"stderr: {task}", folded)
                if folded == block:
                    self.quote(block, stderr=True)
                else:  # a service reads its commands from stdout
                    self.screen.write(folded.encode(errors="surrogateescape"), stderr=self.folds_on_stderr)
                return text
        return ""

    def _finish(self, event: Finished) -> None:
        task = event.task
        shown = self._close(task, failed=bool(event.code))
        if event.code:
            self._fail(event, shown)
            return
        self._names["embedded" if self._embedded(task) else "finished"].add(task)
        self._output.pop(task, None)
        palette = self.screen.palette()
        remark = ""
        if task in self.failed_tests:
            remark = f"\t[ with {palette.paint('failure', TEST_FAILURES)} ]"
        if event.cache == RESTORED:
            self._names["restored"].add(task)
            remark = f"\t[ {RESTORED} ]"
        elif event.cache == CACHED:
            self._names["cached"].add(task)
        if event.cache == CACHED or (event.cache.startswith(NOT_CACHED) and not remark):
            remark = f"\t[ {event.cache} ]"
        if task not in self.collapsed:
            verb = palette.paint("success", "Finished")
            self._progress(f"{verb} <<< {self._label(task)} [{duration(event.seconds)}]{remark}")

    def _fail(self, event: Finished, shown: str) -> None:
        """Print the package, step, first error unless it was just `shown`, log and a command to repeat it."""
        from forge.output.hints import Failure, hint_of

        task, package = event.task, self.packages[event.task]
        text = self._output.pop(task, Excerpt()).everything.decode(errors="replace")
        plugin = own_plugin(OPTIONS, "first-error")
        error = plugin and plugin.first_error(text.split("\n"), package.path.as_posix())
        repeat = step_line(event.step, environment_file(self._tasks[task])) if event.step else None
        hint = hint_of(Failure(package, self.packages, colourless(text), **self.surroundings))
        self.failures[task] = PackageFailure(event.code, error, repeat, hint or None)
        palette = self.screen.palette(stderr=True)
        seconds = f"{duration(event.seconds)}, exited with code {event.code}"
        lines = [f"{palette.paint('failure', 'Failed  ')} <<< {self._label(task, stderr=True)} [{seconds}]"]
        step = event.step.label if event.step else ""
        if error and error.lines[0] in colourless(shown).splitlines()[-_VISIBLE_LINES:]:
            lines.append(f"  first error in step '{step}': see above")
        elif error:
            lines += [f"  first error in step '{step}':", *(f"    {line}" for line in error.lines)]
        if hint:
            lines.append(f"  {palette.paint('hint', 'hint:')} {hint}")
        if self.logs:
            lines.append(f"  log: {self.displayed(self.logs / task / 'stdout_stderr.log')}")
        if repeat:
            # A file contains the failed step, so the command is shorter.
            file = self._tasks[task].build_dir / self._tasks[task].scratch_dir / LAST_COMMAND
            short = f"sh {shlex.quote(self.displayed(file))}" if file.is_file() else repeat
            lines.append(f"  repeat: {short}")
        self.quote("\n".join(lines) + "\n", stderr=True)
