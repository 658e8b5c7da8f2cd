"""Replay the passes of tests whose inputs are unchanged: `forge test --cached`.

The programs of the tests run under the observer of `forge.engine`. Everything that they accessed is an input
of the pass: files, folders, programs, libraries, names that they looked for in vain. The declared inputs are
added: commands, environment, installed packages, machine. A pass is recorded only if nothing else could have
affected it, and replayed only if all inputs and the result files are unchanged.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from heapq import merge
from pathlib import Path

from forge.base.env_vars import own_cache
from forge.base.errors import Problem, WarningReporter, WorkspaceError
from forge.base.files import read_file, remove_tree, replace_file
from forge.base.frozen import frozen
from forge.base.layout import OWN_CACHE_DIR, PASSED_TESTS_FILE, TEST_FILE_TABLE, TEST_SCRATCH_DIR
from forge.base.xml import Element, as_utf8, parse_xml
from forge.build.inputs.fingerprints import (
    DIR_LISTING_SUFFIX,
    RACY_NANOSECONDS,
    FileTable,
    contents_of,
    digest_strings,
    is_written_since,
)
from forge.build.journal import open_journal
from forge.build.observed_writes import begin_log, read_steps, remove_log
from forge.build.tasks import CACHED, NOT_CACHED, Task
from forge.build.tests.recipes import TestContext
from forge.engine.commands import CACHED_BYTECODE
from forge.engine.observation import KINDS_FOR_TESTS, ObservedStep
from forge.engine.observer import compile_library, observed
from forge.execution.job_pool import without_job_variables
from forge.execution.started import is_running
from forge.testing.outcomes import Outcome

_VERSION = 1

OF_SESSION = frozenset(
    # Shells change them for each folder and command.
    "OLDPWD PWD SHLVL _ "
    # They differ for each login and terminal.
    "SSH_CLIENT SSH_CONNECTION SSH_TTY WINDOWID XDG_SESSION_ID "
    # Tests get a separate, empty folder.
    "TMPDIR".split()
)
"""The environment variables that are not inputs of tests.

All others are: Python and shells copy all of them, so that requests of single ones cannot be observed.
"""

_OF_C_LIBRARY = (
    *("/etc/group", "/etc/hosts", "/etc/ld.so.cache", "/etc/ld.so.preload", "/etc/localtime"),
    *("/etc/nsswitch.conf", "/etc/passwd", "/usr/lib/locale/locale-archive", "/usr/share/zoneinfo/tzdata.zi"),
)
"""Files that the C library reads internally, where it cannot be observed."""
_STATIC = frozenset({"'/sbin/ldconfig' cannot be observed"})
"""Python's ctypes calls this program to print one of the files above."""
_STATELESS = ("/dev/fd/", "/dev/pts/")
_STATELESS_DEVICES = frozenset(
    f"/dev/{name}" for name in "full null ptmx random stderr stdin stdout tty urandom zero".split()
)
_RUNNER_STATE = (".pytest_cache", "Testing/Temporary")
"""State of earlier runs that pytest and CTest keep. forge removes it, so that a pass does not depend on
them."""
_OWN_NAMES = frozenset({".pytest_cache", "Testing", "pytest.xml", "unittest.xml", TEST_SCRATCH_DIR})


@frozen
class TestRecord:
    """The record of the last run of a package's tests.

    `declared` and `inputs` have a digest for each name or path. `outputs` are the files in the build folder
    that the tests wrote, `results` those with their outcomes, `created` files and folders that did not exist
    before. `unfit` is the reason why the run cannot be replayed, '' if it can.
    """

    __test__ = False  # pytest collects classes with this prefix

    declared: Mapping[str, str]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    results: tuple[str, ...]
    created: tuple[str, ...] = ()
    unfit: str = ""


@frozen
class _Run:
    """A running test run: its start time, its folder for temporary files, and its declared inputs."""

    began: int
    temporary: str
    declared: Mapping[str, str]
    libraries: tuple[str, ...]
    """The folders that the dynamic linker searches unobserved."""


def open_cached_tests(
    context: TestContext,
    needs: Mapping[str, Sequence[str]],
    variables: Mapping[str, str],
    warn: WarningReporter,
) -> CachedTests | None:
    """Return the records of passed tests, None if another option requires that all tests run."""
    others = ("coverage", "pytest_with_coverage", "retest_until_fail", "retest_until_pass")
    if contrary := next((name for name in others if getattr(context.options, name)), None):
        warn([Problem(f"all tests run: '--cached' has no effect with '--{contrary.replace('_', '-')}'")])
        return None
    layout = context.layout
    records = open_journal(layout.build).records
    folder = own_cache(variables) or layout.build / OWN_CACHE_DIR
    library = None if layout.target else compile_library(folder, variables)
    if library is None:
        warn([Problem("no pass is recorded: tests cannot be observed here without a C compiler")])
    return CachedTests(
        library,
        FileTable(layout.build / TEST_FILE_TABLE),
        context.results_of,
        lambda name: {need: records[need].installed.digest for need in needs[name] if need in records},
    )


class CachedTests:
    """Observes the tests of one `forge test --cached`, records passes and replays them.

    Workers call it for the packages that they test, and the main thread when these have ended.
    """

    def __init__(
        self,
        library: Path | None,
        table: FileTable,
        results_of: Callable[[str], Path],
        installed: Callable[[str], Mapping[str, str]],
    ) -> None:
        """`installed` returns digests of the installed packages that the tests of a package use."""
        self._library = library
        self._table = table
        self._results_of = results_of
        self._installed = installed
        mask = os.umask(0o22)
        os.umask(mask)
        processors = sorted(os.sched_getaffinity(0))
        limits = [getattr(resource, name) for name in sorted(dir(resource)) if name.startswith("RLIMIT_")]
        limits = [resource.getrlimit(limit) for limit in limits]
        self._machine = repr((*os.uname(), os.getuid(), os.getgroups(), processors, mask, limits))
        self._running: dict[str, _Run] = {}
        self._ended: dict[str, tuple[_Run, ObservedStep]] = {}
        self.remarks: dict[str, str] = {}
        """For each package CACHED, or the reason why its tests ran."""

    # Before the tests

    def find(self, task: Task, environment: Mapping[str, str]) -> TestRecord | None:
        """Return the record of a pass that may be replayed; otherwise note the reason why not."""
        record, declared = self._read(task), self._declared(task, environment)
        if record is None:
            reason = "no run is recorded"
        elif record.unfit:
            reason = f"the last run cannot be replayed: {record.unfit}"
        else:
            reason = next(self._changes(record, declared), "")
        self.remarks[task.name] = f"{NOT_CACHED}{reason}" if reason else CACHED
        return None if reason else record

    def _changes(self, record: TestRecord, declared: Mapping[str, str]) -> Iterator[str]:
        for name in sorted(record.declared.keys() | declared.keys()):
            if record.declared.get(name) != declared.get(name):
                yield f"{name} has changed"
        for contents in (record.inputs, record.outputs):
            # Perform the cheap checks first.
            for path, content in contents.items():
                if content == "missing" and os.path.lexists(path):
                    yield f"'{path}' has appeared"
            now = contents_of(contents, self._table)
            for path, content in contents.items():
                if now[path] != content:
                    shown = path.removesuffix(DIR_LISTING_SUFFIX)
                    yield f"'{shown}' has {'disappeared' if now[path] == 'missing' else 'changed'}"

    def _declared(self, task: Task, environment: Mapping[str, str]) -> dict[str, str]:
        steps = [repr((step.argv, str(step.cwd), step.env, step.condition)) for step in task.steps]
        variables = without_job_variables(environment)
        return {
            "the command of the tests": digest_strings(*steps, str(self._results_of(task.name))),
            "this machine": digest_strings(self._machine),
            "the observer": self._library.name if self._library else "",
            **{f"the package '{name}'": digest for name, digest in self._installed(task.name).items()},
            **{  # a value may be a secret
                f"the environment variable '{name}'": digest_strings(value)
                for name, value in variables.items()
                if name not in OF_SESSION
            },
        }

    def begin(self, task: Task, environment: Mapping[str, str]) -> None:
        """Prepare the observation of the first step: runs must not depend on earlier ones."""
        last = self._read(task)
        _record_file(task).unlink(missing_ok=True)
        for name in _RUNNER_STATE:
            remove_tree(f"{task.build_dir}/{name}")
        created, outputs = (last.created, last.outputs) if last else ((), {})
        own = (f"{task.build_dir}/", f"{self._results_of(task.name)}/")
        # A copied workspace contains the records of the original one.
        for path in filter(lambda one: one.startswith(own), sorted(created, reverse=True)):
            if path in outputs and contents_of([path], self._table)[path] == outputs[path]:
                Path(path).unlink()
            elif path.endswith("/"):
                with contextlib.suppress(OSError):  # other programs create files there
                    os.rmdir(path)
        begin_log(_log_file(task))
        temporary = tempfile.mkdtemp(prefix="forge-")
        libraries = tuple(filter(None, environment.get("LD_LIBRARY_PATH", "").split(os.pathsep)))
        declared = self._declared(task, environment)
        # Wait, so that files written before do not count as changed during the run.
        time.sleep(RACY_NANOSECONDS / 1e9)
        self._running[task.name] = _Run(time.time_ns(), temporary, declared, libraries)

    def variables(self, task: Task, variables: Mapping[str, str]) -> Mapping[str, str]:
        """Return the environment of an observed step, with a separate folder for temporary files."""
        environment = observed(variables, self._library, _log_file(task))
        return {**environment, "TMPDIR": self._running[task.name].temporary}

    # After the tests

    def end(self, task: Task) -> None:
        """Read the observations of the tests, successful or not."""
        run = self._running.pop(task.name, None)
        if run is None:
            return
        steps = read_steps(_log_file(task), KINDS_FOR_TESTS).observed
        if any(is_running(process.pid) for process in steps.processes):
            steps = replace(steps, blind=(*steps.blind, "a program that they have started is still running"))
        remove_log(_log_file(task))
        remove_tree(run.temporary)
        self._ended[task.name] = run, steps

    def keep(self, task: Task, outcomes: Iterable[Outcome], *, passed: bool) -> None:
        """Record tests that have ended; does nothing for those that were replayed."""
        if task.name not in self._ended:
            return
        run, steps = self._ended.pop(task.name)
        observed_run = _ObservedRun(task, run, steps, self._results_of(task.name))
        outcomes = tuple(outcomes)
        results = tuple(sorted(outcome.path for outcome in outcomes))
        inputs = contents_of(sorted({*observed_run.inputs()}), self._table) if passed else {}
        outputs = contents_of(sorted({*observed_run.outputs(), *results}), self._table)
        if not passed:
            unfit = "they failed"
        elif not self._library:
            unfit = "without a C compiler, they are not observed"
        elif all(outcome.counts.tests == outcome.counts.skipped for outcome in outcomes):
            unfit = "no test ran"
        else:
            unfit = next(observed_run.obstacles(inputs), "")
        created = tuple(sorted(observed_run.created()))
        self._write(task, TestRecord(run.declared, inputs, outputs, results, created, unfit))

    def note_replay(self, task: Task, record: TestRecord, outcomes: Iterable[Outcome]) -> None:
        """Mark the JUnit files of a pass that is replayed."""
        marked = [one.path for one in outcomes if not one.by_name and _mark(Path(one.path))]
        if marked:
            self._write(task, replace(record, outputs={**record.outputs, **contents_of(marked, self._table)}))

    def close(self) -> None:
        """Save the digests of inputs."""
        self._table.save()

    def refuse(self, task: Task) -> None:
        """Note that the results of a pass no longer exist."""
        self.remarks[task.name] = f"{NOT_CACHED}the results have changed"

    def _write(self, task: Task, record: TestRecord) -> None:
        data = {"version": _VERSION, **asdict(record)}
        replace_file(_record_file(task), json.dumps(data).encode())

    def _read(self, task: Task) -> TestRecord | None:
        try:
            data = json.loads(_record_file(task).read_bytes())
            if data.pop("version") != _VERSION:
                return None
            return TestRecord(**{**data, **{name: tuple(data[name]) for name in ("results", "created")}})
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
            return None


class _ObservedRun:
    """Accesses of a package's tests in a run that are relevant for the next one."""

    def __init__(self, task: Task, run: _Run, steps: ObservedStep, results: Path) -> None:
        self._task, self._run = task, run
        own = {str(task.build_dir), str(results)}
        own |= {os.path.realpath(folder) for folder in own}
        temporary = {run.temporary, os.path.realpath(run.temporary)}
        self._own = tuple(f"{folder}/" for folder in own)
        self._temporary = tuple(f"{folder}/" for folder in temporary)
        self._state = {f"{folder}{name}" for folder in self._own for name in _RUNNER_STATE}
        built = {str(task.build_dir), os.path.realpath(task.build_dir)}
        self._results = tuple(f"{folder}/" for folder in own - built)
        self._results += tuple(f"{folder}/test_results/" for folder in own)
        self._files = {str(path) for path, _ in task.files}
        self._asked: dict[str, set[str]] = {kind: set() for kind in KINDS_FOR_TESTS}
        self._asked["B"].update(steps.blind)
        self._first: dict[str, str] = {}
        """The first access to each path."""
        self._changed: set[str] = set()
        self._created: set[str] = set()
        """Paths that were missing before the tests wrote them; nothing in them is an input."""
        for _, kind, path in merge(*(process.records for process in steps.processes)):
            kind = kind.upper()  # calls that failed, whether or not the file existed
            if kind in "WDU" and "/__pycache__" not in path and not path.startswith(self._temporary):
                self._changed.add(path)
            if kind in "BIJKMV" or not (self._is_reset(path) or _is_in(self._created, path)):
                self._asked[kind].add(path)
                first = self._first.setdefault(path, kind)
                if kind in "DW" and first in "ND":
                    self._created.add(path)
        programs = {program for process in steps.processes for program in process.programs}
        self._asked["R"] |= {each for each in programs if not _is_in(self._created, each)}
        self._asked["R"] |= {step.argv[0] for step in task.steps}

    def _is_reset(self, path: str) -> bool:
        """Return whether forge resets a path before each run: it is not an input and may change."""
        if f"{path}/".startswith(self._temporary) or path in self._files:
            return True
        if f"{path}/".startswith(self._results) and (path.endswith(".xml") or os.path.isdir(path)):
            return True
        names = (path[len(folder) :].partition("/")[0] for folder in self._own if path.startswith(folder))
        return not _OWN_NAMES.isdisjoint(names)

    def inputs(self) -> Iterator[str]:
        """Yield the paths of all inputs; those of folders end with '/', those of their names with '/.'."""
        yield from _OF_C_LIBRARY
        for path in set[str]().union(*(self._asked[kind] for kind in "RTNY")):
            # Python's bytecode counts as its source.
            path = CACHED_BYTECODE.sub(r"\1/\2.py", path)
            is_created = path in self._created and os.path.lexists(path)
            if not path.endswith("/__pycache__") and not is_created and self._first.get(path) != "W":
                yield f"{path}/" if os.path.isdir(path) and not os.path.islink(path) else path
        for path in (*self._asked["L"], *self._run.libraries):
            if not path.endswith("/__pycache__"):
                yield f"{path}{DIR_LISTING_SUFFIX}"

    def outputs(self) -> Iterator[str]:
        """Yield the files in the build folder that the tests wrote and that still exist."""
        for path in self._changed:
            is_file = os.path.isfile(path) or os.path.islink(path)
            if is_file and path.startswith(self._own) and not _is_in(self._state, path):
                yield path

    def created(self) -> Iterator[str]:
        """Yield the files and folders in the build folder that are to be removed before the next run."""
        for path in self._changed:
            is_own = path.startswith(self._own) and not self._is_reset(path)
            if is_own and os.path.lexists(path) and _is_in(self._created, path):
                yield f"{path}/" if os.path.isdir(path) and not os.path.islink(path) else path

    def obstacles(self, inputs: Mapping[str, str]) -> Iterator[str]:
        """Yield reasons why a rerun could have a different result although no input has changed."""
        yield from (text for text in self._asked["B"] if text not in _STATIC)
        if self._asked["J"]:
            yield "they keep files for the next run"
        allowed = (*_STATELESS, *self._own, *self._temporary)
        for channel in sorted(self._asked["K"]):
            if channel not in _STATELESS_DEVICES and not channel.startswith(allowed):
                yield f"they use {channel}"
        for path in sorted(self._changed):
            if not path.startswith(self._own):
                yield f"they change '{path}', outside of the build folder"
            elif stat.S_IFMT(_mode(path)) in {stat.S_IFIFO, stat.S_IFSOCK}:
                yield f"they leave '{path}', which is not a file"
            elif not self._is_reset(path) and not _is_in(self._created, path):
                if self._first[path] != "W":
                    yield f"they change '{path}', which existed before"
                elif os.path.dirname(path) in self._asked["L"] and os.path.lexists(path):
                    yield f"they write '{path}' and list its folder"
        for path, content in inputs.items():
            plain = path.removesuffix(DIR_LISTING_SUFFIX).rstrip("/")
            is_listing = path.endswith(DIR_LISTING_SUFFIX)
            if content == "missing":
                if self._first.get(plain, "N") != "N":
                    yield f"'{plain}' was removed meanwhile"
            elif self._first.get(plain) == "N":
                yield f"'{plain}' appeared meanwhile"
            elif not (path.endswith("/") or (is_listing and f"{plain}/".startswith(self._own))):
                with contextlib.suppress(OSError):
                    status = os.stat(path)
                    if any(is_written_since(self._run.began, each) for each in (status, os.lstat(path))):
                        yield f"'{plain}' was changed meanwhile"
                    if plain in self._asked["R"] and not is_listing and not stat.S_ISREG(status.st_mode):
                        yield f"they read '{plain}', which is not a regular file"


def _is_in(paths: set[str], path: str) -> bool:
    """Return True if a path, or a folder that contains it, is one of `paths`."""
    while len(path) > 1:
        if path in paths:
            return True
        path = os.path.dirname(path)
    return False


def _mode(path: str) -> int:
    try:
        return os.lstat(path).st_mode
    except OSError:
        return 0


def _record_file(task: Task) -> Path:
    return task.build_dir / task.scratch_dir / PASSED_TESTS_FILE


def _log_file(task: Task) -> Path:
    return task.build_dir / task.scratch_dir / "observed" / "log"


def _mark(path: Path) -> bool:
    """Mark a JUnit file as cached, unless it is; return whether it was written."""
    try:
        content = read_file(path)
        root = parse_xml(content, path) if as_utf8(content, path) == content else None
    except (OSError, WorkspaceError):
        return False
    places: list[tuple[int, bool]] = []
    suites: list[Element] = [root] if root else []
    for suite in suites:
        suites += suite.all("testsuite")
        if suite.tag == "testsuite":
            properties = next(suite.all("properties"), None)
            names = properties.all("property") if properties else ()
            place = (properties or suite).inner_start
            if place is not None and all(each.attributes.get("name") != CACHED for each in names):
                places.append((place, properties is None))
    mark = f'<property name="{CACHED}" value="true"/>'.encode()
    for place, is_whole in sorted(places, reverse=True):
        text = b"<properties>%s</properties>" % mark if is_whole else mark
        content = content[:place] + text + content[place:]
    if places:
        replace_file(path, content)
    return bool(places)
