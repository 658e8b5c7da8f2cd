"""Code shared by the C and C++ targets: paths of headers, included headers, type support handles."""

from __future__ import annotations

import re

from forge.base.frozen import frozen
from forge.base.names import snake_case
from forge.interfaces.model import Action, Interface, TypeName, messages_of, nested_types, services_of

_PART = re.compile(
    r"_(SendGoal|GetResult|((SendGoal|GetResult)_)?(Request|Response|Event)|Goal|Result|Feedback|FeedbackMessage)$"
)
"""The suffixes of the parts of services and actions."""


@frozen
class Handle:
    """A function that returns a type support handle."""

    kind: str
    name: TypeName

    @property
    def symbol(self) -> str:
        return symbol(self.name)

    @property
    def macro(self) -> str:
        """The macro of forge's run time that defines the function, without the prefix for the language."""
        name = self.name
        return f"{self.kind.upper()}_TYPE_SUPPORT({name.package}, {name.kind}, {name.name})"


def main_path(name: TypeName, ending: str) -> str:
    return f"{name.package}/{name.kind}/{snake_case(name.name)}.{ending}"


def detail_path(name: TypeName, part: str, ending: str) -> str:
    """Return the path of a detail header; parts of a service or an action are in its header."""
    stem = _PART.sub("", name.name) if name.kind in {"srv", "action"} else name.name
    return f"{name.package}/{name.kind}/detail/{snake_case(stem)}__{part}.{ending}"


def guard(path: str) -> str:
    return "__".join(path.replace(".", "_").upper().split("/")) + "_"


def symbol(name: TypeName) -> str:
    return f"{name.package}__{name.kind}__{name.name}"


def needed(interface: Interface) -> tuple[TypeName, ...]:
    """Return the message types of members that are defined in other headers, sorted."""
    messages = tuple(messages_of(interface))
    return tuple(sorted(nested_types(messages) - {message.name for message in messages}))


def handles(interface: Interface) -> list[Handle]:
    """Return the functions that return the type support of an interface and its derived types."""
    all_handles = [Handle("message", message.name) for message in messages_of(interface)]
    all_handles += [Handle("service", service.name) for service in services_of(interface)]
    if isinstance(interface, Action):
        all_handles.append(Handle("action", interface.name))
    return all_handles
