"""Prepare the build folder of a package for its next build: keep what is still valid according to its record.

A folder whose products are to be reused in a newly configured folder is renamed until CMake has configured
the new one. If that fails, the next build starts from the renamed folder again.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import time
from dataclasses import replace
from itertools import chain
from operator import ne
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.files import replace_file, text_or_nothing
from forge.base.frozen import Pairs, frozen
from forge.base.layout import (
    BUILD_RESULT,
    DEFERRED_BUILD_FILE,
    SCRATCH_DIR,
    SET_ASIDE_DIR,
    TEST_RESULT,
    TEST_SCRATCH_DIR,
    TRASH_DIR,
    UNITS_FAILED_FILE,
    Layout,
    own_folders,
)
from forge.base.xml import mentions
from forge.build.build_types import build_type_of
from forge.build.copies import discard, is_same_file, status_of
from forge.build.inputs.fingerprints import (
    Changes,
    FileTable,
    compare,
    content_differs,
    contents_of,
    digest_strings,
    tree_stats,
)
from forge.build.inputs.native_graph import (
    EdgeFinder,
    NativeGraph,
    cmake_edge,
    cmake_root,
    read_native_graph,
    unneeded_outputs,
    written_by_backend,
)
from forge.build.records import FolderRecord, begin_record, read_record
from forge.build.reuse import (
    Decision,
    Reuse,
    affected_outputs,
    decide,
    is_known,
    restorable_outputs,
    with_all_written,
)
from forge.build.tasks import Step, StepKind, Task
from forge.engine.accesses import NOT_OBSERVED, Accesses, ObservedCommands
from forge.engine.commands import Folders, commands_of
from forge.engine.world import PACKAGE_FOUND, PROCESSOR, World

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping

    from forge.build.installed_lists import InstalledStates
    from forge.build.observed_writes import ObservedSteps
    from forge.engine.observation import Process
    from forge.workspace.model import Package

_GENERATED = (
    "CMakeCache.txt",
    "build.ninja",
    "CMakeFiles/rules.ninja",
    "Makefile",
    "CMakeFiles/Makefile2",
    "cmake_install.cmake",
)
"""Files that CMake generates for the native tool; it may fail if one is damaged."""
_KEPT = (
    *(BUILD_RESULT, TEST_RESULT, TEST_SCRATCH_DIR, "test_results", "Testing"),
    *("pytest.xml", "unittest.xml", ".coverage", "coverage.html", "coverage.xml", ".pytest_cache"),
)
"""Results of tests and other tools, which are kept when the folder is emptied, like JUnit files."""
_CACHES = ("~/.cache", "~/.ccache")
_CACHE_VARIABLES = ("CCACHE_DIR", "SCCACHE_DIR")
_PACKAGE = re.compile(r"^([^/#:]+)_DIR:PATH=", re.MULTILINE)
"""The packages that CMake searched for, found or not."""
_CLOCK_NANOSECONDS = 2_000_000_000
"""The tolerated difference between the clocks of this machine and of a file server."""


def last_record(build: Path) -> FolderRecord | None:
    before = set_aside_path(build)
    discard(_trash(build))
    if before.is_dir():
        # The build was killed in the configure step, before the outputs were restored.
        discard(build)
        before.rename(build)
    return read_record(build)


def prepare_build_dir(
    build: Path,
    last: FolderRecord | None,
    now: FolderRecord,
    states: InstalledStates,
    table: FileTable,
    *,
    kept: tuple[str, ...] = (),
    can_reuse: bool,
    reconfigure: bool,
    before_removal: Callable[[Collection[str] | None], None] = lambda _: None,
) -> tuple[Reuse, FolderRecord]:
    """Prepare a build folder for the steps that follow; return how much of it is reused, and its record.

    `last` is its last record, `now` contains the current inputs. `kept` are names that remain when the folder
    is emptied. `can_reuse` is False for build types that always start from empty, except for these;
    `reconfigure` runs CMake in any case. `before_removal` is called with the paths that are then removed,
    None for all.
    """
    decision = _NOTHING
    if can_reuse and last:
        decision = _decision(build, last, now, states, table, reconfigure=reconfigure)
    reuse, seen = decision.reuse, last.commands if last else NOT_OBSERVED
    if reuse is Reuse.EVERYTHING:
        # Always remove the first output of a command; otherwise the native tool would not rerun it.
        remaining = (
            each.remaining - {output} for output, each in seen.edges.items() if output in decision.dropped
        )
        # The install step must not see files that the previous one wrote.
        removed = seen.left.union(decision.dropped).difference(*remaining)
        before_removal(removed)
        for path in sorted(removed, reverse=True):
            if not path.startswith(f"{build}/") or not os.path.lexists(path.rstrip("/")):
                continue
            if path.endswith("/"):  # others may lie in it
                with contextlib.suppress(OSError):
                    os.rmdir(path)
            else:
                discard(Path(path))
        _touch_build_ninja(build)
    else:
        before_removal(None)
        _begin_empty(build, reuse, kept)
    (build / SCRATCH_DIR / DEFERRED_BUILD_FILE).unlink(missing_ok=True)
    record = replace(
        now,
        began=time.time_ns(),
        from_empty=reuse is Reuse.NOTHING and not any((build / name).exists() for name in kept),
        dropped=decision.dropped if reuse is Reuse.PRODUCTS else frozenset(),
        commands=seen if reuse is not Reuse.NOTHING or kept else NOT_OBSERVED,
        externals=last.externals if last and reuse is Reuse.EVERYTHING else None,
    )
    begin_record(build, record)
    return reuse, record


def restore_outputs(build: Path) -> None:
    """Move outputs of a folder that was set aside back if they are still in the build graph.

    Regenerated files with identical content get their old times, so that they cause no rebuild.
    """
    if (before := set_aside_path(build)).is_dir():
        _restore(build, before)
    # Ninja would rerun CMake endlessly if a file that CMake read is dated in the future.
    _touch_build_ninja(build)


def _restore(build: Path, before: Path) -> None:
    record, last = read_record(build), read_record(before)
    dropped = record.dropped if record else frozenset[str]()
    graph, then = read_native_graph(build), read_native_graph(before, build)
    seen = last.commands if record and last else NOT_OBSERVED
    texts = {edge.outputs: edge.text for edge in then.edges}
    same = {edge.outputs[0] for edge in graph.edges if texts.get(edge.outputs) == edge.text}
    seen = replace(seen, edges={name: each for name, each in seen.edges.items() if name in same})
    graph = replace(graph, reported=then.reported)
    dropped |= affected_outputs(graph, _generated_changes(build, before, graph, seen), seen)
    # Install rules would find the outputs of targets that are no longer built.
    dropped |= unneeded_outputs(build)
    dropped = with_all_written(graph, dropped, seen)
    for product in restorable_outputs(graph, dropped, seen):
        for path in (product, *(seen.edges[product].written if product in seen.edges else ())):
            if path.startswith(f"{build}/"):
                _move(path, path.replace(str(build), str(before), 1))
    outputs = {path for edge in then.edges for path in edge.outputs}
    for path in then.known() - outputs:
        earlier = path.replace(str(build), str(before), 1)
        if path.startswith(f"{build}/") and is_same_file(path, Path(earlier)) and not os.path.islink(path):
            status = os.stat(earlier)
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    for name in (".ninja_deps", ".ninja_log"):
        _move(str(build / name), str(before / name))
    _trash(build).parent.mkdir(exist_ok=True)
    before.rename(_trash(build))
    discard(_trash(build))


def set_aside_path(build: Path) -> Path:
    """Return the path of a build folder that was set aside so that its outputs can be restored."""
    return build.parent / SET_ASIDE_DIR / build.name


def empty_build_dir(build: Path) -> None:
    """Empty a build folder whose contents belong to no record, except for results of tests and tools."""
    discard(_trash(build))
    discard(set_aside_path(build))
    _begin_empty(build, Reuse.NOTHING, (f"{SCRATCH_DIR}/{DEFERRED_BUILD_FILE}",))


_NOTHING = Decision(Reuse.NOTHING)


def _decision(
    build: Path,
    last: FolderRecord,
    now: FolderRecord,
    states: InstalledStates,
    table: FileTable,
    *,
    reconfigure: bool,
) -> Decision:
    graph, seen = read_native_graph(build), last.commands
    needed_changes = dependency_changes(last.needs, now.needs, states)
    if (
        last.base != now.base
        or last.saved - now.sources.keys()
        or needed_changes is None
        or not graph.tool
        # The clock was set back since the last build, so file times are unreliable.
        or max(last.began, _modified(str(build / ".ninja_log"))) > time.time_ns() + _CLOCK_NANOSECONDS
        # Damaged, or written by a run of CMake outside of forge.
        or (last.complete and last.generated != generated_digest(build))
        or _externals_changed(build, last, graph, table)
        or dict(seen.answers) != contents_of(dict(seen.answers), table)
    ):
        return _NOTHING
    # After an unfinished build, a file written since then may have had different content in between.
    differ = content_differs if last.complete else ne
    edited = {path for path, state in last.products.items() if _state(path) != state}
    written = (each.written for each in (*seen.edges.values(), *filter(None, (seen.configure,))))
    again = seen.left.intersection(chain.from_iterable(written))
    own = compare(last.sources, now.sources, differ) | Changes(modified=last.saved.union(edited, again))
    if last.needs.keys() != now.needs.keys():
        # The search paths contain different prefixes, for which nothing was observed.
        seen = NOT_OBSERVED
    decision = decide(graph, own | needed_changes, seen)
    must_configure = reconfigure or last.shape != now.shape
    if must_configure and decision.reuse is Reuse.EVERYTHING:
        return Decision(Reuse.PRODUCTS if graph.tool == "ninja" else Reuse.NOTHING, decision.dropped)
    return decision


def dependency_changes(
    then: Mapping[str, str], now: Mapping[str, str], states: InstalledStates
) -> Changes | None:
    """Return the changes in the dependencies' installed files, or None if they are unknown."""
    changes = Changes()
    for name in then.keys() | now.keys():
        one, other = then.get(name, ""), now.get(name, "")
        if one != other:
            package_changes = states.changes(name, one, other)
            if package_changes is None:
                return None
            changes |= package_changes
    return changes


def _externals_changed(build: Path, last: FolderRecord, graph: NativeGraph, table: FileTable) -> bool:
    """Return True if a file outside the package that the contents depend on has changed.

    An unfinished build recorded no contents of such files: files that its commands read and that were written
    since it started count as changed.
    """
    if last.externals is not None and contents_of(last.externals, table) != last.externals:
        return True
    if last.complete:
        return last.externals is None
    outside = (path for path in graph.known() - last.sources.keys() if not path.startswith(f"{build}/"))
    return any(written_since(path, last.began) for path in outside)


def written_since(path: str, when: int) -> bool:
    """Return True if a file was written or moved here since `when` (nanoseconds)."""
    try:
        status = os.stat(path)
    except OSError:
        return False
    return max(status.st_mtime_ns, status.st_ctime_ns) >= when


def observed_commands(
    steps: ObservedSteps,
    build: Path,
    source: Path,
    layout: Layout,
    world: World,
    before: ObservedCommands,
    detected: frozenset[str] = frozenset(),
    *,
    workspace: Path | None = None,
    began: int = 0,
) -> ObservedCommands:
    """Return the accesses of a package's steps, merged with those `before`; the steps `began` at this time.

    CMake reused results of a run elsewhere, which `detected` them from its own inputs.
    """
    if not steps.kinds:
        return NOT_OBSERVED
    graph = read_native_graph(build)
    own = (f"{folder}/" for folder in own_folders())
    caches = (*_CACHES, *filter(None, map(world.value, _CACHE_VARIABLES)))
    tracked = (*own, cmake_root(build), *(f"{os.path.expanduser(folder)}/" for folder in caches))
    find_edge = EdgeFinder(graph)

    def outputs_of(process: Process, written: frozenset[str]) -> tuple[str, ...]:
        edge = find_edge(process, written)
        return edge.outputs if edge else ()

    sources = {path for edge in graph.edges if edge.compiles for path in graph.inputs_of(edge)}
    folders = Folders(
        build,
        (source, layout.install, layout.build),
        filter(None, tracked),
        world,
        own_cache(os.environ),
        frozenset(sources),
        source,
        workspace,
        began,
    )
    new_commands = commands_of(steps.observed, steps.kinds, outputs_of, folders)
    if detected and new_commands.configure:
        # A dependency on the processor would be observed here as well.
        others = (PROCESSOR, cmake_root(build))
        inputs = frozenset(each for each in detected if not each.startswith(others))
        paths = frozenset(each for each in inputs if each.startswith("/"))
        configure = new_commands.configure | Accesses(external=paths, asked=inputs - paths)
        new_commands = replace(new_commands, configure=configure)
    outputs = frozenset(edge.outputs[0] for edge in graph.edges)
    # If a part of the log is missing, it is unknown which commands ran.
    commands = (NOT_OBSERVED if steps.observed.blind else before).merged(new_commands, outputs)
    packages = _PACKAGE.findall(text_or_nothing(build / "CMakeCache.txt", errors="surrogateescape"))
    asked = {f"{PACKAGE_FOUND}{name}" for name in packages}.union(*(each.asked for each in commands.all))
    return replace(commands, answers=world.answers(asked))


def saved_during_build(
    build: Path,
    source: Path,
    last: FolderRecord | None,
    begun: FolderRecord,
    externals: Mapping[str, str],
    table: FileTable,
    observed: frozenset[str],
) -> frozenset[str]:
    """Return the inputs that were written since the build began, even if with the same content.

    Files that the steps were `observed` to write, or a build backend, are excluded, and so are files that
    were also written during the `last` build and have the same content: the build writes them.
    """
    then, now = begun.sources, tree_stats(str(source))
    written = observed.union(written_by_backend(build))
    again: frozenset[str] = last.saved if last else frozenset()
    before = (last.externals if last else None) or {}
    changed = {
        path
        for path in then.keys() | now.keys()
        if (path not in then or then[path].stats != now.get(path)) and path not in written
    }
    contents = contents_of(sorted(changed & again & then.keys()), table)
    changed -= {path for path, content in contents.items() if content == then[path].content}
    return frozenset(changed).union(
        path
        for path in externals.keys() - written
        if written_since(path, begun.began)
        and not (path in again and path in before and before[path] == externals[path])
    )


def products_of(build: Path, commands: ObservedCommands) -> Mapping[str, str]:
    """Return kind, size and time of the files that native commands wrote to the build folder."""
    written = frozenset[str]().union(*(each.written for each in commands.edges.values()))
    return {path: _state(path) for path in written if path.startswith(f"{build}/") and path[-1] != "/"}


def _state(path: str) -> str:
    status = status_of(path)
    return f"{status.st_mode:o} {status.st_size} {status.st_mtime_ns}" if status else ""


def generated_digest(build: Path) -> str:
    texts = (text_or_nothing(build / name, errors="surrogateescape") for name in _GENERATED)
    return digest_strings(*texts)


def _begin_empty(build: Path, reuse: Reuse, more: tuple[str, ...]) -> None:
    """Replace a build folder by an empty one, keeping the results of tests and files of other tools."""
    target = set_aside_path(build) if reuse is Reuse.PRODUCTS else _trash(build)
    if build.is_dir() and not build.is_symlink():
        target.parent.mkdir(exist_ok=True)
        build.rename(target)
    # Create the mark first: if this build is killed, the next one recognizes the folder as forge's.
    (build / SCRATCH_DIR).mkdir(parents=True, exist_ok=True)
    # A build that reuses nothing tries again to compile generated sources together.
    names = (*_KEPT, UNITS_FAILED_FILE) if reuse is Reuse.PRODUCTS else _KEPT
    for name in (*names, *more):
        with contextlib.suppress(FileNotFoundError):
            (target / name).rename(build / name)
    for path in _test_results(target):
        (build / path).parent.mkdir(parents=True, exist_ok=True)
        (target / path).rename(build / path)
    if reuse is not Reuse.PRODUCTS:
        discard(target)


def _test_results(build: Path) -> Iterator[str]:
    """Yield the JUnit files in a build folder, as relative paths; test programs choose their locations."""
    for folder, folders, files in os.walk(build):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for path in (f"{folder}/{name}" for name in files if name.endswith(".xml")):
            with contextlib.suppress(OSError):
                if os.path.isfile(path) and mentions(Path(path).read_bytes(), "<testsuite"):
                    yield os.path.relpath(path, build)


def _touch_build_ninja(build: Path) -> None:
    """Make CMake's build files newer than its inputs: forge decides whether CMake runs."""
    edge = cmake_edge(build)
    newest = max(map(_modified, edge.inputs), default=0)
    for path in edge.outputs:
        if 0 < _modified(path) < newest:
            os.utime(path, ns=(newest, newest))


def _modified(path: str) -> int:
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


def _move(path: str, source: str) -> None:
    """Move a file back. A path that ends with '/' is a folder, which is only created."""
    if path.endswith("/"):
        if os.path.isdir(source):
            os.makedirs(path, exist_ok=True)
    elif os.path.lexists(source) and not os.path.lexists(path):
        os.makedirs(os.path.dirname(path), exist_ok=True)
        os.rename(source, path)


def _generated_changes(build: Path, before: Path, graph: NativeGraph, seen: ObservedCommands) -> Changes:
    """Return how CMake's generated files differ from those in the folder that was set aside.

    A missing file counts only if commands read it and did not create it.
    """
    commands = [seen.edges[edge.outputs[0]] for edge in graph.edges if is_known(edge, seen)]
    outputs = {path for edge in graph.edges for path in edge.outputs}.union(
        *(each.written for each in commands)
    )
    read = frozenset[str]().union(*(each.read for each in commands)) - outputs
    paths = {path for path in read if path.startswith(f"{build}/") and not os.path.isdir(path)}
    for folder, folders, files in os.walk(build):
        if folder == str(build):
            folders[:] = [name for name in folders if name not in _KEPT]
        paths.update(os.path.join(folder, name) for name in files)
    added, removed, modified = set(), set(), set()
    for path in paths:
        earlier = path.replace(str(build), str(before), 1)
        match os.path.lexists(earlier), os.path.lexists(path):
            case False, True:
                added.add(path)
            case True, False:
                removed.add(path)
            case True, True if not is_same_file(path, Path(earlier)):
                modified.add(path)
    return Changes(frozenset(added), frozenset(removed), frozenset(modified))


def _trash(build: Path) -> Path:
    return build.parent / TRASH_DIR / build.name


@frozen
class DeferredBuild:
    """The steps of a build except its installation, their files, and variables that differ from the user's.

    Without tests there are no steps. `done` is True after they ran successfully.
    """

    steps: tuple[Step, ...] = ()
    files: tuple[tuple[Path, str], ...] = ()
    variables: Pairs = ()
    done: bool = False


def tests_need_build(package: Package) -> bool:
    return not package.embedded and build_type_of(package).tests_need_build


def defer_build(task: Task, variables: Pairs, *, has_tests: bool) -> None:
    steps = tuple(step for step in task.steps if step.kind is not StepKind.INSTALL) if has_tests else ()
    files = tuple(task.files) if has_tests else ()
    write_deferred(task.build_dir, DeferredBuild(steps, files, variables if has_tests else ()))


def write_deferred(build: Path, deferred: DeferredBuild) -> None:
    value = {
        "steps": [
            (step.kind.name, step.argv, str(step.cwd), step.env, [*map(str, step.record or ())], step.target)
            for step in deferred.steps
        ],
        "files": [[str(path), text] for path, text in deferred.files],
        "variables": deferred.variables,
        "done": deferred.done,
    }
    path = build / SCRATCH_DIR / DEFERRED_BUILD_FILE
    replace_file(path, json.dumps(value).encode(errors="surrogateescape"), mode=0o600)


def read_deferred(build: Path) -> DeferredBuild | None:
    try:
        value = json.loads(text_or_nothing(build / SCRATCH_DIR / DEFERRED_BUILD_FILE))
        return DeferredBuild(
            tuple(
                Step(
                    StepKind[kind],
                    tuple(argv),
                    Path(cwd),
                    tuple((name, text) for name, text in env),
                    (Path(record[0]), record[1]) if record else None,
                    target=target,
                )
                for kind, argv, cwd, env, record, target in value["steps"]
            ),
            tuple((Path(path), text) for path, text in value["files"]),
            tuple((name, text) for name, text in value["variables"]),
            bool(value["done"]),
        )
    except (ValueError, LookupError, TypeError):
        return None
