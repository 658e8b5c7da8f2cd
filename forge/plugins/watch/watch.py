"""`forge build --watch`: build, then rebuild after each change of a source file.

Each folder is watched without its subfolders, because build results, version control and bytecode change all
the time. Events only trigger a build, which checks all inputs like a normal build, so that no stale state is
used. Only the interpreter with its modules and the worker for interface packages are kept. The build folder
is locked only during a build.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import replace
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import ForgeError, HostError, Problem, print_problem, problems_of, share_hints
from forge.base.files import remove_tree
from forge.base.frozen import frozen
from forge.base.text import duration
from forge.build.inputs.fingerprints import file_state, source_folders
from forge.cli.preparation import BuildMode, forge_stamp
from forge.environment.sourcing import clear_edit_cache
from forge.workspace.forge_toml import FORGE_TOML
from forge.workspace.identification import MARKER_FILES, MARKS
from forge.workspace.load import find_packages
from forge.workspace.model import PYTHON_TYPES
from forge.workspace.resolve import INTERFACE_GROUP
from forge.workspace.source_names import folders_to_search, is_source, may_contain_packages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from watchfiles.main import FileChange

    from forge.base.colours import Meaning, Palette
    from forge.build.tasks import BuildPlan
    from forge.cli.build_options import BuildOptions
    from forge.output.console import ConsoleReporter, Tally
    from forge.workspace.model import Package, Workspace

    Build = Callable[[BuildOptions, BuildMode], int]

_LOGS = 10
"""The number of its own log folders that a watch keeps."""

_SUSPICIOUS = 5
"""After this many consecutive builds, a package probably writes into its own sources."""

_LONGEST_PAUSE = 30.0

STEP = 25
"""Milliseconds without events after which a change is complete.

Editors write, rename and remove files in one go.
"""

_LONGEST = 1000
"""Milliseconds after which a build starts despite further events, as during a long git checkout."""

_TIMEOUT = 200
"""Timeout of the library in milliseconds; each timeout empties its queue of events.

Longer means fewer moments in which it could drop an event; shorter means a faster start.
"""

_POLL = 500
"""Milliseconds between two checks when polling."""

_SECOND = 1.5
"""Seconds after which to check again when polling, which compares times in whole seconds."""

_ATTEMPTS = 10


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
    """The builds of a watch session, their shared resources and their output."""

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
        # Changes available immediately were made during the last build, perhaps by the build itself.
        self.silent_if_up_to_date = self._watcher.second_check or time.monotonic() - begun < 4 * STEP / 1000
        return saved

    def rebuild(self, changed: frozenset[str]) -> None:
        self._folders_outdated = self._folders_outdated or self._watcher.moves_folders(changed)
        states = self._watcher.states(changed)
        if self._failed and states and states.items() <= self._seen.items():
            return  # late events of a save that was already built and would fail again
        self._seen = states
        self._ran = self._failed = False
        self.warn.start_next_build()
        clear_edit_cache()
        try:
            self._options = for_rebuild(self._read_again())
            if self._folders_outdated:
                self._update_folders()
            self._build(self._options, self)
        except (ForgeError, OSError) as error:
            self._failed = True
            for problem in share_hints(problems_of(error)):
                print_problem(problem)
            sys.stderr.flush()
            self._print("nothing was built; waiting for the next change")
        self._consecutive_builds = (
            self._consecutive_builds + 1 if self._ran and self.silent_if_up_to_date else 0
        )
        if self._consecutive_builds == _SUSPICIOUS:
            name = os.path.relpath(min(changed, default="."))
            message = f"'{name}' changed during {_SUSPICIOUS} consecutive builds"
            hint = "let packages write only into their build folders; forge now pauses between builds"
            self.warn([Problem(message, hint=hint)])

    def worker(
        self, plan: BuildPlan, _library: Path | None, *, has_rosidl: bool
    ) -> AbstractContextManager[dict[str, str]]:
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
            from forge.base.env_vars import own_cache
            from forge.cli.worker import INTERFACE_MODULES, WHEEL_MODULES, worker
            from forge.engine.observer import compile_library

            own = own_cache(os.environ)
            library = compile_library(own, os.environ) if own else None
            started = worker(*INTERFACE_MODULES, *WHEEL_MODULES, library=library)
            self._worker = self._at_the_end.enter_context(started)

    def _print(self, line: str) -> None:
        if not self._options.report.json:
            sys.stdout.write(f"{_clock()} {line}\n")
            sys.stdout.flush()


def for_rebuild(options: BuildOptions) -> BuildOptions:
    """Return the options for later builds, without those that apply only to the first one."""
    cmake = replace(
        options.cmake, cmake_force_configure=False, cmake_clean_cache=False, cmake_clean_first=False
    )
    return replace(options, cmake=cmake, force=False, reset_underlays=False, is_rebuild=True)


def line_of(order: Sequence[str], tally: Tally, seconds: float, palette: Palette) -> str:
    """Return the result of a build as one line; `order` is the order of names in the plan."""
    results: tuple[tuple[tuple[str, ...], str, Meaning], ...] = (
        (tally.failed, "failed", "failure"),
        (tally.aborted, "stopped", "warning"),
        (tally.finished, "rebuilt", "success"),
    )
    parts = []
    for names, words, meaning in results:
        if names:
            first = palette.paint("name", next(name for name in order if name in names))
            more = f" and {len(names) - 1} more" if names[1:] else ""
            parts.append(f"{first}{more} {palette.paint(meaning, words)}")
    if tally.embedded and not tally.finished:
        parts.append("embedded packages rebuilt")
    if tally.not_processed:
        parts.append(f"{len(tally.not_processed)} not built")
    return f"{', '.join(parts)} in {duration(seconds)}" if parts else "nothing to do"


def _clock() -> str:
    return datetime.now().astimezone().strftime("%H:%M:%S")


@frozen
class WatchSpec:
    """The relevant changes in one folder: files with these names (None: all sources), and subfolders."""

    names: frozenset[str] | None = None
    folders: bool = True

    def joined(self, other: WatchSpec) -> WatchSpec:
        both = self.names is not None and other.names is not None
        return WatchSpec(self.names | other.names if both else None, self.folders or other.folders)  # type: ignore[operator]


def watch_specs(
    workspace: Workspace, base_paths: Iterable[str], files: Iterable[str], results: frozenset[str]
) -> dict[str, WatchSpec]:
    """Return the folders to watch: those of packages, and those in which packages may appear.

    `files` are further input files below the workspace; `results` are excluded. Raises OSError if a folder
    disappears meanwhile.
    """
    specs: dict[str, WatchSpec] = {}
    root = str(workspace.root)

    def add(folder: str, spec: WatchSpec) -> None:
        specs[folder] = specs[folder].joined(spec) if folder in specs else spec

    homes = {os.path.normpath(os.path.join(root, package.path)) for package in workspace.all_packages}
    for home in sorted(homes):
        for folder, targets in source_folders(home).items():
            add(folder, WatchSpec())
            for target in targets:
                add(os.path.dirname(target), WatchSpec(frozenset({os.path.basename(target)}), folders=False))
    for base in base_paths:
        # Outside of packages, new packages are relevant; in ignored folders, only the removal of the mark.
        for folder, entries in folders_to_search(os.path.normpath(os.path.join(root, base))):
            if folder in homes or folder in results:
                entries.clear()
            elif entries.keys().isdisjoint(MARKS):
                add(folder, WatchSpec(MARKER_FILES))
            else:
                add(folder, WatchSpec(frozenset(MARKS), folders=False))
                entries.clear()
    for file in files:
        path = os.path.normpath(os.path.join(root, file))
        if os.path.isdir(os.path.dirname(path)):
            add(os.path.dirname(path), WatchSpec(frozenset({os.path.basename(path)}), folders=False))
    return specs


class FileWatcher:
    """Collects changes in the watched folders, including those between two waits."""

    def __init__(self, warn: Callable[[Iterable[Problem]], object]) -> None:
        """Watch nothing yet; `warn` is called if the system's limits are exceeded."""
        self._warn = warn
        self.ignored_folders: frozenset[str] = frozenset()
        """Folders that forge itself writes to."""
        self._watched: Mapping[str, WatchSpec] = {}
        self._changes: Iterator[set[FileChange]] | None = None
        self.second_check = False
        """Whether the last wait ended without a change; polling may have missed one."""
        self._polling = os.environ.get("WATCHFILES_FORCE_POLLING", "") not in {"", "0", "false"}

    @property
    def count(self) -> int:
        return len(self._watched)

    def watch(self, list_folders: Callable[[], Mapping[str, WatchSpec]]) -> None:
        """Watch the folders that `list_folders` returns; call it again if one disappears.

        Raises OSError if folders keep disappearing.
        """
        for attempt in range(_ATTEMPTS + 1):
            with suppress(FileNotFoundError) if attempt < _ATTEMPTS else nullcontext():
                wanted = {folder: spec for folder, spec in list_folders().items() if _can_be_watched(folder)}
                if self._changes is None or wanted.keys() != self._watched.keys():
                    self._changes = self._begin(sorted(wanted))
                self._watched = wanted
                return
            time.sleep(0.05)

    def wait(self) -> frozenset[str]:
        """Wait for relevant changes and return their paths; empty if the paths are unknown.

        Raises KeyboardInterrupt.
        """
        assert self._changes is not None
        due = time.monotonic() + _SECOND if self._polling and not self.second_check else float("inf")
        self.second_check = False
        while time.monotonic() < due:
            try:
                changes = next(self._changes)
            except RuntimeError:
                # A name is not valid UTF-8, or the queue overflowed: restart, and let a build check all
                # inputs.
                self._changes = self._begin(sorted(self._watched))
                return frozenset()
            changed = frozenset(path for _, path in changes if self._counts(path))
            if changed:
                return changed
        self.second_check = True
        return frozenset()

    def states(self, changed: frozenset[str]) -> dict[str, str]:
        """Return the states of the changed files, or of all files when polling, to compare them later."""
        paths = set(changed)
        if self._polling:
            paths.update(self._watched)
            for folder in self._watched:
                with suppress(OSError), os.scandir(folder) as entries:
                    paths.update(
                        entry.path for entry in entries if not entry.is_dir() and self._counts(entry.path)
                    )
        return {path: file_state(path) for path in paths}

    def moves_folders(self, changed: frozenset[str]) -> bool:
        return not changed or any(
            path in self._watched
            or os.path.basename(path) in MARKER_FILES
            or os.path.islink(path)
            or os.path.isdir(path)
            for path in changed
        )

    def _counts(self, path: str) -> bool:
        if path in self.ignored_folders:
            return False
        if path in self._watched:
            return self._watched[path].folders
        folder, name = os.path.split(path)
        spec = self._watched.get(folder)
        if spec is None or not is_source(name, lambda other: os.path.lexists(f"{folder}/{other}")):
            return spec is not None and name in MARKS
        if spec.names is None or name in spec.names:
            return True
        return spec.folders and os.path.isdir(path) and may_contain_packages(name)

    def _begin(self, folders: list[str]) -> Iterator[set[FileChange]]:
        """Watch these folders natively, or by polling if the system's limits are exceeded."""
        if not self._polling:
            try:
                return _changes_in(folders, polling=False)
            except FileNotFoundError:
                raise
            except (OSError, RuntimeError) as error:
                self._polling = True
                message = f"cannot watch {len(folders)} folders, polling twice a second instead: {error}"
                limits = "fs.inotify.max_user_watches=524288 fs.inotify.max_user_instances=1024"
                self._warn([Problem(message, hint=f"raise the limits: sudo sysctl {limits}")])
        return _changes_in(folders, polling=True)


def _changes_in(folders: list[str], *, polling: bool) -> Iterator[set[FileChange]]:
    """Watch folders from now on, and yield their changes; an empty set after a timeout."""
    from watchfiles import watch

    changes = watch(
        *folders,
        watch_filter=None,
        debounce=_LONGEST,
        step=STEP,
        rust_timeout=_TIMEOUT,
        yield_on_timeout=True,
        force_polling=polling,
        poll_delay_ms=_POLL,
        recursive=False,
    )
    # The generator starts to watch when the first item is requested.
    return chain((next(changes),), changes)


def _can_be_watched(folder: str) -> bool:
    """Return whether a folder is readable and its name is valid UTF-8, as the library requires."""
    try:
        folder.encode()
    except UnicodeEncodeError:
        return False
    return os.access(folder, os.R_OK)
