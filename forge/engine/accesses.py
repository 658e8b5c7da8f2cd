"""The file accesses of CMake and of the commands of a native tool, and their encoding in records."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field, replace
from typing import Any

from forge.base.frozen import Pairs, frozen
from forge.engine.observed import is_intact

_SETS = (
    *("read", "found", "listed", "searched", "written", "external", "asked", "kept", "ledgers"),
    *("early", "undone", "removed"),
)


@frozen
class Accesses:
    """File system accesses of a command, as absolute paths.

    `searched` are paths that it looked for in vain; for commands of the native tool, which share most of
    them, only the searched folders. All these are in relevant folders. `external` are other files that it
    read or looked for in vain, and folders that it listed, ending with '/.'. `asked` are questions for a
    `World`. `written` also contains created folders, ending with '/'. `kept` are files written by programs
    with `ledgers`, a digest and a path each; see `forge.engine.observed`. `early` are paths that other
    commands wrote only after it had looked for them or listed their folder. `undone` are outputs of commands
    of which it has removed or renamed files, and `removed` such files that no command wrote. `outside` is
    True if it wrote elsewhere than to the build folder, and `blind` if not all is known.
    """

    read: frozenset[str] = frozenset()
    found: frozenset[str] = frozenset()
    listed: frozenset[str] = frozenset()
    searched: frozenset[str] = frozenset()
    written: frozenset[str] = frozenset()
    external: frozenset[str] = frozenset()
    asked: frozenset[str] = frozenset()
    kept: frozenset[str] = frozenset()
    ledgers: frozenset[str] = frozenset()
    early: frozenset[str] = frozenset()
    undone: frozenset[str] = frozenset()
    removed: frozenset[str] = frozenset()
    outside: bool = False
    blind: bool = False

    def __or__(self, after: Accesses) -> Accesses:
        sets = {name: getattr(self, name) | getattr(after, name) for name in _SETS}
        return Accesses(**sets, outside=self.outside or after.outside, blind=self.blind or after.blind)

    @property
    def remaining(self) -> frozenset[str]:
        """Return the outputs that need not be removed before the command runs again."""
        return self.kept if self.outputs_known and all(map(is_intact, self.ledgers)) else frozenset()

    @property
    def outputs_known(self) -> bool:
        """Return True if the writes of the command are completely known and inside the build folder."""
        return not self.outside and not self.blind


@frozen
class ObservedCommands:
    """The accesses of CMake, if known, and of the commands of the native tool by their first outputs.

    `missing` are all paths that some command has looked for in vain; they end with the first missing name.
    `rest` are the accesses of other processes of the steps. `answers` are the answers to all questions at the
    time of recording. `left` are the files that the install step wrote to the build folder, such as its
    manifest. `outdated` are outputs of reused commands that could see something else after the others have
    run; they are not recorded.
    """

    configure: Accesses | None = None
    edges: Mapping[str, Accesses] = field(default_factory=dict)
    missing: frozenset[str] = frozenset()
    rest: Accesses | None = None
    answers: Pairs = ()
    left: frozenset[str] = frozenset()
    outdated: frozenset[str] = frozenset()

    @property
    def all(self) -> tuple[Accesses, ...]:
        """The accesses of all commands and other processes."""
        return (*self.edges.values(), *filter(None, (self.configure, self.rest)))

    def affected(
        self, accesses: Accesses, added: Collection[str], removed: Collection[str], modified: Collection[str]
    ) -> bool:
        """Return True if a command could now see something else; paths of folders end with '/'."""
        seen_paths = accesses.read | accesses.found
        return (
            not accesses.read.isdisjoint(modified)
            # The command would rewrite the file, as CMake does with a generated file in the sources.
            or not accesses.written.isdisjoint(modified)
            # A folder stands for its mode, which is copied with it.
            or any(path[:-1] in seen_paths | accesses.listed for path in modified if path.endswith("/"))
            or any(path.rstrip("/") in seen_paths for path in removed)
            or (
                bool(accesses.listed)
                and any(os.path.dirname(path.rstrip("/")) in accesses.listed for path in (*added, *removed))
            )
            or any(not accesses.searched.isdisjoint(self._in_vain(path)) for path in added)
        )

    def _in_vain(self, path: str) -> tuple[str, ...]:
        """Return the missing path that equals or contains this one, and the folder that lacked it."""
        path = path.rstrip("/")
        while path not in self.missing:
            parent = os.path.dirname(path)
            if parent == path:
                return ()
            path = parent
        return (path, os.path.dirname(path))

    def merged(self, after: ObservedCommands, outputs: Collection[str]) -> ObservedCommands:
        """Return these accesses updated by those of a later build, for the commands with `outputs`."""
        edges = {name: each for name, each in {**self.edges, **after.edges}.items() if name in outputs}
        for name in self.edges.keys() & after.edges.keys() & edges.keys():
            # Outputs that only the earlier run wrote depend on the inputs of that run.
            left = self.edges[name].written - after.edges[name].written
            if any(not path.endswith("/") and os.path.lexists(path) for path in left):
                edges[name] = self.edges[name] | after.edges[name]
        rest = self.rest | after.rest if self.rest and after.rest else after.rest or self.rest
        configure, missing = after.configure or self.configure, self.missing | after.missing
        merged = ObservedCommands(configure, edges, missing, rest, left=after.left)
        return replace(merged, outdated=frozenset(merged._outdated(self, after)))

    def _outdated(self, before: ObservedCommands, after: ObservedCommands) -> Iterator[str]:
        """Yield the outputs of commands that did not run again but could see what the others have made."""
        nothing = frozenset[str]()
        written = nothing.union(*(each.written for each in after.edges.values()))
        again = (each.written for name, each in before.edges.items() if name in after.edges)
        removed = {path for path in nothing.union(*again) - written if not os.path.lexists(path.rstrip("/"))}
        added = written.difference(*(each.written for each in before.all))
        folders = {os.path.dirname(path.rstrip("/")) for path in added | removed}
        # Only what the earlier commands looked for: those that ran looked for their own outputs, too.
        sought = {os.path.dirname(path) for path in added & before.missing}
        for name in self.edges.keys() - after.edges.keys():
            each = self.edges[name]
            if not (folders.isdisjoint(each.listed) and sought.isdisjoint(each.searched | each.listed)):
                yield name


NOT_OBSERVED = ObservedCommands()


def encode_commands(commands: ObservedCommands) -> Mapping[str, object]:
    """Return the records of commands as JSON data, with each path once."""
    numbers: dict[str, int] = {}

    def coded(accesses: Accesses) -> list[object]:
        sets = [
            [numbers.setdefault(path, len(numbers)) for path in getattr(accesses, name)] for name in _SETS
        ]
        return [*sets, accesses.outside, accesses.blind]

    return {
        "configure": coded(commands.configure) if commands.configure else None,
        "edges": {name: coded(each) for name, each in commands.edges.items()},
        "missing": sorted(commands.missing),
        "rest": coded(commands.rest) if commands.rest else None,
        "answers": commands.answers,
        "left": sorted(commands.left),
        "paths": list(numbers),
    }


def decode_commands(data: Mapping[str, Any]) -> ObservedCommands:
    """Decode the result of `encode_commands`; raises LookupError, TypeError or ValueError."""
    paths = data["paths"]

    def decoded(coded: list[list[int]]) -> Accesses:
        *sets, outside, blind = coded
        path_sets = (frozenset(paths[number] for number in numbers) for numbers in sets)
        return Accesses(**dict(zip(_SETS, path_sets, strict=True)), outside=bool(outside), blind=bool(blind))

    configure, rest = (data[name] and decoded(data[name]) for name in ("configure", "rest"))
    edges = {name: decoded(each) for name, each in data["edges"].items()}
    answers = tuple((question, answer) for question, answer in data["answers"])
    missing, left = frozenset(data["missing"]), frozenset(data["left"])
    return ObservedCommands(configure or None, edges, missing, rest or None, answers, left)
