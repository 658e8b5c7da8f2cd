"""Build folders: what their contents were made from, and how they are prepared for the next build.

The journal says from what a package was made when its build ended well. A build that failed or was killed
leaves objects that were made from something else. So each folder has records of its own: which inputs its
contents agree with. They are written once all that does not agree is gone, before the first step runs.

A folder from which products are to be brought back stands aside, under another name, until CMake has
configured an empty one. If that fails, the next build begins with it again.
"""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import shutil
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from forge.build.build_notes import BEGUN, ENDED, EXTERNALS, RECORDS, read_json, written_since
from forge.build.input_manifest import Changes, compare, read_manifest, write_manifest
from forge.build.native_graph import read_by_cmake, read_native_graph
from forge.build.reuse import Decision, Reuse, brought_back, decide, read_or_nothing, undeclared_readers
from forge.files import replace_file
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.build.input_manifest import InputManifest

_SOURCES, _DROPPED = "sources.json", "dropped.json"
_KEPT = ("colcon_build.rc", "colcon_test.rc", "test_results", "Testing")
"""What tests and other tools left, which says nothing of how to build."""
_CLOCK_NANOSECONDS = 2_000_000_000
"""How far apart the clocks of this machine and of a file server may be."""


@frozen
class BuildInputs:
    """What a package is built from at the moment at which its build begins.

    `base` is a digest of what no native tool can see: forge, tools, variables. `shape` is one of what only
    a configure can see: options, packages of underlays. `needs` are digests of what needs installed.
    """

    base: str
    shape: str
    needs: Mapping[str, str]
    sources: InputManifest


@frozen
class Examination:
    """How files outside of the package are looked at.

    `needed(name, then, now)` tells how two states of what a need installed differ, None when nobody knows.
    `contents(paths)` are digests of what files say.
    """

    needed: Callable[[str, str, str], Changes | None]
    contents: Callable[[Iterable[str]], Mapping[str, str]]
    is_cmakes: Callable[[str], bool]


def prepare_build_dir(
    build: Path, inputs: BuildInputs, examination: Examination, *, keeps: bool, reconfigure: bool
) -> Reuse:
    """Make a build folder fit for the steps that follow; return how much of it stays.

    `keeps` tells if the build type can build on what is there at all, `reconfigure` if CMake is to run
    anyway.
    """
    before = set_aside(build)
    _discard(_trash(build))
    if before.is_dir():
        # The configure step that should have brought its products back did not end.
        _discard(build)
        before.rename(build)
    decision = _decision(build, inputs, examination, reconfigure=reconfigure) if keeps else _NOTHING
    if decision.reuse is Reuse.EVERYTHING:
        _remove_below(build, decision.dropped)
        _date_rules(build)
    else:
        _begin_empty(build, decision)
    folder = build / RECORDS
    (folder / ENDED).unlink(missing_ok=True)
    write_manifest(folder / _SOURCES, inputs.sources)
    note = {
        "began": time.time_ns(),
        "base": inputs.base,
        "shape": inputs.shape,
        "needs": dict(inputs.needs),
        "empty": decision.reuse is Reuse.NOTHING,
    }
    replace_file(folder / BEGUN, json.dumps(note, indent=2).encode())
    return decision.reuse


def bring_back_products(build: Path) -> None:
    """Move what an earlier build made, and the newly configured one still names, back into its folder.

    Files that CMake wrote again with the same bytes get their old times, so that nothing is made from them
    again. Nothing happens unless a folder was set aside.
    """
    before = set_aside(build)
    if not before.is_dir():
        return
    said = read_json(build / RECORDS / _DROPPED)
    dropped = frozenset(said.get("dropped", ()))
    graph = replace(read_native_graph(build), reported=read_native_graph(before, build).reported)
    dropped |= undeclared_readers(graph, _generated_changes(build, before), read_or_nothing)
    for path in brought_back(graph, dropped):
        if path.startswith(f"{build}/"):
            _move(path, path.replace(str(build), str(before), 1))
    for path in said.get("generated", ()):
        _keep_time(path, path.replace(str(build), str(before), 1))
    for name in (".ninja_deps", ".ninja_log"):
        _move(str(build / name), str(before / name))
    _date_rules(build)
    before.rename(_trash(build))
    _discard(_trash(build))


def set_aside(build: Path) -> Path:
    """Return where a folder stands from which products are to be brought back."""
    return build.with_name(f".{build.name}.before")


_NOTHING = Decision(Reuse.NOTHING)


def _decision(build: Path, inputs: BuildInputs, examination: Examination, *, reconfigure: bool) -> Decision:
    note, ended = read_json(build / RECORDS / BEGUN), read_json(build / RECORDS / ENDED)
    then = read_manifest(build / RECORDS / _SOURCES)
    known = then is not None and isinstance(note.get("began"), int) and note.get("base") == inputs.base
    if not known or then is None or _in_future(build, note["began"]):
        return _NOTHING
    own = compare(then, inputs.sources, by_stats=not ended)
    saved = frozenset(ended.get("saved", ()))
    if saved - inputs.sources.keys():
        return _NOTHING
    own |= Changes(modified=saved)
    needed = _needed_changes(note.get("needs"), inputs.needs, examination)
    graph = read_native_graph(build)
    elsewhere = (path for path in graph.known() - then.keys() if not path.startswith(f"{build}/"))
    if needed is None or not graph.tool or _externals_changed(build, elsewhere, note, examination):
        return _NOTHING
    decision = decide(graph, own, needed, read_or_nothing, examination.is_cmakes)
    again = reconfigure or note.get("shape") != inputs.shape
    if again and decision.reuse is Reuse.EVERYTHING:
        return Decision(Reuse.PRODUCTS if graph.tool == "ninja" else Reuse.NOTHING, decision.dropped)
    return decision


def _needed_changes(then: object, now: Mapping[str, str], examination: Examination) -> Changes | None:
    """Return how what the needs installed differs, or None when nobody knows."""
    if not isinstance(then, dict):
        return None
    changes = Changes()
    for name in then.keys() | now.keys():
        one, other = then.get(name, ""), now.get(name, "")
        if one != other:
            found = examination.needed(name, one, other)
            if found is None:
                return None
            changes |= found
    return changes


def _externals_changed(
    build: Path, elsewhere: Iterable[str], note: Mapping[str, Any], examination: Examination
) -> bool:
    """Tell if a file elsewhere that the contents may be made from says something else now.

    A build that did not end left no list of what such files said: of those `elsewhere` that its commands
    read, one that was written since it began counts as changed.
    """
    ended = (build / RECORDS / ENDED).is_file()
    then = read_manifest(build / RECORDS / EXTERNALS)
    if then is not None:
        now = examination.contents(then)
        if any(state.content != now[path] for path, state in then.items()):
            return True
    if ended:
        return then is None
    return any(written_since(path, note["began"]) for path in elsewhere)


def _in_future(build: Path, begun: int) -> bool:
    """Tell if the clock has gone back since the folder was used: then times there mean nothing."""
    latest = [begun]
    with contextlib.suppress(OSError):
        latest.append((build / ".ninja_log").stat().st_mtime_ns)
    return max(latest) > time.time_ns() + _CLOCK_NANOSECONDS


def _begin_empty(build: Path, decision: Decision) -> None:
    """Put an empty folder in the place of a build folder, with what is not forge's to remove."""
    target = set_aside(build) if decision.reuse is Reuse.PRODUCTS else _trash(build)
    if build.is_dir() and not build.is_symlink():
        build.rename(target)
    build.mkdir(parents=True, exist_ok=True)
    for name in _KEPT:
        with contextlib.suppress(FileNotFoundError):
            (target / name).rename(build / name)
    if decision.reuse is Reuse.PRODUCTS:
        graph = read_native_graph(target, build)
        made = {output for edge in graph.edges for output in edge.outputs}
        inputs = (path for path in graph.known() if path.startswith(f"{build}/"))
        said = {"dropped": sorted(decision.dropped), "generated": sorted(set(inputs) - made)}
        replace_file(build / RECORDS / _DROPPED, json.dumps(said).encode())
    else:
        _discard(target)


def _date_rules(build: Path) -> None:
    """Let build.ninja be as new as all that CMake read: forge has decided whether CMake runs again."""
    rules = build / "build.ninja"
    newest = max(map(_modified, read_by_cmake(build)), default=0)
    with contextlib.suppress(FileNotFoundError):
        if newest > rules.stat().st_mtime_ns:
            os.utime(rules, ns=(newest, newest))


def _modified(path: str) -> int:
    try:
        return os.stat(path).st_mtime_ns  # noqa: PTH116
    except OSError:
        return 0


def _remove_below(build: Path, paths: Iterable[str]) -> None:
    for path in paths:
        if path.startswith(f"{build}/") and os.path.lexists(path):
            _discard_path(path)


def _discard_path(path: str) -> None:
    if os.path.isdir(path) and not os.path.islink(path):  # noqa: PTH112, PTH114
        shutil.rmtree(path)
    else:
        os.unlink(path)  # noqa: PTH108


def _move(path: str, source: str) -> None:
    """Move a product to where it was, with what compilers leave beside an object."""
    for target, origin in ((path, source), *_beside(path, source)):
        if os.path.lexists(origin) and not os.path.lexists(target):
            os.makedirs(os.path.dirname(target), exist_ok=True)  # noqa: PTH103, PTH120
            os.rename(origin, target)  # noqa: PTH104


def _beside(path: str, source: str) -> Iterator[tuple[str, str]]:
    if path.endswith(".o"):
        yield from ((path[:-1] + ending, source[:-1] + ending) for ending in ("gcno", "dwo"))


def _keep_time(path: str, source: str) -> None:
    """Give a file that says what it said before the time that it had."""
    with contextlib.suppress(OSError):
        if filecmp.cmp(path, source, shallow=False):
            status = os.stat(source)  # noqa: PTH116
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def _generated_changes(build: Path, before: Path) -> Changes:
    """Return how the files that CMake has generated differ from those of the folder set aside.

    Generated files that are gone are missed by Ninja where compilers have reported them.
    """
    added, modified = set(), set()
    for folder, folders, files in os.walk(build):
        if folder == str(build):
            folders[:] = [name for name in folders if name not in {"CMakeFiles", RECORDS, *_KEPT}]
        for name in files:
            path = os.path.join(folder, name)  # noqa: PTH118
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
    return build.with_name(f".{build.name}.old")


def _discard(folder: Path) -> None:
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.is_dir():
        shutil.rmtree(folder)
