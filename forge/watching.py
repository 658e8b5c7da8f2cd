"""`forge build --watch`: a first build, then another one whenever somebody has saved something.

Each turn looks at everything, as a build by itself does, so nothing stale is ever trusted; what stays warm
is the interpreter with its modules, and the worker of interface packages. The lock of the build folder is
held only while something is built.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from contextlib import ExitStack, nullcontext
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge import package_options
from forge.configuration import FORGE_TOML
from forge.durations import duration
from forge.errors import EnvironmentFault, ForgeError, Problem, SelectionError, said_once
from forge.manner import Manner
from forge.preparation import forge_stamp
from forge.provision import INTERFACE_GROUP
from forge.refusals import refusal
from forge.saves import STEP, Saves, interests
from forge.sourcing import forget_edits
from forge.workspace import begin_turn, packages_there, warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from forge.model import BuildPlan, Package
    from forge.reporting import Report, Tally
    from forge.saves import Interest

    Build = Callable[[argparse.Namespace, Manner], int]

_ONCE = ("force", "cmake_force_configure", "cmake_clean_cache", "cmake_clean_first", "reset_underlays")
"""Options that are done with once the first build was: each later one would do all of it again."""

_LOGS = 10
"""How many log folders of its own a watch keeps."""

_SUSPICIOUS = 5
"""So many builds on each other's heels are those of a package that writes into its own sources."""

_LONGEST_PAUSE = 30.0


def watch(options: argparse.Namespace, build: Build) -> int:
    """Build, then build again after each save until interrupted; returns 0 if that was while waiting.

    What stops the first build ends the watch; what stops a later one the next save may mend.
    """
    _refuse_what_makes_no_sense(options)
    stamp = forge_stamp()
    with ExitStack() as at_the_end:
        turns = _Turns(options, build, at_the_end)
        turns.first()
        try:
            while True:
                saved = turns.wait()
                if forge_stamp() != stamp:
                    hint = "start it again: forge build --watch"
                    raise EnvironmentFault(Problem("forge itself was changed, the watch ends", hint=hint))
                turns.another(saved)
        except KeyboardInterrupt:
            if turns.cut_short:
                raise
            return 0


class _Turns(Manner):
    """The builds of one watch: what they share, and how they are told."""

    def __init__(self, options: argparse.Namespace, build: Build, at_the_end: ExitStack) -> None:
        self._options = options
        self._build = build
        self._at_the_end = at_the_end
        self._saves = Saves(warn)
        self._worker: dict[str, str] | None = None
        self._must_look = True
        self._logs: list[Path] = []
        self._ran = False
        self._on_heels = 0
        self.cut_short = False
        """Whether an interrupt met packages that were being built."""

    def first(self) -> None:
        """Build as ever; then begin to watch, and build what was saved meanwhile."""
        self._build(self._options, self)
        self._look()
        self.quiet = self.checking = True
        self._turn()
        self._tell(f"watching {self._saves.count} folders; Ctrl-C ends it")

    def wait(self) -> frozenset[str]:
        """Return what was saved, once something is; raises KeyboardInterrupt."""
        if self._on_heels >= _SUSPICIOUS:
            time.sleep(min(2.0 ** (self._on_heels - _SUSPICIOUS), _LONGEST_PAUSE))
        begun = time.monotonic()
        saved = self._saves.wait()
        # What is there at once was written while the last build went on, perhaps by itself.
        self.checking = self._saves.second_look or time.monotonic() - begun < 4 * STEP / 1000
        return saved

    def another(self, saved: frozenset[str]) -> None:
        """Build after a save."""
        self._must_look = self._must_look or self._saves.moves_folders(saved)
        self._ran = False
        self._turn()
        self._on_heels = self._on_heels + 1 if self._ran and self.checking else 0
        if self._on_heels == _SUSPICIOUS:
            name = os.path.relpath(min(saved, default="."))
            message = f"'{name}' was changed during {_SUSPICIOUS} builds in a row, perhaps by a build"
            hint = "let packages write into their build folders; forge now waits between builds"
            warn([Problem(message, hint=hint)])

    def worker(self, plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
        """Return what leads to the one worker of all turns."""
        self._warm(task.package for task in plan.tasks.values())
        return nullcontext(self._worker or {})

    def conclude(self, plan: BuildPlan, report: Report, seconds: float) -> None:
        """Tell in one line how a turn went; the first as any build."""
        self._keep_logs(report.logs)
        tally = report.tally
        self.cut_short = bool(tally.aborted)
        self._ran = bool(tally.finished or tally.embedded or tally.failed)
        if not self.quiet:
            super().conclude(plan, report, seconds)
        elif not self._options.json and (self._ran or tally.aborted or not self.checking):
            said = line_of(tuple(plan.tasks), tally, seconds)
            report.screen.write(f"{_clock()} {said}\n".encode())

    def _turn(self) -> None:
        """Build once, with the options as they are now, and tell what stops it."""
        begin_turn()
        forget_edits()
        try:
            self._options = _again(self._options)
            if self._must_look:
                self._look()
            self._build(self._options, self)
        except ForgeError as error:
            self._tell_problems(error.problems)
        except OSError as error:
            problem = refusal(error)
            if problem is None:
                raise
            self._tell_problems((problem,))

    def _look(self) -> None:
        """See which folders are to be watched now."""
        options, root = self._options, Path.cwd()
        layout = shared.layout_of(options, root)
        self._saves.blind = frozenset(map(str, (layout.build, layout.install, layout.logs)))

        def folders() -> Mapping[str, Interest]:
            workspace = packages_there(root, options, os.environ)
            self._warm(workspace.packages.values())
            bases = package_options.base_paths_of(options)
            return interests(workspace, bases, (FORGE_TOML, *options.metas), self._saves.blind)

        self._must_look = True
        self._saves.watch(folders)
        self._must_look = False

    def _warm(self, packages: Iterable[Package]) -> None:
        """Start the worker, once there are packages for it."""
        if self._worker is None and any(_has_use_for_a_worker(package) for package in packages):
            from forge.worker import worker  # noqa: PLC0415  (a workspace may have none of these)

            self._worker = self._at_the_end.enter_context(worker("forge.wheels"))

    def _keep_logs(self, folder: Path | None) -> None:
        """Remove the oldest logs of this watch, which may go on for days."""
        if folder is not None:
            self._logs.append(folder)
        for old in self._logs[:-_LOGS]:
            shutil.rmtree(old, ignore_errors=True)
        del self._logs[:-_LOGS]

    def _tell(self, line: str) -> None:
        if not self._options.json:
            sys.stdout.write(f"{_clock()} {line}\n")
            sys.stdout.flush()

    def _tell_problems(self, problems: Sequence[Problem]) -> None:
        for problem in said_once(problems):
            sys.stderr.write(f"{problem.render()}\n")
        sys.stderr.flush()
        self._tell("nothing was built; forge tries again after the next save")


def _has_use_for_a_worker(package: Package) -> bool:
    return package.build_type in {"ament_python", "python"} or INTERFACE_GROUP in package.manifest.groups


def line_of(order: Sequence[str], tally: Tally, seconds: float) -> str:
    """Return how a turn went, in one line; `order` is that of the plan, in which names are told."""
    parts = [
        f"{_some([name for name in order if name in names])} {words}"
        for names, words in (
            (tally.failed, "failed"),
            (tally.aborted, "stopped"),
            (tally.finished, "rebuilt"),
        )
        if names
    ]
    if tally.embedded and not tally.finished:
        parts.append("packages of forge rebuilt")
    if tally.not_processed:
        parts.append(f"{len(tally.not_processed)} not built")
    return f"{', '.join(parts)} in {duration(seconds)}" if parts else "nothing to do"


def _some(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"


def _clock() -> str:
    return datetime.now().astimezone().strftime("%H:%M:%S")


def _again(options: argparse.Namespace) -> argparse.Namespace:
    """Return the options as the command line and the files say them now, without what is done once."""
    fresh: argparse.Namespace = options.read_again()
    fresh.read_again = options.read_again
    fresh.again = True
    for name in _ONCE:
        setattr(fresh, name, False)
    return fresh


def _refuse_what_makes_no_sense(options: argparse.Namespace) -> None:
    for name, words in (("dry_run", "--dry-run"), ("print_command", "--print-command")):
        if getattr(options, name):
            raise SelectionError(
                Problem(f"'--watch' builds, '{words}' does not", hint="leave one of them out")
            )
