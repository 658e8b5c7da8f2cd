"""Resolve the definitions of a package: look up all types, and report name conflicts and cycles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import Protocol

from forge.base.errors import InterfaceError, Location, Problem, raise_if_any
from forge.base.names import nearest, snake_case
from forge.interfaces.model import (
    Action,
    Catalog,
    Field,
    Interface,
    Message,
    Source,
    TypeName,
    messages_of,
    nested_types,
    references_of,
    with_events,
)
from forge.interfaces.read.parsing import Parsed

MAX_EXPLAINED = 20
"""The maximum number of unknown types with a suggestion, which is expensive to compute."""


def resolve(
    package: str,
    parsed: Iterable[Parsed],
    known: DefinitionLookup,
    undeclared_types: Mapping[str, str] | None = None,
    *,
    events: bool = False,
) -> Catalog:
    """Return the catalog of the parsed files of a package; `known` is only asked for referenced types.

    `undeclared_types` maps further types of the package to their files, which are not part of `parsed`, for
    hints. With `events`, services have a message for the events of service introspection, and generated code
    describes its types: both came with the same ROS distribution.
    Raises InterfaceError for unknown types, cycles, and two files with the same name or generated file.
    """
    if events:
        parsed = [replace(each, interface=with_events(each.interface)) for each in parsed]
    unique: dict[TypeName, Parsed] = {}
    outputs: dict[tuple[str, str], Parsed] = {}
    problems = []
    for each in parsed:
        name = each.interface.name
        other = unique.setdefault(name, each)
        if other is not each:
            message = f"'{name}' is also defined in '{other.source.path}'"
            problems.append(Problem(message, Location(each.source.path)))
            continue
        other = outputs.setdefault((name.kind, snake_case(name.name)), each)
        if other is not each:
            problems.append(same_output(name, other.interface.name, each.source.path))
    own = {message.name: message for p in unique.values() for message in messages_of(p.interface)}
    search = _Search(package, own, known, set(unique), undeclared_types or {})
    for start in own.values():
        search.follow(start)
    messages = {**own, **search.found}
    problems += search.problems
    problems += cycle_problems(messages)
    raise_if_any(problems, InterfaceError)
    interfaces = {name: unique[name].interface for name in sorted(unique)}
    sources = {name: unique[name].source for name in interfaces} | search.sources
    return Catalog(package, interfaces, messages, sources, has_descriptions=events)


def nested_messages(parsed: Parsed, known: DefinitionLookup) -> dict[TypeName, Message]:
    """Return the messages of an interface and all messages nested in them.

    Raises InterfaceError if one does not exist or contains itself.
    """
    return dict(resolve("", [parsed], known).known)


def same_output(name: TypeName, other: TypeName, path: Path) -> Problem:
    """Return the problem of two interfaces of a package whose generated files have one name."""
    message = f"'{name.name}' and '{other.name}' would both be generated into '{snake_case(name.name)}'"
    hint = "rename one of them: the names of generated files are in lower case"
    return Problem(message, Location(path), hint)


@dataclass(slots=True)
class _Search:
    """Looks up referenced messages recursively, each of them once."""

    package: str
    own: Mapping[TypeName, Message]
    known: DefinitionLookup
    interfaces: set[TypeName]
    undeclared_types: Mapping[str, str]
    found: dict[TypeName, Message] = field(default_factory=dict)
    sources: dict[TypeName, Source] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    _broken: set[TypeName] = field(default_factory=set)

    def follow(self, start: Message) -> None:
        waiting = [start]
        while waiting:
            for member, name in references_of(waiting.pop()):
                if name in self.own or name in self.found or name in self._broken:
                    continue
                try:
                    parsed = None if name.package == self.package else self.known.find(name)
                except InterfaceError as error:
                    self._broken.add(name)
                    self.problems += error.problems
                    continue
                if parsed and isinstance(parsed.interface, Message):
                    self.sources[name] = parsed.source
                    self.found[name] = parsed.interface
                    waiting.append(parsed.interface)
                else:
                    self.problems.append(self._unknown(start, member, name))

    def _unknown(self, start: Message, member: Field, name: TypeName) -> Problem:
        if member.place is None:
            # Only derived members have no location; a missing type is reported once.
            self._broken.add(name)
            kind = "service" if start.name.kind == "srv" else "action"
            owner = start.name.name.partition("_")[0]
            message = f"cannot find '{name}', which the {kind} '{owner}' requires"
            return Problem(message, hint=f"add <depend>{name.package}</depend> to package.xml")
        written = f"{name.package}/{name.name}"
        if name.package == self.package and name.name in self.undeclared_types:
            file = self.undeclared_types[name.name]
            hint = f'add "{file}" to rosidl_generate_interfaces() in CMakeLists.txt'
            return Problem(f"unknown type '{written}'", member.place, hint)
        if len(self.problems) >= MAX_EXPLAINED:
            return Problem(f"unknown type '{written}'", member.place)
        if elsewhere := self.known.distribution_hint(name):
            return Problem(f"unknown type '{written}'", member.place, elsewhere)
        names = [*self.interfaces, *(n for n in self.known.names() if n.package != self.package)]
        candidates = {f"{n.package}/{n.name}": n for n in names if n.kind not in {"srv", "action"}}
        own = start.name.package
        near = self._nearest(own, name, candidates)
        package = near.partition("/")[0] if near else name.package
        declared = {own, name.package} if near else {each.package for each in candidates.values()}
        missing = package not in declared and not self.known.declares(package)
        hints = [f"did you mean '{near}'?"] if near else []
        hints += [f"add <depend>{package}</depend> to package.xml"] if missing else []
        return Problem(f"unknown type '{written}'", member.place, " ".join(hints) or None)

    def _nearest(self, package: str, name: TypeName, candidates: Mapping[str, TypeName]) -> str | None:
        """Return the type that was probably meant in a package; types of declared packages are preferred."""
        written = f"{name.package}/{name.name}"
        if name.package == package and name.name == "Header":
            return "std_msgs/Header"  # as in ROS 1, where it needs no package name
        namesakes = sorted(
            (text for text, candidate in candidates.items() if candidate.name == name.name),
            key=lambda text: (not self.known.declares(candidates[text].package), text),
        )
        first = namesakes[0] if namesakes else None
        if name.package == package:  # most often written without its package
            # The common package name would make any two names similar.
            own = {each.name: text for text, each in candidates.items() if each.package == name.package}
            return first or own.get(nearest(name.name, own) or "") or nearest(name.name, candidates)
        return nearest(written, namesakes) or nearest(written, candidates) or first


MAX_NESTING = 100
"""The maximum nesting of messages; importing a message imports all nested ones recursively."""

_MAX_REPORTED = 20
"""The maximum number of cycles that are reported for a package."""


def nesting_problems(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem if messages are nested too deeply for generated code."""
    below = {name: nested_types([message]) for name, message in messages.items()}
    depth: dict[TypeName, int] = {}
    for name in TopologicalSorter(below).static_order():
        depth[name] = 1 + max((depth[inner] for inner in below.get(name, ())), default=0)
        if depth[name] > MAX_NESTING:
            message = f"messages in '{name}' are nested more than {MAX_NESTING} levels deep"
            place = next((member.place for member in messages[name].fields), None)
            hint = "reduce the nesting: Python could not import such a message, nor a compiler include it"
            return [Problem(message, place, hint)]
    return []


def cycle_problems(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem for each cycle of nested messages."""
    needs = {
        name: {inner: member for member, inner in [*references_of(message)][::-1] if inner in messages}
        for name, message in messages.items()
    }
    problems: list[Problem] = []
    while len(problems) < _MAX_REPORTED:
        try:
            TopologicalSorter(needs).prepare()
        except CycleError as error:
            # graphlib follows the edges in the opposite direction of 'contains'.
            cycle: list[TypeName] = error.args[1][::-1]
        else:
            break
        path = " -> ".join(f"{name.package}/{name.name}" for name in cycle)
        place = needs[cycle[0]][cycle[1]].place
        problems.append(Problem(f"a message cannot contain itself: {path}", place))
        for container, contained in pairwise(cycle):
            del needs[container][contained]
    return problems


ACTION_DEPENDENCIES = (
    TypeName("action_msgs", "srv", "CancelGoal"),
    TypeName("action_msgs", "msg", "GoalInfo"),
    TypeName("action_msgs", "msg", "GoalStatusArray"),
)
"""The interfaces that the code of every action refers to, in addition to the types of its members."""


class DefinitionLookup(Protocol):
    """The interfaces of other packages, parsed on demand."""

    def find(self, name: TypeName) -> Parsed | None:
        """Return the interface of that name, or None; raises InterfaceError if its file is invalid."""

    def names(self) -> Iterable[TypeName]:
        """Return all available names, for hints."""

    def distribution_hint(self, name: TypeName) -> str | None:
        """Return which other ROS distributions have the interface, None if there are none."""

    def declares(self, package: str) -> bool:
        """Return whether the manifest beside the definitions declares the package, for hints."""


def undeclared_dependencies(
    catalog: Catalog, listed: Iterable[str], known: DefinitionLookup
) -> list[Problem]:
    """Return a problem for each field with a type from a package that is not `listed`.

    Such a type may be found, but generated code may not compile, because its package may not be built yet.
    """
    accepted = {catalog.package, *listed}
    problems = []
    for member, name in (pair for each in catalog.interfaces.values() for pair in _references(each)):
        if member.place and name.package not in accepted:
            hint = f"add {name.package} to the DEPENDENCIES of rosidl_generate_interfaces()"
            if not known.declares(name.package):
                hint += f", and <depend>{name.package}</depend> to package.xml"
            message = f"'{catalog.package}' does not depend on '{name.package}'"
            problems.append(Problem(message, member.place, hint))
    return problems


def dependency_catalogs(
    catalog: Catalog, known: DefinitionLookup, also: Iterable[TypeName] = ()
) -> tuple[Catalog, ...]:
    """Return the interfaces of other packages that generated code needs, as one catalog per package.

    `also` are further interfaces to include. Raises InterfaceError if one does not exist.
    """
    waiting = [name for name in catalog.known if name.package != catalog.package]
    waiting += [name for name in also if name.package != catalog.package]
    if any(isinstance(interface, Action) for interface in catalog.interfaces.values()):
        waiting += [name for name in ACTION_DEPENDENCIES if name.package != catalog.package]
    references: dict[TypeName, Parsed] = {}
    while waiting:
        name = waiting.pop()
        if name not in references:
            references[name] = require(name, known)
            waiting += [reference for _, reference in _references(references[name].interface)]
    messages = {message.name: message for p in references.values() for message in messages_of(p.interface)}
    packages: dict[str, dict[TypeName, Parsed]] = defaultdict(dict)
    for name in sorted(references):
        packages[name.package][name] = references[name]
    return tuple(
        Catalog(
            package,
            {name: each.interface for name, each in parsed.items()},
            messages,
            {name: each.source for name, each in parsed.items()},
            catalog.has_descriptions,
        )
        for package, parsed in packages.items()
    )


def require(name: TypeName, known: DefinitionLookup) -> Parsed:
    """Return an interface; raises InterfaceError if it does not exist."""
    parsed = known.find(name)
    if not parsed:
        hint = f"add <depend>{name.package}</depend> to package.xml"
        raise InterfaceError(Problem(f"cannot find '{name}', which generated code requires", hint=hint))
    return parsed


def _references(interface: Interface) -> Iterator[tuple[Field, TypeName]]:
    messages = tuple(messages_of(interface))
    own = {message.name for message in messages}
    for message in messages:
        yield from (pair for pair in references_of(message) if pair[1] not in own)
