"""The types of other packages that a catalog refers to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Protocol

from forge.base.errors import InterfaceError, Problem
from forge.interfaces.model import Action, Catalog, Field, Interface, Named, TypeName, element_of, messages_of
from forge.interfaces.read.parsing import Parsed

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
        """Tell whether the manifest beside the definitions declares the package, for hints."""


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
    packages: dict[str, list[TypeName]] = defaultdict(list)
    for name in sorted(references):
        packages[name.package].append(name)
    return tuple(
        Catalog(
            package,
            {name: references[name].interface for name in names},
            messages,
            {name: references[name].source for name in names},
            catalog.has_descriptions,
        )
        for package, names in packages.items()
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
        for member in message.fields:
            element = element_of(member.type)
            if isinstance(element, Named) and element.name not in own:
                yield member, element.name
