"""How much of a build folder the next build may reuse, so that the result is that of an empty folder.

The native tool compares times and knows only what was declared or reported to it. So forge compares contents,
and decides from the files that changed:

- An input of a compiler or linker changed: its outputs are removed, and the native tool rebuilds them.
- A file that CMake read changed, or a file was added or removed: CMake reruns in an empty folder, and outputs
  that are still in the graph are restored. No cache entry and no generated file survives this.
- An undeclared file changed: the commands that may have read it rerun. These are the package's custom
  commands (add_custom_command, ExternalProject), CMake code that reads files at configure time, and compilers
  and linkers whose inputs mention the file name (.incbin, linker scripts, `-l`).
- A new file may shadow another one: whatever mentions its name is recompiled (#include, __has_include).
"""

from __future__ import annotations

import enum
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.engine.commands import NOT_OBSERVED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from forge.build.inputs.input_manifest import Changes
    from forge.build.inputs.native_graph import Edge, NativeGraph
    from forge.engine.commands import Accesses, ObservedCommands


class Reuse(enum.Enum):
    """What stays of a build folder."""

    NOTHING = "nothing"
    PRODUCTS = "products"
    """CMake begins in an empty folder; what the native tool made and still names is brought back."""
    EVERYTHING = "everything"


@frozen
class Decision:
    """How much is reused, and the products (absolute paths) that are not."""

    reuse: Reuse
    dropped: frozenset[str] = frozenset()


_READS = re.compile(
    r"\b(execute_process|exec_program|try_compile|try_run|load_cache|check_\w+"
    r"|file\s*\(\s*(READ|STRINGS|MD5|SHA\d+|SHA3_\d+|COPY|COPY_FILE|INSTALL|TIMESTAMP|SIZE|CONFIGURE))\b",
    re.IGNORECASE,
)
"""CMake code that reads contents without CMake keeping account of it."""
_READS_BESIDE = re.compile(
    r"\bfile\s*\(\s*(READ|STRINGS)\s+\"?\$\{(CMAKE_CURRENT_LIST_DIR|(?!CMAKE_|PROJECT_)\w+_DIR)\}",
    re.IGNORECASE,
)
"""An installed package that reads a text of its own, as a config file reads its list of targets."""
_OF_ROS = re.compile(r"/share/(ament_\w+|rosidl_\w+|python_cmake_module)/cmake/")
"""CMake code of ament and rosidl, which declares what it reads of a package."""
_FINDS = re.compile(r"/(Find(?!Package|Python|PkgConfig|Threads|Git)|Check|Test)\w+\.cmake$")
"""CMake's own modules that read headers of others for their versions, or compile with them."""
_STEPS = re.compile(r"/src/[^/]+-stamp/[^/]+$")
"""What tells that a step of an ExternalProject was done."""
_NEVER_BUILT = re.compile(r"/CMakeFiles/(.+\.util|(\w+_)?uninstall)$")
"""Targets such as `edit_cache` and `install`, which no build of all targets runs."""
_LIBRARY = re.compile(r"lib(.+?)\.(a|so|so\.[\d.]+)$")
_INSTALLS_BY_CODE = re.compile(
    r"\b(CODE|SCRIPT|\w*RUNTIME_DEPENDENC\w+|IMPORTED_RUNTIME_ARTIFACTS|\w*[Bb]undle\w*)\b"
)
_INSTALLED = re.compile(r"\bFILES((?:\s+\"[^\"]*\")+)")
_NAMED = re.compile(r"""(?:^|[\s"'=])(/[^\s"'&|<>;]+)""")
_PRECOMPILED = (".gch", ".pch", ".modulemap")


def decide(
    graph: NativeGraph,
    own: Changes,
    needed: Changes,
    read: Callable[[str], bytes],
    is_cmake_module: Callable[[str], bool],
    seen: ObservedCommands = NOT_OBSERVED,
) -> Decision:
    """Return how much of a build folder can be reused after the package or its dependencies changed.

    `own` are the changes of the package's sources, `needed` those of its dependencies' installed files.
    `read` returns the current content of a file; `is_cmake_module` returns True for CMake's own modules.
    Of CMake and commands that were observed it is known what they read; of others it is inferred.
    """
    changes = own | needed
    if not changes:
        return Decision(Reuse.EVERYTHING)
    if not graph.tool or graph.has_dyndeps:
        return Decision(Reuse.NOTHING)
    known = graph.known()
    code = frozenset(graph.read_by_cmake)
    if seen.configure and not seen.configure.blind:
        again = _is_affected(seen.configure, seen, changes)
    else:
        again = (
            bool(changes.names)
            or any(path.endswith(".pc") for path in needed.modified)
            or _configure_reads(own.modified, needed.modified, code, read, is_cmake_module)
        )
    again = (
        again
        or bool(changes.all & code)
        or any(_STEPS.search(output) for output in _made_from(graph, changes.all & known))
        or any(
            _may_have_read(edge, graph, changes.all, read)
            for edge in graph.opaque()
            if not is_known(edge, seen)
        )
    )
    if again and graph.tool != "ninja":
        return Decision(Reuse.NOTHING)
    dropped = _made_from(graph, changes.all & known) | undeclared_readers(graph, changes, read, seen)
    dropped = with_side_outputs(graph, dropped, seen)
    if not again:
        return Decision(Reuse.EVERYTHING, dropped)
    return Decision(Reuse.PRODUCTS, dropped | _always_dirty_outputs(graph, seen))


def is_known(edge: Edge, seen: ObservedCommands) -> bool:
    """Return True if all is known that a command read and wrote, and it wrote to the build folder only."""
    accesses = seen.edges.get(edge.outputs[0])
    return accesses is not None and accesses.outputs_known and not any(map(_STEPS.search, edge.outputs))


def _is_affected(accesses: Accesses, seen: ObservedCommands, changes: Changes) -> bool:
    return seen.affected(accesses, changes.added, changes.removed, changes.modified)


def with_side_outputs(graph: NativeGraph, dropped: frozenset[str], seen: ObservedCommands) -> frozenset[str]:
    """Add what the commands of `dropped` outputs wrote beside them, and what was made from that.

    The native tool knows neither. A command that runs again because of its inputs begins without its side
    outputs, too.
    """
    known = [(edge, seen.edges[edge.outputs[0]]) for edge in graph.edges if is_known(edge, seen)]
    users = graph.users() if known and dropped else {}
    dirty: set[str] = set()
    more = set(dropped)
    while more - dirty:
        waiting = [*more]
        while waiting:
            path = waiting.pop()
            if path not in dirty:
                dirty.add(path)
                waiting += (output for edge in users.get(path, ()) for output in edge.outputs)
        kept = []
        for edge, each in known:
            # What two commands wrote, both write again; what a command read of another, it reads again.
            again = (
                not more.isdisjoint(edge.outputs)
                or (not dirty.isdisjoint(edge.outputs) and not each.written.issubset(edge.outputs))
                or not more.isdisjoint(each.written)
                or not (dirty & each.read).issubset(graph.inputs_of(edge))
            )
            if again:
                more.update(each.written, edge.outputs)
            else:
                kept.append((edge, each))
        known = kept
    return frozenset(more)


def is_own_code(path: str, is_cmake_module: Callable[[str], bool]) -> bool:
    """Tell if a file of CMake code is neither CMake's, ament's nor rosidl's."""
    return not is_cmake_module(path) and not _OF_ROS.search(path)


def would_only_link(graph: NativeGraph, decision: Decision) -> bool:
    """Return True if the only work after a change of shared libraries is to relink.

    `decision` is the result of decide(). False if a command may run the linked program or read undeclared
    files.
    """
    if graph.tool != "ninja" or decision.reuse is not Reuse.EVERYTHING:
        return False
    if not all(edge.inputs_known or _NEVER_BUILT.search(edge.outputs[0]) for edge in graph.edges):
        return False
    again = (edge for edge in graph.edges if not decision.dropped.isdisjoint(edge.outputs))
    return all(edge.links_dynamically for edge in again)


def installs_what_others_installed(
    scripts: Iterable[str], code: Iterable[str], prefixes: Iterable[str]
) -> bool:
    """Tell if installing a package may copy or read files of its dependencies.

    `scripts` are the texts of its cmake_install.cmake files, `code` those of its own CMake files, `prefixes`
    the absolute paths of the prefixes of its dependencies.
    """
    if any(_INSTALLS_BY_CODE.search(text) for text in code):
        return True
    copied = (
        path for text in scripts for files in _INSTALLED.findall(text) for path in files.split('"')[1::2]
    )
    below = tuple(f"{prefix}/" for prefix in prefixes)
    return any(path.startswith(below) for path in copied)


def undeclared_readers(
    graph: NativeGraph, changes: Changes, read: Callable[[str], bytes], seen: ObservedCommands = NOT_OBSERVED
) -> frozenset[str]:
    """Return the outputs of commands that read or looked for changed files unreported, or may have.

    What one target lists as a library, another may find by '-l'. What is included in one place is asked for
    by __has_include in another.
    """
    observed = [edge for edge in graph.edges if is_known(edge, seen)]
    affected = frozenset(
        output
        for edge in observed
        if _is_affected(seen.edges[edge.outputs[0]], seen, changes)
        for output in edge.outputs
    )
    others = replace(graph, edges=tuple(edge for edge in graph.edges if not is_known(edge, seen)))
    known = graph.reported_by_compilers().union(graph.read_by_cmake)
    return affected | _mentioning(others, changes.names | (changes.modified - known), changes.all, read)


def restorable_outputs(
    graph: NativeGraph, dropped: frozenset[str], seen: ObservedCommands = NOT_OBSERVED
) -> tuple[str, ...]:
    """Return the outputs in the newly configured graph that can be restored from the earlier build.

    Commands that may write undeclared outputs are excluded, because only the declared ones could be restored.
    """
    made_again = _always_dirty_outputs(graph, seen)
    kept = (edge.outputs for edge in graph.edges if edge.outputs_known or is_known(edge, seen))
    return tuple(
        output
        for outputs in kept
        if dropped.isdisjoint(outputs) and made_again.isdisjoint(outputs)
        for output in outputs
    )


def _always_dirty_outputs(graph: NativeGraph, seen: ObservedCommands) -> frozenset[str]:
    """Return the outputs of commands that must rerun, and all outputs that depend on them.

    Ninja detects most of these by their times, but not if a command writes its output later than its rule
    says, as ExternalProject steps do.
    """
    made = {
        output
        for edge in graph.edges
        if not edge.outputs_known and not is_known(edge, seen)
        for output in edge.outputs
    }
    while True:
        more = {
            output
            for edge in graph.edges
            if not made.isdisjoint(graph.inputs_of(edge))
            for output in edge.outputs
        }
        if more <= made:
            return frozenset(made)
        made |= more


def _configure_reads(
    own: frozenset[str],
    needed: frozenset[str],
    code: frozenset[str],
    read: Callable[[str], bytes],
    is_cmake_module: Callable[[str], bool],
) -> bool:
    """Tell if CMake code may have read one of the modified files without CMake keeping account of it."""
    if not own and not needed:
        return False
    headers = [path for path in needed if not _LIBRARY.match(os.path.basename(path))]
    for path in code:
        if is_cmake_module(path):
            # CMake's modules look at what others install, never at a package's own sources.
            if headers and _FINDS.search(path):
                return True
        elif not _OF_ROS.search(path):
            text = read(path).decode(errors="replace")
            if _READS.search(text if headers else _READS_BESIDE.sub("", text)):
                return True
    return False


def _may_have_read(
    edge: Edge, graph: NativeGraph, changed: frozenset[str], read: Callable[[str], bytes]
) -> bool:
    """Tell if a command may have read one of the changed files without declaring it.

    That may be any file, save that commands seldom read sources which are compiled: such a one counts if
    the command, or a file that it names, mentions it.
    """
    undeclared = changed.difference(graph.inputs_of(edge))
    sources = undeclared & graph.compiled_sources()
    if undeclared - sources:
        return True
    if not sources:
        return False
    named = {match[1] for match in _NAMED.finditer(edge.text)}
    texts = [edge.text.encode(errors="surrogateescape"), *map(read, {*edge.inputs, *named})]
    names = [os.fsencode(os.path.basename(path)) for path in sources]
    return any(name in text for text in texts for name in names)


def _made_from(graph: NativeGraph, inputs: frozenset[str]) -> frozenset[str]:
    """Return the outputs of the edges that have one of `inputs`."""
    if not inputs:
        return frozenset()
    edges = (edge for edge in graph.edges if not inputs.isdisjoint(graph.inputs_of(edge)))
    return frozenset(output for edge in edges for output in edge.outputs)


def _mentioning(
    graph: NativeGraph, paths: frozenset[str], changed: frozenset[str], read: Callable[[str], bytes]
) -> frozenset[str]:
    """Return the outputs of the edges that mention one of `paths` by its name.

    A compiler looks for a file because a text that it reads, or its command line, names it. What such a
    text cannot show is a name that the preprocessor puts together. Texts in `changed` are read again
    anyway.
    """
    if not paths:
        return frozenset()
    folders = tuple(path for path in paths if path.endswith("/"))
    names = {os.path.basename(path).encode(errors="surrogateescape") for path in paths - {*folders}}
    if any(name.endswith(_PRECOMPILED) for name in map(os.fsdecode, names)):
        return frozenset(output for edge in graph.edges for output in edge.outputs)
    pattern = re.compile(b"|".join(map(re.escape, sorted(names))) or rb"(?!)")
    libraries = {match[1] for name in names if (match := _LIBRARY.match(os.fsdecode(name)))}
    linked = re.compile("|".join(rf"-l:?{re.escape(name)}\b" for name in sorted(libraries)) or r"(?!)")
    mentions: dict[str, bool] = {}

    def says(path: str) -> bool:
        if path not in mentions:
            mentions[path] = path not in changed and bool(pattern.search(read(path)))
        return mentions[path]

    def concerned(edge: Edge) -> bool:
        text = edge.text
        if pattern.search(text.encode(errors="surrogateescape")) or linked.search(text):
            return True
        return edge.compiles and any(says(path) for path in graph.inputs_of(edge))

    return frozenset(output for edge in graph.edges if concerned(edge) for output in edge.outputs)


def read_or_nothing(path: str) -> bytes:
    """Return what a regular file says, nothing when it is not there."""
    try:
        return Path(path).read_bytes() if os.path.isfile(path) else b""
    except OSError:
        return b""
