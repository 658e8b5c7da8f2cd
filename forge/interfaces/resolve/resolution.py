"""Every type that a package refers to, found; its names, free of clashes; its messages, free of cycles."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

from forge.base.errors import InterfaceError, Place, Problem, raise_if_any
from forge.base.names import did_you_mean, snake_case
from forge.interfaces.model import Action, Catalog, Message, Named, TypeName, element_of, messages_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.interfaces.model import Field, Interface, Source
    from forge.interfaces.read.parsing import Parsed

ACTION_DEPENDENCIES = (
    TypeName("action_msgs", "srv", "CancelGoal"),
    TypeName("action_msgs", "msg", "GoalInfo"),
    TypeName("action_msgs", "msg", "GoalStatusArray"),
)
"""The interfaces that the code of an action refers to in addition to the members of its messages."""


MAX_NESTING = 100
"""The maximum nesting of messages: importing one imports all nested ones."""

_MANY = 20
"""The maximum number of problems of one kind that are reported, or explained, for a package."""


class DefinitionLookup(Protocol):
    """The interfaces of other packages, parsed on demand."""

    def find(self, name: TypeName) -> Parsed | None:
        """Return the interface of that name, or None; raises InterfaceError when its file is wrong."""

    def names(self) -> Iterable[TypeName]:
        """Return all names there are, for hints."""


def resolve(
    package: str, parsed: Iterable[Parsed], known: DefinitionLookup, unlisted: Mapping[str, str] | None = None
) -> Catalog:
    """Return the catalog of a package's parsed files; `known` is asked only for what they refer to.

    `unlisted` are types of the package that have a file which is not among these, with that file, for hints.
    Raises InterfaceError: unknown types, cycles, two files for one name or for one generated file.
    """
    unique, problems = _unique(parsed)
    own = {message.name: message for p in unique.values() for message in messages_of(p.interface)}
    search = _Search(package, own, known, set(unique), unlisted or {})
    for message in own.values():
        search.follow(message)
    messages = {**own, **search.found}
    problems += search.problems
    problems += _cycles(messages)
    raise_if_any(problems, InterfaceError)
    interfaces = {name: unique[name].interface for name in sorted(unique)}
    sources = {name: unique[name].source for name in interfaces} | search.sources
    return Catalog(package, interfaces, messages, sources)


def undeclared_dependencies(catalog: Catalog, declared: Iterable[str]) -> list[Problem]:
    """Return a problem for each field of a type from a package that is none of `declared`.

    Such a type is found, but code that refers to it need not compile: its package may not be built.
    """
    accepted = {catalog.package, *declared}
    return [
        Problem(
            f"'{catalog.package}' does not depend on '{name.package}'",
            member.place,
            f"add {name.package} to the DEPENDENCIES of rosidl_generate_interfaces, "
            f"and <depend>{name.package}</depend> to package.xml",
        )
        for interface in catalog.interfaces.values()
        for member, name in _references(interface)
        if member.place and name.package not in accepted
    ]


def dependency_catalogs(
    catalog: Catalog, known: DefinitionLookup, also: Iterable[TypeName] = ()
) -> tuple[Catalog, ...]:
    """Return what generated code of a catalog needs of other packages, as a part of each one's catalog.

    `also` names further interfaces to include. Raises InterfaceError when one is not there.
    """
    waiting = [name for name in catalog.known if name.package != catalog.package]
    waiting += [name for name in also if name.package != catalog.package]
    if any(isinstance(interface, Action) for interface in catalog.interfaces.values()):
        waiting += [name for name in ACTION_DEPENDENCIES if name.package != catalog.package]
    found: dict[TypeName, Parsed] = {}
    while waiting:
        name = waiting.pop()
        if name not in found:
            found[name] = require(name, known)
            waiting += [reference for _, reference in _references(found[name].interface)]
    return _partial_catalogs(found)


def nested_messages(parsed: Parsed, known: DefinitionLookup) -> dict[TypeName, Message]:
    """Return every message that one installed interface refers to, however deep.

    Raises InterfaceError when one is not there or contains itself.
    """
    own = {message.name: message for message in messages_of(parsed.interface)}
    search = _Search("", own, known, set())
    for message in own.values():
        search.follow(message)
    messages = {**own, **search.found}
    raise_if_any([*search.problems, *_cycles(messages)], InterfaceError)
    return messages


def nesting_problems(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem if messages are nested too deeply for code that includes other code."""
    below = {
        name: {e.name for member in message.fields if isinstance(e := element_of(member.type), Named)}
        for name, message in messages.items()
    }
    depth: dict[TypeName, int] = {}
    for name in TopologicalSorter(below).static_order():
        depth[name] = 1 + max((depth[inner] for inner in below.get(name, ())), default=0)
        if depth[name] > MAX_NESTING:
            message = f"messages in '{name}' are nested more than {MAX_NESTING} levels deep"
            place = next((member.place for member in messages[name].fields), None)
            hint = "reduce the nesting: Python could not import such a message, nor a compiler include it"
            return [Problem(message, place, hint)]
    return []


def require(name: TypeName, known: DefinitionLookup) -> Parsed:
    """Return an interface; raises InterfaceError if it does not exist."""
    parsed = known.find(name)
    if not parsed:
        hint = f"add <depend>{name.package}</depend> to package.xml"
        raise InterfaceError(Problem(f"cannot find '{name}', which generated code requires", hint=hint))
    return parsed


def _references(interface: Interface) -> Iterator[tuple[Field, TypeName]]:
    """Yield each member that holds a message of another file, and which."""
    messages = tuple(messages_of(interface))
    own = {message.name for message in messages}
    for message in messages:
        for member in message.fields:
            element = element_of(member.type)
            if isinstance(element, Named) and element.name not in own:
                yield member, element.name


def _partial_catalogs(found: Mapping[TypeName, Parsed]) -> tuple[Catalog, ...]:
    messages = {message.name: message for p in found.values() for message in messages_of(p.interface)}
    packages: dict[str, list[TypeName]] = defaultdict(list)
    for name in sorted(found):
        packages[name.package].append(name)
    return tuple(
        Catalog(
            package,
            {name: found[name].interface for name in names},
            messages,
            {name: found[name].source for name in names},
        )
        for package, names in packages.items()
    )


def _unique(parsed: Iterable[Parsed]) -> tuple[dict[TypeName, Parsed], list[Problem]]:
    """Return the files by name, and the problems of conflicting ones."""
    unique: dict[TypeName, Parsed] = {}
    outputs: dict[tuple[str, str], Parsed] = {}
    problems = []
    for each in parsed:
        name = each.interface.name
        rival = unique.setdefault(name, each)
        if rival is not each:
            message = f"'{name}' is also defined in '{rival.source.path}'"
            problems.append(Problem(message, Place(each.source.path)))
            continue
        output = snake_case(name.name)
        rival = outputs.setdefault((name.kind, output), each)
        if rival is not each:
            names = f"'{name.name}' and '{rival.interface.name.name}'"
            message = f"{names} would both be generated into '{output}'"
            hint = "rename one of them: the names of generated files are in lower case"
            problems.append(Problem(message, Place(each.source.path), hint))
    return unique, problems


@dataclass(slots=True)
class _Search:
    """Follows references from message to message; each is looked up once."""

    package: str
    own: Mapping[TypeName, Message]
    known: DefinitionLookup
    interfaces: set[TypeName]
    unlisted: Mapping[str, str] = field(default_factory=dict)
    found: dict[TypeName, Message] = field(default_factory=dict)
    sources: dict[TypeName, Source] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    _broken: set[TypeName] = field(default_factory=set)

    def follow(self, start: Message) -> None:
        """Find what a message refers to, however deep."""
        waiting = [start]
        while waiting:
            for member in waiting.pop().fields:
                element = element_of(member.type)
                if not isinstance(element, Named) or element.name in self.own or element.name in self.found:
                    continue
                message = self._look_up(element.name)
                if message:
                    waiting.append(message)
                elif element.name not in self._broken:
                    self.problems.append(self._unknown(start, member, element.name))

    def _look_up(self, name: TypeName) -> Message | None:
        """Return a message of another package; a file that cannot be read is reported once."""
        if name in self._broken or name.package == self.package:
            return None
        try:
            parsed = self.known.find(name)
        except InterfaceError as error:
            self._broken.add(name)
            self.problems += error.problems
            return None
        if parsed is None or not isinstance(parsed.interface, Message):
            return None
        self.sources[name] = parsed.source
        self.found[name] = parsed.interface
        return parsed.interface

    def _unknown(self, start: Message, member: Field, name: TypeName) -> Problem:
        if member.place is None:
            # Only derived members have no place: those of a missing type are all reported by the first.
            self._broken.add(name)
            action = str(start.name).rpartition("/")[2].partition("_")[0]
            message = f"cannot find '{name}', which the action '{action}' requires"
            return Problem(message, hint=f"add <depend>{name.package}</depend> to package.xml")
        written = f"{name.package}/{name.name}"
        if name.package == self.package and name.name in self.unlisted:
            hint = f'add "{self.unlisted[name.name]}" to rosidl_generate_interfaces() in CMakeLists.txt'
            return Problem(f"unknown type '{written}'", member.place, hint)
        if len(self.problems) >= _MANY:
            return Problem(f"unknown type '{written}'", member.place)
        names = [*self.interfaces, *(n for n in self.known.names() if n.package != self.package)]
        candidates = {f"{n.package}/{n.name}": n for n in names if n.kind not in {"srv", "action"}}
        return Problem(f"unknown type '{written}'", member.place, _hint(name, self.package, candidates))


def _hint(name: TypeName, own: str, candidates: Mapping[str, TypeName]) -> str | None:
    """Return the nearest type, of whatever package, and what makes it available."""
    written = f"{name.package}/{name.name}"
    namesakes = sorted(text for text, candidate in candidates.items() if candidate.name == name.name)
    best = did_you_mean(written, namesakes) or did_you_mean(written, candidates)
    if not best and namesakes:
        best = f"did you mean '{namesakes[0]}'?"
    packages = {candidate.package for candidate in candidates.values()}
    suggested = best.split("'")[1].partition("/")[0] if best else name.package
    missing = f"add <depend>{suggested}</depend> to package.xml" if suggested != own else None
    if best:
        return f"{best} {missing}" if missing and suggested != name.package else best
    return None if name.package in packages else missing


def _cycles(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem for each cycle of messages that contain each other."""
    needs: dict[TypeName, dict[TypeName, Field]] = defaultdict(dict)
    for name, message in messages.items():
        for member in message.fields:
            element = element_of(member.type)
            if isinstance(element, Named) and element.name in messages:
                needs[name].setdefault(element.name, member)
    problems: list[Problem] = []
    while len(problems) < _MANY and (cycle := _cycle(needs)):
        path = " -> ".join(f"{name.package}/{name.name}" for name in cycle)
        place = needs[cycle[0]][cycle[1]].place
        problems.append(Problem(f"a message cannot contain itself: {path}", place))
        for container, contained in pairwise(cycle):
            del needs[container][contained]
    return problems


def _cycle(needs: Mapping[TypeName, Mapping[TypeName, Field]]) -> list[TypeName] | None:
    """Return some cycle, its first member repeated at its end."""
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        # graphlib follows the edges in the opposite direction of 'contains'.
        return list(reversed(error.args[1]))
    return None
