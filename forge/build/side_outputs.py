"""Find files that commands wrote beside their declared outputs: link maps, `.su` files, saved temporaries.

Ninja does not know them. When CMake runs again in an empty folder, a product that is moved back does not
bring such a file along. So the command that wrote it has to run again, or the file is moved with the product
if it certainly belongs to it. The files that CMake wrote are recorded after it ran; any other file that is
found in the folder before the next run, and is no declared output, was written by a command.
"""

from __future__ import annotations

import json
import os
import re
from collections import defaultdict
from typing import TYPE_CHECKING

from forge.base.files import BYTECODE, replace_file
from forge.base.layout import SCRATCH_DIR
from forge.build.build_notes import ENDED, read_json

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from forge.build.inputs.native_graph import Edge, NativeGraph

_CONFIGURED = "configured.json"
_OF_TOOLS = re.compile(r"\.ninja_\w+$|\w*install(_local)?_manifest[\w.-]*\.txt$|.*\.gcda$|.*\.(py[co]|o\.d)$")
"""Names of files that ninja, CMake's install step, programs with coverage and Python's caches write."""
_WORD = re.compile(r"[^\s\"'=,:;()|&<>]+")


class SideOutputs:
    """What follows from the side outputs of the last build for the products that are moved back.

    `dropped` are products whose commands must run again. `beside` are the side outputs of other products.
    """

    def __init__(self) -> None:
        """Start without any."""
        self.dropped: set[str] = set()
        self.beside: dict[str, list[str]] = defaultdict(list)


def record_configured(build: Path, names: Collection[str]) -> None:
    """Record the states of the files that CMake wrote, whose relative names are given."""
    states = {name: state for name in sorted(names) if (state := _state(build / name))}
    replace_file(build / SCRATCH_DIR / _CONFIGURED, json.dumps(states).encode())


def files_below(build: Path, kept: Collection[str]) -> Iterator[str]:
    """Yield the relative names of files in a build folder, except forge's own and `kept` names at its top."""
    for folder, folders, names in os.walk(build):
        below = os.path.relpath(folder, build)
        left_out = {SCRATCH_DIR, BYTECODE, *kept} if below == "." else {BYTECODE}
        folders[:] = [name for name in folders if name not in left_out]
        for name in names:
            if name not in left_out and not _OF_TOOLS.match(name):
                yield name if below == "." else f"{below}/{name}"


def find_side_outputs(
    before: Path,
    build: Path,
    then: NativeGraph,
    now: NativeGraph,
    kept: Collection[str],
    claimed: Collection[str] = (),
) -> SideOutputs:
    """Return what the files in the folder that was set aside mean for its products; see `SideOutputs`.

    `then` and `now` are the graphs before and after CMake ran, both with paths below `build`. Which commands
    wrote the `claimed` files was observed.
    """
    found = SideOutputs()
    commands = _Commands(build, then)
    texts = {edge.outputs: edge.text for edge in now.edges}
    for path in _undeclared(before, build, then, kept):
        if path in claimed:
            continue
        folder, name = os.path.split(path)
        edge = commands.compilation(folder, name)
        if edge is not None and texts.get(edge.outputs) == edge.text:
            found.beside[edge.outputs[0]].append(path)
            continue
        writers = {edge} if edge is not None else commands.named_like(name)
        if writers:
            found.dropped.update(output for each in writers for output in each.outputs)
        elif folder in commands.objects or not commands.may_write(path):
            # Any command may have written it.
            found.dropped.update(output for edge in then.edges for output in edge.outputs)
            break
    return found


class _Commands:
    """The commands of a build graph, by what they write and what their command lines name."""

    def __init__(self, build: Path, graph: NativeGraph) -> None:
        """Index the edges; commands with undeclared outputs run again in any case."""
        self.objects: dict[str, list[tuple[str, Edge]]] = defaultdict(list)
        """The compilations by the folder of their objects, with the names of these up to the last '.'."""
        self._names: dict[str, set[Edge]] = defaultdict(set)
        """The compilations and links by the words of their command lines."""
        self._stems: dict[str, set[Edge]] = defaultdict(set)
        """The same by the beginnings of the names that tools derive from those of their products."""
        self._places = {""}
        self._root = str(build)
        for edge in graph.edges:
            words = _WORD.findall(edge.text)
            if not edge.outputs_known:
                named = [os.path.normpath(word) for word in words if word.startswith(f"{build}/")]
                self._places.update(*((path, os.path.dirname(path)) for path in named))
                self._places.update(map(os.path.dirname, edge.outputs))
                continue
            for word in words:
                self._names[os.path.basename(word)].add(edge)
            for output in edge.outputs:
                folder, name = os.path.split(output)
                stem = os.path.splitext(name)[0]
                for beginning in (f"{name}.", f"{name}-", f"{stem}."):
                    self._stems[beginning].add(edge)
                if edge.compiles:
                    self.objects[folder].append((f"{stem}.", edge))
        self._places -= {self._root, f"{build}/CMakeFiles"}

    def compilation(self, folder: str, name: str) -> Edge | None:
        """Return the compilation with the object beside which a file lies: x.c.su belongs to x.c.o."""
        fitting = [each for each in self.objects.get(folder, ()) if name.startswith(each[0])]
        return max(fitting, key=lambda each: len(each[0]))[1] if fitting else None

    def named_like(self, name: str) -> set[Edge]:
        """Return the compilations and links that name a file, or whose products have such names."""
        beginnings = (self._stems.get(name[:at], set()) for at in range(1, len(name)))
        return self._names.get(name, set()).union(*beginnings)

    def may_write(self, path: str) -> bool:
        """Tell if a command that runs again names the file or its folder, or writes to that folder."""
        while len(path) > len(self._root):
            if path in self._places:
                return True
            path = os.path.dirname(path)
        return False


def _undeclared(before: Path, build: Path, then: NativeGraph, kept: Collection[str]) -> Iterator[str]:
    """Yield the files, as paths below `build`, that commands wrote without declaring them."""
    configured = read_json(before / SCRATCH_DIR / _CONFIGURED)
    declared = {output for edge in then.edges for output in edge.outputs}.union(then.written_by_cmake)
    try:
        ended = (before / SCRATCH_DIR / ENDED).stat().st_mtime_ns
    except FileNotFoundError:
        ended = None
    for name in files_below(before, kept):
        path = f"{build}/{name}"
        if path in declared:
            continue
        state = _state(before / name)
        if state is None or configured.get(name) == state:
            continue
        # Later files are those of tests, or of the user.
        if ended is None or state[1] <= ended:
            yield path


def _state(path: Path) -> list[int] | None:
    """Return size and time of a file; None if there is none."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return [status.st_size, status.st_mtime_ns]
