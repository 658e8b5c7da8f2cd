"""Decide how much of a build folder the next build may reuse and still match a build from an empty folder.

The last build observed which files CMake and each command of the native tool read, listed, looked for in vain
and wrote:

- A command that could now see something else, or whose declared inputs changed, runs again. All files that it
  wrote are removed before, so that it begins as in an empty folder.
- If CMake could see something else, it runs in an empty folder, and the results of unchanged commands that
  are still in the graph are moved back. No cache entry and no generated file survives this.
- A partially observed command runs again after any change, in a folder that CMake configures from scratch.

Native tools other than ninja do not reveal which process runs which command: then nothing is reused.
"""

from __future__ import annotations

import enum
import os
import re
from collections import Counter
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.build.inputs.fingerprints import Changes
    from forge.build.inputs.native_graph import Edge, NativeGraph
    from forge.engine.accesses import Accesses, ObservedCommands


_STEPS = re.compile(r"/src/[^/]+-stamp/[^/]+$")
"""The stamps of an ExternalProject, whose own native tool keeps track of its folder."""


class Reuse(enum.Enum):
    """How much of a build folder is kept."""

    NOTHING = "nothing"
    PRODUCTS = "products"
    """CMake begins in an empty folder; outputs that are still in the build graph are moved back."""
    EVERYTHING = "everything"


@frozen
class Decision:
    """How much is reused, and the products (absolute paths) that are not."""

    reuse: Reuse
    dropped: frozenset[str] = frozenset()


def decide(
    graph: NativeGraph,
    changes: Changes,
    seen: ObservedCommands,
    exists: Callable[[str], bool] = os.path.lexists,
) -> Decision:
    if not changes:
        return Decision(Reuse.EVERYTHING)
    if graph.tool != "ninja" or graph.has_dyndeps or seen.configure is None or seen.configure.blind:
        return Decision(Reuse.NOTHING)
    if _have_changed_files_of_others(seen, seen.configure):
        return Decision(Reuse.NOTHING)
    affected = affected_outputs(graph, changes, seen)
    dropped = with_all_written(graph, affected.union(_repeated_outputs(graph, seen, exists)), seen)
    must_configure = (
        bool(changes.all & {*graph.read_by_cmake})
        or is_affected(seen.configure, seen, changes)
        # Their other outputs are unknown and would remain.
        or any(not is_known(edge, seen) and any(map(exists, edge.outputs)) for edge in graph.edges)
    )
    return Decision(Reuse.PRODUCTS if must_configure else Reuse.EVERYTHING, dropped)


def _have_changed_files_of_others(seen: ObservedCommands, configure: Accesses) -> bool:
    """Return True if commands have changed or removed files that CMake wrote, or appended to other outputs.

    If such a command runs again, it would find its own earlier result, not that of the other one.
    """
    configured = {path for path in configure.written if path[-1] != "/"}
    edges = seen.edges.values()
    writers = Counter(path for each in edges for path in each.written if path[-1] != "/")
    return any(
        each.removed
        or not configured.isdisjoint(each.written)
        or any(writers[path] > 1 for path in each.written & each.read)
        for each in edges
    )


def _repeated_outputs(
    graph: NativeGraph, seen: ObservedCommands, exists: Callable[[str], bool]
) -> Iterator[str]:
    """Yield the outputs of commands that append to files in each build, as targets without outputs may.

    A file that they only replace keeps its time, since its content may be the same.
    """
    for edge in graph.edges:
        accesses = seen.edges.get(edge.outputs[0])
        if accesses and not accesses.read.isdisjoint(accesses.written) and not any(map(exists, edge.outputs)):
            yield from edge.outputs


def is_known(edge: Edge, seen: ObservedCommands) -> bool:
    """Return True if all inputs and outputs are known, and it wrote only to the build folder."""
    accesses = seen.edges.get(edge.outputs[0])
    return accesses is not None and accesses.outputs_known and not any(map(_STEPS.search, edge.outputs))


def is_affected(accesses: Accesses, seen: ObservedCommands, changes: Changes) -> bool:
    return seen.affected(accesses, changes.added, changes.removed, changes.modified)


def affected_outputs(graph: NativeGraph, changes: Changes, seen: ObservedCommands) -> frozenset[str]:
    """Return the outputs of commands that are affected by the changes or partially observed.

    Outputs made from the latter are made again, too: the native tool does not notice an output that a command
    writes later than declared, as ExternalProject does.
    """
    unknown = graph.with_made_from(
        {output for edge in graph.edges if not is_known(edge, seen) for output in edge.outputs}
    )
    return unknown.union(
        output
        for edge in graph.edges
        if unknown.isdisjoint(edge.outputs)
        if not changes.all.isdisjoint(graph.inputs_of(edge))
        or is_affected(seen.edges[edge.outputs[0]], seen, changes)
        for output in edge.outputs
    )


def with_all_written(graph: NativeGraph, dropped: frozenset[str], seen: ObservedCommands) -> frozenset[str]:
    """Add the side outputs of the commands of `dropped` outputs, and everything that was made from these.

    The native tool tracks neither. A command that runs again because of its inputs also begins without its
    side outputs, and without later outputs of other commands.
    """
    candidates = [(edge, seen.edges[edge.outputs[0]]) for edge in graph.edges if is_known(edge, seen)]
    users = graph.users() if candidates and dropped else {}
    # For example, sources: the native tool checks such files before the commands run.
    unknown = (edge for edge in graph.edges if dropped and not is_known(edge, seen))
    beside = frozenset(
        path
        for edge in unknown
        if edge.outputs[0] in seen.edges
        for path in seen.edges[edge.outputs[0]].written.difference(edge.outputs)
    )
    dirty: set[str] = set()
    more = set(dropped)
    while more - dirty:
        waiting = [*more]
        while waiting:
            path = waiting.pop()
            if path not in dirty:
                dirty.add(path)
                waiting += (output for edge in users.get(path, ()) for output in edge.outputs)
        unaffected = []
        folders = {os.path.dirname(path.rstrip("/")) for path in more}
        for edge, each in candidates:
            # Both writers of a shared output rerun, and so do readers of undeclared outputs and of names.
            again = (
                not more.isdisjoint(edge.outputs)
                or (not dirty.isdisjoint(edge.outputs) and not each.written.issubset(edge.outputs))
                or not more.isdisjoint(each.written)
                or not (dirty & each.read).issubset(graph.inputs_of(edge))
                or not beside.isdisjoint(each.read)
                or not more.isdisjoint(each.undone)
                or not each.listed.isdisjoint(folders)
            )
            if again:
                more.update(each.written, edge.outputs)
            else:
                unaffected.append((edge, each))
        candidates = unaffected
        begun = (edge for edge in graph.edges if not dirty.isdisjoint(edge.outputs))
        accesses = filter(None, (seen.edges.get(edge.outputs[0]) for edge in begun))
        early = frozenset[str]().union(*(each.early | each.undone for each in accesses)) - more
        for edge, each in candidates if early else ():
            if not early.isdisjoint((*edge.outputs, *each.written)):
                more.update(each.written, edge.outputs)
    return frozenset(more)


def restorable_outputs(
    graph: NativeGraph, dropped: frozenset[str], seen: ObservedCommands
) -> tuple[str, ...]:
    """Return the outputs in the newly configured graph that can be restored from the earlier build."""
    return tuple(
        output
        for edge in graph.edges
        if is_known(edge, seen) and dropped.isdisjoint(edge.outputs)
        for output in edge.outputs
    )
