"""Record the inputs of a build folder's contents, and prepare the folder for the next build.

The journal records the inputs of successful builds only. A build that failed or was killed leaves objects
made from other inputs. Therefore each build folder has its own record of the inputs that its contents match.
It is written before the first step runs, after everything that does not match was removed.

A folder whose products are to be reused in a newly configured folder is renamed until CMake has configured
the new one. If that fails, the next build starts from the renamed folder again.
"""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import time
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.files import delete_tree, replace_file
from forge.base.frozen import frozen
from forge.base.layout import (
    BUILD_RESULT,
    DEFERRED_BUILD_FILE,
    INSTALLED_CONTENTS_FILE,
    SCRATCH_DIR,
    SET_ASIDE_DIR,
    TEST_RESULT,
    TEST_SCRATCH_DIR,
    TRASH_DIR,
    UNITS_FAILED_FILE,
)
from forge.base.xml import mentions
from forge.build.build_notes import (
    BEGUN,
    ENDED,
    EXTERNALS,
    SOURCES,
    generated_digest,
    read_json,
    written_since,
)
from forge.build.inputs.input_manifest import Changes, compare, read_manifest, write_manifest
from forge.build.inputs.native_graph import cmake_edge, read_native_graph
from forge.build.observed_commands import COMMANDS, COMMANDS_BEFORE
from forge.build.reuse import (
    Decision,
    Reuse,
    affected_outputs,
    decide,
    is_known,
    restorable_outputs,
    with_all_written,
)
from forge.engine.commands import NOT_OBSERVED, read_commands, write_commands

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from forge.base.frozen import Pairs
    from forge.build.inputs.input_manifest import InputManifest
    from forge.build.inputs.native_graph import NativeGraph
    from forge.engine.commands import ObservedCommands

_DROPPED = "dropped.json"
_KEPT = (
    *(BUILD_RESULT, TEST_RESULT, TEST_SCRATCH_DIR, "test_results", "Testing"),
    *("pytest.xml", "unittest.xml", ".coverage", "coverage.html", "coverage.xml", ".pytest_cache"),
)
"""What tests and other tools wrote: kept when the folder is emptied, like JUnit files elsewhere in it."""
_CLOCK_NANOSECONDS = 2_000_000_000
"""The tolerated difference between the clocks of this machine and of a file server."""


@frozen
class BuildDirInputs:
    """The inputs of a package at the start of its build.

    `base` is a digest of inputs that no native build tool tracks: forge, tools, variables. `shape` is a
    digest of inputs that take effect at configure time: options, packages in underlays. `needs` are the
    digests of the dependencies' installed files. `kept` are names that stay when the folder is emptied.
    """

    base: str
    shape: str
    needs: Mapping[str, str]
    sources: InputManifest
    kept: tuple[str, ...] = ()


@frozen
class FileChecks:
    """Functions that check files outside the package.

    `needed_changes(name, then, now)` returns the difference between two states of a dependency's installed
    files, or None if it is unknown; `only_library_code_changed` whether they differ only in the code of
    shared libraries. `contents(paths)` returns content digests, `answers(questions)` answers of a `World`.
    """

    needed_changes: Callable[[str, str, str], Changes | None]
    contents: Callable[[Iterable[str]], Mapping[str, str]]
    only_library_code_changed: Callable[[str, str, str], bool]
    answers: Callable[[Iterable[str]], Pairs] = lambda _: ()


def prepare_build_dir(
    build: Path,
    inputs: BuildDirInputs,
    checks: FileChecks,
    *,
    can_reuse: bool,
    reconfigure: bool,
) -> Reuse:
    """Prepare a build folder for the steps that follow; return how much of it is reused.

    `can_reuse` is False for build types that always start from empty, except for the names that are kept;
    `reconfigure` runs CMake in any case.
    """
    before = set_aside_path(build)
    _discard(_trash(build))
    if before.is_dir():
        # The configure step after which its products should have been restored did not finish.
        _discard(build)
        before.rename(build)
    seen = read_commands(build / SCRATCH_DIR / COMMANDS)
    decision = _decision(build, inputs, checks, seen, reconfigure=reconfigure) if can_reuse else _NOTHING
    if decision.reuse is Reuse.EVERYTHING:
        # The first output of a command goes in any case, or the native tool would not run it.
        remaining = (
            each.remaining - {output} for output, each in seen.edges.items() if output in decision.dropped
        )
        _remove_below(build, decision.dropped.difference(*remaining))
        _touch_build_ninja(build)
    else:
        _begin_empty(build, decision, inputs.kept)
    folder = build / SCRATCH_DIR
    for name in (ENDED, DEFERRED_BUILD_FILE):
        (folder / name).unlink(missing_ok=True)
    # If this build is killed, nothing is known of the commands that it has run.
    if decision.reuse is Reuse.EVERYTHING and (folder / COMMANDS).is_file():
        (folder / COMMANDS).replace(folder / COMMANDS_BEFORE)
    else:
        (folder / COMMANDS).unlink(missing_ok=True)
        is_known = decision.reuse is not Reuse.NOTHING or inputs.kept
        write_commands(folder / COMMANDS_BEFORE, seen if is_known else NOT_OBSERVED)
    write_manifest(folder / SOURCES, inputs.sources)
    note = {
        "began": time.time_ns(),
        "base": inputs.base,
        "shape": inputs.shape,
        "needs": dict(inputs.needs),
        "empty": decision.reuse is Reuse.NOTHING and not any((build / name).exists() for name in inputs.kept),
    }
    replace_file(folder / BEGUN, json.dumps(note, indent=2).encode())
    return decision.reuse


def restore_outputs(build: Path) -> None:
    """Move products of the earlier build that the new build graph still contains back into the build folder.

    Files that CMake generated again with identical content get their old times, so that they cause no
    rebuild. Does nothing unless a folder was set aside.
    """
    before = set_aside_path(build)
    if before.is_dir():
        _restore(build, before)


def _restore(build: Path, before: Path) -> None:
    note_data = read_json(build / SCRATCH_DIR / _DROPPED)
    dropped = frozenset(note_data.get("dropped", ()))
    graph, then = read_native_graph(build), read_native_graph(before, build)
    seen = _of_same_commands(read_commands(build / SCRATCH_DIR / COMMANDS_BEFORE), then, graph)
    graph = replace(graph, reported=then.reported)
    dropped |= affected_outputs(graph, _generated_changes(build, before), seen)
    dropped = with_all_written(graph, dropped | _readers_of_generated(build, before, graph, seen), seen)
    for product in restorable_outputs(graph, dropped, seen):
        for path in (product, *(seen.edges[product].written if product in seen.edges else ())):
            if path.startswith(f"{build}/"):
                _move(path, path.replace(str(build), str(before), 1))
    for path in note_data.get("generated", ()):
        _restore_time(path, path.replace(str(build), str(before), 1))
    for name in (".ninja_deps", ".ninja_log"):
        _move(str(build / name), str(before / name))
    _touch_build_ninja(build)
    _trash(build).parent.mkdir(exist_ok=True)
    before.rename(_trash(build))
    _discard(_trash(build))


def _of_same_commands(seen: ObservedCommands, then: NativeGraph, now: NativeGraph) -> ObservedCommands:
    """Return what is known of the commands that are still the same."""
    texts = {edge.outputs: edge.text for edge in then.edges}
    same = {edge.outputs[0] for edge in now.edges if texts.get(edge.outputs) == edge.text}
    return replace(seen, edges={name: each for name, each in seen.edges.items() if name in same})


def _readers_of_generated(
    build: Path, before: Path, graph: NativeGraph, seen: ObservedCommands
) -> frozenset[str]:
    """Return the outputs of observed commands that read what CMake now generates otherwise, or no longer."""
    commands = [edge for edge in graph.edges if is_known(edge, seen)]
    made = {path for edge in graph.edges for path in edge.outputs}
    made.update(path for edge in commands for path in seen.edges[edge.outputs[0]].written)

    @cache
    def differs(path: str) -> bool:
        if not path.startswith(f"{build}/") or path in made or os.path.isdir(path):
            return False
        earlier = path.replace(str(build), str(before), 1)
        return (os.path.lexists(path) or os.path.lexists(earlier)) and not _same(path, earlier)

    return frozenset(
        output
        for edge in commands
        if any(map(differs, seen.edges[edge.outputs[0]].read))
        for output in edge.outputs
    )


def set_aside_path(build: Path) -> Path:
    """Return the path of a build folder that was renamed so that its products can be restored."""
    return build.parent / SET_ASIDE_DIR / build.name


def empty_build_dir(build: Path) -> None:
    """Empty a build folder whose contents belong to no record, keeping what tests and other tools wrote."""
    _discard(_trash(build))
    _discard(set_aside_path(build))
    _begin_empty(build, _NOTHING, (INSTALLED_CONTENTS_FILE, f"{SCRATCH_DIR}/{DEFERRED_BUILD_FILE}"))


_NOTHING = Decision(Reuse.NOTHING)


def _decision(
    build: Path, inputs: BuildDirInputs, checks: FileChecks, seen: ObservedCommands, *, reconfigure: bool
) -> Decision:
    note, ended = read_json(build / SCRATCH_DIR / BEGUN), read_json(build / SCRATCH_DIR / ENDED)
    then = read_manifest(build / SCRATCH_DIR / SOURCES)
    known = then is not None and isinstance(note.get("began"), int) and note.get("base") == inputs.base
    if not known or then is None or _in_future(build, note["began"]):
        return _NOTHING
    if ended and ended.get("generated") != generated_digest(build):
        # Damaged, or written by a run of CMake that forge does not know.
        return _NOTHING
    own = compare(then, inputs.sources, by_stats=not ended)
    saved = frozenset(ended.get("saved", ()))
    if saved - inputs.sources.keys():
        return _NOTHING
    own |= Changes(modified=saved)
    needed_changes = dependency_changes(note.get("needs"), inputs.needs, checks)
    graph = read_native_graph(build)
    external_paths = (path for path in graph.known() - then.keys() if not path.startswith(f"{build}/"))
    if needed_changes is None or not graph.tool or _externals_changed(build, external_paths, note, checks):
        return _NOTHING
    if seen.answers != checks.answers(question for question, _ in seen.answers):
        return _NOTHING
    if {*note["needs"]} != {*inputs.needs}:
        # Other prefixes are in the search paths: nothing was looked for in them.
        seen = NOT_OBSERVED
    decision = decide(graph, own | needed_changes, seen)
    must_configure = reconfigure or note.get("shape") != inputs.shape
    if must_configure and decision.reuse is Reuse.EVERYTHING:
        return Decision(Reuse.PRODUCTS if graph.tool == "ninja" else Reuse.NOTHING, decision.dropped)
    return decision


def dependency_changes(then: object, now: Mapping[str, str], checks: FileChecks) -> Changes | None:
    """Return the changes in the dependencies' installed files, or None if they are unknown."""
    if not isinstance(then, dict):
        return None
    changes = Changes()
    for name in then.keys() | now.keys():
        one, other = then.get(name, ""), now.get(name, "")
        if one != other:
            found = checks.needed_changes(name, one, other)
            if found is None:
                return None
            changes |= found
    return changes


def _externals_changed(
    build: Path, external_paths: Iterable[str], note: Mapping[str, Any], checks: FileChecks
) -> bool:
    """Return True if a file outside the package that the contents depend on has changed.

    A build that did not finish recorded no contents of such files: of the `external_paths` that its commands
    read, those written since it started count as changed.
    """
    ended = (build / SCRATCH_DIR / ENDED).is_file()
    then = read_manifest(build / SCRATCH_DIR / EXTERNALS)
    if then is not None:
        now = checks.contents(then)
        if any(state.content != now[path] for path, state in then.items()):
            return True
    if ended:
        return then is None
    return any(written_since(path, note["began"]) for path in external_paths)


def _in_future(build: Path, begun: int) -> bool:
    """Return True if the clock was set back since the last build, which makes file times useless."""
    latest = [begun]
    with contextlib.suppress(OSError):
        latest.append((build / ".ninja_log").stat().st_mtime_ns)
    return max(latest) > time.time_ns() + _CLOCK_NANOSECONDS


def _begin_empty(build: Path, decision: Decision, more: tuple[str, ...]) -> None:
    """Replace a build folder by an empty one, keeping the results of tests and files of other tools."""
    target = set_aside_path(build) if decision.reuse is Reuse.PRODUCTS else _trash(build)
    if build.is_dir() and not build.is_symlink():
        target.parent.mkdir(exist_ok=True)
        build.rename(target)
    # The mark comes first: whenever this build is killed, the next one knows whose folder this is.
    (build / SCRATCH_DIR).mkdir(parents=True, exist_ok=True)
    # A build that reuses nothing tries again whether generated sources compile together.
    kept = (*_KEPT, UNITS_FAILED_FILE) if decision.reuse is Reuse.PRODUCTS else _KEPT
    for name in (*kept, *more):
        with contextlib.suppress(FileNotFoundError):
            (target / name).rename(build / name)
    for path in _test_results(target):
        (build / path).parent.mkdir(parents=True, exist_ok=True)
        (target / path).rename(build / path)
    if decision.reuse is Reuse.PRODUCTS:
        graph = read_native_graph(target, build)
        made = {output for edge in graph.edges for output in edge.outputs}
        inputs = (path for path in graph.known() if path.startswith(f"{build}/"))
        note_data = {"dropped": sorted(decision.dropped), "generated": sorted(set(inputs) - made)}
        replace_file(build / SCRATCH_DIR / _DROPPED, json.dumps(note_data).encode())
    else:
        _discard(target)


def _test_results(build: Path) -> Iterator[str]:
    """Yield the JUnit files in a build folder, as relative paths; test programs choose their places."""
    for folder, folders, files in os.walk(build):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for path in (f"{folder}/{name}" for name in files if name.endswith(".xml")):
            if mentions(_content(path), "<testsuite"):
                yield os.path.relpath(path, build)


def _content(path: str) -> bytes:
    try:
        return Path(path).read_bytes() if os.path.isfile(path) else b""
    except OSError:
        return b""


def _touch_build_ninja(build: Path) -> None:
    """Make what CMake generates as new as all files that it read: forge decides whether CMake runs."""
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


def _remove_below(build: Path, paths: Iterable[str]) -> None:
    """Remove files, and folders of which only the names are given; of those that end with '/', empty ones."""
    for path in sorted(paths, reverse=True):
        if path.startswith(f"{build}/") and os.path.lexists(path.rstrip("/")):
            if path.endswith("/"):
                with contextlib.suppress(OSError):
                    os.rmdir(path)
            else:
                _discard_path(path)


def _discard_path(path: str) -> None:
    if os.path.isdir(path) and not os.path.islink(path):
        delete_tree(path)
    else:
        os.unlink(path)


def _move(path: str, source: str) -> None:
    """Move a file back; of a folder that ends with '/', only the folder itself: others may lie in it."""
    if path.endswith("/"):
        if os.path.isdir(source):
            os.makedirs(path, exist_ok=True)
    elif os.path.lexists(source) and not os.path.lexists(path):
        os.makedirs(os.path.dirname(path), exist_ok=True)
        os.rename(source, path)


def _restore_time(path: str, source: str) -> None:
    """Restore the time of a file whose content has not changed."""
    with contextlib.suppress(OSError):
        if filecmp.cmp(path, source, shallow=False):
            status = os.stat(source)
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def _generated_changes(build: Path, before: Path) -> Changes:
    """Return the changes of generated files compared with the folder set aside.

    Removed files are not included: Ninja detects them where compilers have reported them.
    """
    added, modified = set(), set()
    for folder, folders, files in os.walk(build):
        if folder == str(build):
            folders[:] = [name for name in folders if name not in {"CMakeFiles", *_KEPT}]
        for name in files:
            path = os.path.join(folder, name)
            earlier = path.replace(str(build), str(before), 1)
            if not os.path.lexists(earlier):
                added.add(path)
            elif not _same(path, earlier):
                modified.add(path)
    return Changes(added=frozenset(added), modified=frozenset(modified))


def _same(path: str, other: str) -> bool:
    try:
        return filecmp.cmp(path, other, shallow=False)
    except OSError:
        return False


def _trash(build: Path) -> Path:
    return build.parent / TRASH_DIR / build.name


def _discard(folder: Path) -> None:
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.is_dir():
        delete_tree(folder)
