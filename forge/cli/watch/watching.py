"""`forge build --watch`: build, then rebuild after each change of a source file.

Each build checks all inputs like a normal build, so that no stale state is used. Only the interpreter with
its modules and the worker for interface packages are kept. The build folder is locked only during a build.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import ExitStack, nullcontext
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import ForgeError, HostError, Problem, print_problem, problem_from_oserror, share_hints
from forge.base.files import remove_tree
from forge.base.text import duration
from forge.cli.build_mode import BuildMode
from forge.cli.build_options import for_rebuild
from forge.cli.preparation import forge_stamp
from forge.cli.watch.file_watcher import STEP, FileWatcher, watch_specs
from forge.environment.sourcing import clear_edit_cache
from forge.toolchain.programs import PYTHON_TYPES
from forge.workspace.forge_toml import FORGE_TOML
from forge.workspace.load import find_packages
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from forge.base.colours import Meaning, Palette
    from forge.build.tasks import BuildPlan
    from forge.cli.build_options import BuildOptions
    from forge.cli.watch.file_watcher import WatchSpec
    from forge.output.console import ConsoleReporter, Tally
    from forge.workspace.model import Package

    Build = Callable[[BuildOptions, BuildMode], int]

_LOGS = 10
"""Number of log folders of its own that a watch keeps."""

_SUSPICIOUS = 5
"""After this many consecutive builds, a package probably writes into its own sources."""

_LONGEST_PAUSE = 30.0


def watch(options: BuildOptions, read_again: Callable[[], BuildOptions], build: Build) -> int:
    """Build, then rebuild after each change until interrupted; returns 0 if interrupted while waiting.

    `read_again` reads the options again, because option files may change. Errors that prevent the first
    build end the watch; later ones are reported, and the next change retries.
    """
    stamp = forge_stamp()
    with ExitStack() as at_the_end:
        loop = WatchLoop(options, read_again, build, at_the_end)
        loop.build_first()
        try:
            while True:
                changed = loop.wait()
                if forge_stamp() != stamp:
                    hint = "run 'forge build --watch' again"
                    raise HostError(Problem("forge itself has changed, stopping", hint=hint))
                loop.rebuild(changed)
        except KeyboardInterrupt:
            if loop.cut_short:
                raise
            return 0


class WatchLoop(BuildMode):
    """The builds of one watch, their shared resources and their output."""

    def __init__(
        self,
        options: BuildOptions,
        read_again: Callable[[], BuildOptions],
        build: Build,
        at_the_end: ExitStack,
    ) -> None:
        """Watch nothing yet; `at_the_end` closes the resources shared by the builds."""
        super().__init__()
        self._options = options
        self._read_again = read_again
        self._build = build
        self._at_the_end = at_the_end
        self._watcher = FileWatcher(self.warn)
        self._worker: dict[str, str] | None = None
        self._folders_outdated = True
        self._logs: list[Path] = []
        self._ran = self._failed = False
        self._seen: Mapping[str, str] = {}
        """The states of the files that triggered the last build."""
        self._consecutive_builds = 0
        self.cut_short = False
        """Whether an interrupt aborted packages."""

    def build_first(self) -> None:
        """Start watching, so that no change is missed, and run the first build."""
        self._update_folders()
        self._seen = self._watcher.states(frozenset())
        self._build(self._options, self)
        self.quiet = self.silent_if_up_to_date = True
        self._print(f"watching {self._watcher.count} folders; press Ctrl-C to stop")

    def wait(self) -> frozenset[str]:
        """Wait for changes and return the changed files; raises KeyboardInterrupt."""
        if self._consecutive_builds >= _SUSPICIOUS:
            time.sleep(min(2.0 ** (self._consecutive_builds - _SUSPICIOUS), _LONGEST_PAUSE))
        begun = time.monotonic()
        saved = self._watcher.wait()
        # Changes that are available immediately were made during the last build, perhaps by the build.
        self.silent_if_up_to_date = self._watcher.second_check or time.monotonic() - begun < 4 * STEP / 1000
        return saved

    def rebuild(self, changed: frozenset[str]) -> None:
        self._folders_outdated = self._folders_outdated or self._watcher.moves_folders(changed)
        states = self._watcher.states(changed)
        if self._failed and states and states.items() <= self._seen.items():
            return  # late events of a save that was built already, and would fail again
        self._seen = states
        self._ran = False
        self._build_once()
        self._consecutive_builds = (
            self._consecutive_builds + 1 if self._ran and self.silent_if_up_to_date else 0
        )
        if self._consecutive_builds == _SUSPICIOUS:
            name = os.path.relpath(min(changed, default="."))
            message = f"'{name}' changed during {_SUSPICIOUS} consecutive builds"
            hint = "let packages write only into their build folders; forge now pauses between builds"
            self.warn([Problem(message, hint=hint)])

    def worker(self, plan: BuildPlan, *, has_rosidl: bool) -> AbstractContextManager[dict[str, str]]:
        """Return the variables to connect to the worker shared by all builds."""
        self._warm(task.package for task in plan.tasks.values())
        return nullcontext(self._worker or {})

    def conclude(self, plan: BuildPlan, report: ConsoleReporter, seconds: float) -> None:
        """Print the summary of the first build, and one line for each later build."""
        if report.logs is not None:
            self._logs.append(report.logs)
        for old in self._logs[:-_LOGS]:
            remove_tree(str(old))
        del self._logs[:-_LOGS]
        tally = report.tally
        self.cut_short = bool(tally.aborted)
        self._ran = bool(tally.finished or tally.embedded or tally.failed)
        self._failed = bool(tally.failed)
        if not self.quiet:
            super().conclude(plan, report, seconds)
        elif not self._options.report.json and (self._ran or tally.aborted or not self.silent_if_up_to_date):
            line = line_of(tuple(plan.tasks), tally, seconds, report.screen.palette())
            report.screen.write(f"{_clock()} {line}\n".encode())

    def _build_once(self) -> None:
        """Build once with the current options, and report errors that prevent the build."""
        self.warn.start_next_build()
        clear_edit_cache()
        self._failed = False
        try:
            self._options = for_rebuild(self._read_again())
            if self._folders_outdated:
                self._update_folders()
            self._build(self._options, self)
        except ForgeError as error:
            self._print_problems(error.problems)
        except OSError as error:
            problem = problem_from_oserror(error)
            if problem is None:
                raise
            self._print_problems((problem,))

    def _update_folders(self) -> None:
        options, root = self._options, Path.cwd()
        layout = options.folders.layout(root)
        self._watcher.ignored_folders = frozenset(map(str, (layout.build, layout.install, layout.logs)))

        def folders() -> Mapping[str, WatchSpec]:
            search = options.query.search
            workspace = find_packages(root, search, os.environ)
            self._warm(workspace.packages.values())
            return watch_specs(
                workspace, search.base_paths, (FORGE_TOML, *search.metas), self._watcher.ignored_folders
            )

        self._folders_outdated = True
        self._watcher.watch(folders)
        self._folders_outdated = False

    def _warm(self, packages: Iterable[Package]) -> None:
        if self._worker is None and any(
            package.build_type in PYTHON_TYPES or INTERFACE_GROUP in package.manifest.groups
            for package in packages
        ):
            from forge.cli.worker import INTERFACE_MODULES, WHEEL_MODULES, worker

            started = worker(*INTERFACE_MODULES, *WHEEL_MODULES)
            self._worker = self._at_the_end.enter_context(started)

    def _print(self, line: str) -> None:
        if not self._options.report.json:
            sys.stdout.write(f"{_clock()} {line}\n")
            sys.stdout.flush()

    def _print_problems(self, problems: Sequence[Problem]) -> None:
        self._failed = True
        for problem in share_hints(problems):
            print_problem(problem)
        sys.stderr.flush()
        self._print("nothing was built; waiting for the next change")


def line_of(order: Sequence[str], tally: Tally, seconds: float, palette: Palette) -> str:
    """Return the result of a build as one line; `order` is the order of names in the plan."""
    results: tuple[tuple[tuple[str, ...], str, Meaning], ...] = (
        (tally.failed, "failed", "failure"),
        (tally.aborted, "stopped", "warning"),
        (tally.finished, "rebuilt", "success"),
    )
    parts = [
        f"{_some([name for name in order if name in names], palette)} {palette.paint(meaning, words)}"
        for names, words, meaning in results
        if names
    ]
    if tally.embedded and not tally.finished:
        parts.append("embedded packages rebuilt")
    if tally.not_processed:
        parts.append(f"{len(tally.not_processed)} not built")
    return f"{', '.join(parts)} in {duration(seconds)}" if parts else "nothing to do"


def _some(names: Sequence[str], palette: Palette) -> str:
    first = palette.paint("name", names[0])
    return first if len(names) == 1 else f"{first} and {len(names) - 1} more"


def _clock() -> str:
    return datetime.now().astimezone().strftime("%H:%M:%S")
