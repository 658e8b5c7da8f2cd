"""What CMake and each command of the native tool read and wrote in a build folder, from run to run.

Only paths below the folders that matter are kept: the package's sources, its build folder, and the prefixes
of the workspace. The journal has the files outside of them.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.engine.observation import observe

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping

    from forge.engine.observation import Observation, ObservedStep, Process

_VERSION = 1


@frozen
class Accesses:
    """What a command asked of the file system, as absolute paths.

    `searched` is what it looked for in vain; of commands of the native tool, which share most of it, only the
    folders in which it did. All these lie in the folders that
    matter; `external` are other files that it read. `written` has created folders, too, which end with '/'.
    `outside` is True if it wrote to
    another folder than the build folder, and `blind` if not all is known.
    """

    read: frozenset[str] = frozenset()
    found: frozenset[str] = frozenset()
    listed: frozenset[str] = frozenset()
    searched: frozenset[str] = frozenset()
    written: frozenset[str] = frozenset()
    external: frozenset[str] = frozenset()
    outside: bool = False
    blind: bool = False

    @property
    def outputs_known(self) -> bool:
        """Return True if everything that the command wrote lies in the build folder and is known."""
        return not self.outside and not self.blind


@frozen
class ObservedCommands:
    """What CMake did, if that is known, and the commands of the native tool by their first outputs.

    `missing` are all paths that some command has looked for in vain; they end with the first missing name.
    `external` are the files outside the folders that matter which other processes of the steps have read.
    """

    configure: Accesses | None = None
    edges: Mapping[str, Accesses] = field(default_factory=dict)
    missing: frozenset[str] = frozenset()
    external: frozenset[str] = frozenset()

    def all_external(self) -> frozenset[str]:
        """Return all files outside of the folders that matter."""
        commands = (*self.edges.values(), *((self.configure,) if self.configure else ()))
        return self.external.union(*(each.external for each in commands))

    def affected(
        self, accesses: Accesses, added: Collection[str], removed: Collection[str], modified: Collection[str]
    ) -> bool:
        """Return True if a command could now see something else; paths of folders end with '/'."""
        known = accesses.read | accesses.found
        return (
            not accesses.read.isdisjoint(modified)
            or any(path.rstrip("/") in known for path in removed)
            or (
                bool(accesses.listed) and any(_parent(path) in accesses.listed for path in (*added, *removed))
            )
            or any(not accesses.searched.isdisjoint(self._in_vain(path)) for path in added)
        )

    def _in_vain(self, path: str) -> tuple[str, ...]:
        """Return this path, or a folder of it, if it was looked for in vain, and where."""
        path = path.rstrip("/")
        while path not in self.missing:
            parent = os.path.dirname(path)
            if parent == path:
                return ()
            path = parent
        return (path, os.path.dirname(path))

    def merged(self, after: ObservedCommands, outputs: Collection[str]) -> ObservedCommands:
        """Return these accesses updated by those of a later build, of the commands with `outputs`."""
        edges = {name: each for name, each in {**self.edges, **after.edges}.items() if name in outputs}
        missing, external = self.missing | after.missing, self.external | after.external
        return ObservedCommands(after.configure or self.configure, edges, missing, external)


NOT_OBSERVED = ObservedCommands()


def _parent(path: str) -> str:
    return os.path.dirname(path.rstrip("/"))


def commands_of(
    step: ObservedStep,
    roots: Mapping[int, str],
    edge_of: Callable[[Process, frozenset[str]], tuple[str, frozenset[str]] | None],
    folders: Folders,
) -> ObservedCommands:
    """Return what a log says; `roots` has the kind of each step by its process.

    `edge_of` returns the first output and all outputs of the edge that a process below ninja runs, whose
    written files are given, or None if it is unknown.
    """
    configure: Accesses | None = None
    edges: dict[str, Accesses] = {}
    missing: set[str] = set()
    starters = (process for process in step.processes if process.parent is None or process.is_ninja)
    folders.tools = frozenset(program for process in starters for program in process.programs)
    others = {*step.processes}
    for process in step.processes:
        kind = roots.get(process.pid) if process.parent is None else None
        if kind == "cmake":
            family = process.family()
            others.difference_update(family)
            # CMake looks whether files exist; the programs that it starts may also look how old they are.
            own = [each for each in family if each.programs and Path(each.programs[-1]).name == "cmake"]
            seen, of_others = observe(family, step.blind), observe(each for each in family if each not in own)
            accesses = folders.accesses(seen)
            children = folders.accesses(of_others)
            configure = replace(
                accesses,
                read=accesses.read | children.found,
                found=accesses.found - children.found,
                searched=folders.paths(seen.missing),
            )
            missing |= configure.searched
    for process in step.edges():
        others.difference_update(process.family())
        seen = observe(process.family(), step.blind)
        accesses = folders.accesses(seen)
        edge = edge_of(process, accesses.written)
        if edge is not None:
            output, outputs = edge
            # A server has written what the command itself did not.
            blind = accesses.blind or not outputs <= {path.rstrip("/") for path in accesses.written}
            # A command may look how old a file is.
            read = accesses.read | accesses.found
            edges[output] = replace(accesses, read=read, found=frozenset(), blind=blind)
            missing |= folders.paths(seen.missing)
    external = folders.accesses(observe(others)).external
    return ObservedCommands(configure, edges, frozenset(missing), external)


class Folders:
    """The folders whose files matter, with and without resolved links."""

    def __init__(self, build: Path, others: Iterable[Path], known: Iterable[str] = ()) -> None:
        """Keep what lies below the build folder or `others`; what lies below `known` is tracked otherwise."""
        self._build = f"{build}/"
        self._known = tuple(known)
        self.tools: frozenset[str] = frozenset()
        """The programs of the steps themselves, which are tracked as tools wherever they are installed."""
        folders = (str(build), *map(str, others))
        self._spelled = sorted(
            {(f"{os.path.realpath(folder)}/", f"{folder}/") for folder in folders},
            key=lambda pair: -len(pair[0]),
        )
        self._folders: dict[str, str] = {"": "", "/": "/"}

    def path(self, path: str) -> str | None:
        """Return a path below one of the folders as its name spells it, None if it is elsewhere."""
        folder, _, name = path.rpartition("/")
        real = f"{self._real(folder)}/{name}"
        for resolved, spelled in self._spelled:
            if real.startswith(resolved):
                return spelled + real[len(resolved) :]
            if f"{real}/" == resolved:
                return spelled[:-1]
        return None

    def _real(self, folder: str) -> str:
        """Return the real path of a folder, with a look at each of its folders once."""
        if folder not in self._folders:
            parent, _, name = folder.rpartition("/")
            path = f"{self._real(parent)}/{name}"
            self._folders[folder] = os.path.realpath(path) if os.path.islink(path) else path
        return self._folders[folder]

    def paths(self, paths: Iterable[str]) -> frozenset[str]:
        """Return those below one of the folders."""
        return frozenset(found for path in paths if (found := self.path(path)) is not None)

    def accesses(self, seen: Observation) -> Accesses:
        """Return what matters of an observation."""
        kept = [path for path in seen.written if os.path.lexists(path) and not CACHED_BYTECODE.match(path)]
        kept += [
            f"{path}/" for path in seen.folders if os.path.isdir(path) and not path.endswith("/__pycache__")
        ]
        written = self.paths(kept)
        return Accesses(
            read=self.paths(seen.read | seen.executed),
            found=self.paths(seen.found),
            listed=self.paths(seen.listed),
            searched=frozenset(map(os.path.dirname, self.paths(seen.missing))),
            written=frozenset(path for path in written if path.startswith(self._build)),
            external=frozenset(self._external(seen.read - seen.written)),
            outside=len(written) < len(kept) or any(not path.startswith(self._build) for path in written),
            blind=bool(seen.blind),
        )

    def _external(self, paths: Iterable[str]) -> Iterator[str]:
        """Yield the files that lie elsewhere; Python's caches stand for their sources."""
        for path in paths:
            path = CACHED_BYTECODE.sub(r"\1/\2.py", path)
            if path.startswith(self._known) or self.path(path) is not None or not os.path.isfile(path):
                continue
            if not (os.access(path, os.X_OK) and os.path.realpath(path) in self.tools):
                yield path


CACHED_BYTECODE = re.compile(r"^(.*)/__pycache__/([^/.]+)\.[^/]*\.pyc$")
_SETS = ("read", "found", "listed", "searched", "written", "external")


def write_commands(file: Path, commands: ObservedCommands) -> None:
    """Write what is known of commands, each path once."""
    numbers: dict[str, int] = {}

    def coded(accesses: Accesses) -> list[object]:
        sets = [
            [numbers.setdefault(path, len(numbers)) for path in getattr(accesses, name)] for name in _SETS
        ]
        return [*sets, accesses.outside, accesses.blind]

    data = {
        "version": _VERSION,
        "configure": coded(commands.configure) if commands.configure else None,
        "edges": {name: coded(each) for name, each in commands.edges.items()},
        "missing": sorted(commands.missing),
        "external": sorted(commands.external),
        "paths": list(numbers),
    }
    replace_file(file, json.dumps(data).encode())


def read_commands(file: Path) -> ObservedCommands:
    """Return what a file says of commands; nothing if there is none, or it is damaged."""
    try:
        data = json.loads(file.read_bytes())
        if data["version"] != _VERSION:
            return ObservedCommands()
        paths = data["paths"]

        def decoded(coded: list[list[int]]) -> Accesses:
            *sets, outside, blind = coded
            found = (frozenset(paths[number] for number in numbers) for numbers in sets)
            return Accesses(**dict(zip(_SETS, found, strict=True)), outside=bool(outside), blind=bool(blind))

        configure = decoded(data["configure"]) if data["configure"] else None
        edges = {name: decoded(each) for name, each in data["edges"].items()}
        return ObservedCommands(configure, edges, frozenset(data["missing"]), frozenset(data["external"]))
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return ObservedCommands()
