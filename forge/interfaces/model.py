"""The data model of interface definitions, frozen and valid once resolved.

Type names follow IDL ('boolean', 'octet', 'float', 'double'), as rosidl's generators do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from forge.base.errors import Location
from forge.base.frozen import frozen

HIDDEN_MEMBER = "structure_needs_at_least_one_member"

SECTIONS = {"msg": ("",), "srv": ("_Request", "_Response"), "action": ("_Goal", "_Result", "_Feedback")}
"""The kinds of definition files, and the name suffix of each of their sections."""

Value = bool | int | float | str | tuple["bool | int | float | str", ...]
"""A literal: numbers, text, or a tuple of them for arrays and sequences. An octet is an int."""


@dataclass(frozen=True, slots=True, order=True)
class TypeName:
    """The full name of an interface, such as std_msgs/msg/Header."""

    package: str
    kind: str
    name: str

    def __str__(self) -> str:
        return f"{self.package}/{self.kind}/{self.name}"


@frozen
class Primitive:
    """A basic type by its IDL name: boolean, octet, char, wchar, int8 ... uint64, float, double."""

    name: str


@frozen
class String:
    """A string (UTF-8) or wstring (UTF-16), with an upper bound or None."""

    wide: bool = False
    bound: int | None = None


@frozen
class Named:
    """A message type, by name."""

    name: TypeName


Element = Primitive | String | Named


@frozen
class Array:
    """An array of `size` elements."""

    of: Element
    size: int


@frozen
class Sequence:
    """A sequence of at most `bound` elements; None means unbounded."""

    of: Element
    bound: int | None = None


Type = Element | Array | Sequence


@frozen
class Field:
    """A member of a message. `doc` contains lines of text; `unit` is as in the comment 'speed [m/s]'."""

    name: str
    type: Type
    default: Value | None = None
    doc: tuple[str, ...] = ()
    unit: str | None = None
    place: Location | None = field(default=None, compare=False)


@frozen
class Constant:
    """A named value of a primitive or unbounded string type."""

    name: str
    type: Primitive | String
    value: Value
    doc: tuple[str, ...] = ()
    place: Location | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Message:
    """A structure. `fields` are defined in the file, `members` are serialized."""

    name: TypeName
    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()
    doc: tuple[str, ...] = ()

    @cached_property
    def members(self) -> tuple[Field, ...]:
        """The fields, or one hidden uint8 if there are none, because C has no empty structs."""
        return self.fields or (Field(HIDDEN_MEMBER, Primitive("uint8")),)


@dataclass(frozen=True)
class Service:
    """A request and a response. Without `has_events`, the event is only part of the type hash."""

    name: TypeName
    request: Message
    response: Message
    has_events: bool = field(default=False, kw_only=True)
    """Whether the event is a message like the others, as in Iron and later."""

    @cached_property
    def event(self) -> Message:
        info = Named(TypeName("service_msgs", "msg", "ServiceEventInfo"))
        return Message(
            _suffixed(self.name, "Event"),
            (
                Field("info", info),
                Field("request", Sequence(Named(self.request.name), 1)),
                Field("response", Sequence(Named(self.response.name), 1)),
            ),
        )


@dataclass(frozen=True)
class Action:
    """A goal, a result and a feedback, and the types that ROS derives from them."""

    name: TypeName
    goal: Message
    result: Message
    feedback: Message
    has_events: bool = field(default=False, kw_only=True)
    """Whether the services of the action have events."""

    @cached_property
    def send_goal(self) -> Service:
        request = (_GOAL_ID, Field("goal", Named(self.goal.name)))
        return self._service("SendGoal", request, (Field("accepted", Primitive("boolean")), _STAMP))

    @cached_property
    def get_result(self) -> Service:
        response = (Field("status", Primitive("int8")), Field("result", Named(self.result.name)))
        return self._service("GetResult", (_GOAL_ID,), response)

    @cached_property
    def feedback_message(self) -> Message:
        fields = (_GOAL_ID, Field("feedback", Named(self.feedback.name)))
        return Message(_suffixed(self.name, "FeedbackMessage"), fields)

    def _service(self, suffix: str, request: tuple[Field, ...], response: tuple[Field, ...]) -> Service:
        name = _suffixed(self.name, suffix)
        request_message = Message(_suffixed(name, "Request"), request)
        response_message = Message(_suffixed(name, "Response"), response)
        return Service(name, request_message, response_message, has_events=self.has_events)


Interface = Message | Service | Action


@dataclass(frozen=True)
class Source:
    """An interface file: `relative` is a path such as 'msg/Pose.msg', `text` its contents."""

    package: str
    relative: str
    path: Path
    text: str


@dataclass(frozen=True)
class Catalog:
    """All interfaces of one package, resolved, in the order of their names.

    `known` contains all messages that these refer to, directly or transitively, including other packages'.
    `sources` maps each interface to its file, including those of other packages.
    """

    package: str
    interfaces: Mapping[TypeName, Interface]
    known: Mapping[TypeName, Message]
    sources: Mapping[TypeName, Source]
    has_descriptions: bool = False
    """Whether the ROS distribution has type hashes and descriptions in generated code."""


@frozen
class File:
    """A generated file; `path` is relative to the output folder and uses '/'."""

    path: str
    text: str


def messages_of(interface: Interface) -> Iterator[Message]:
    """Yield all messages of an interface, including derived ones, each after those that it contains."""
    match interface:
        case Message():
            yield interface
        case Service():
            yield from (interface.request, interface.response)
            if interface.has_events:
                yield interface.event
        case Action():
            yield from (interface.goal, interface.result, interface.feedback)
            yield from messages_of(interface.send_goal)
            yield from messages_of(interface.get_result)
            yield interface.feedback_message


def with_events(interface: Interface) -> Interface:
    """Return an interface whose services have events as messages."""
    return interface if isinstance(interface, Message) else replace(interface, has_events=True)


def interface_of(name: TypeName, sections: Iterable[Message]) -> Interface:
    """Return the interface with one section (a message), two (a service) or three (an action)."""
    match list(sections):
        case [message]:
            return message
        case [request, response]:
            return Service(name, request, response)
        case parts:
            return Action(name, *parts)


def sections_of(interface: Interface) -> tuple[Message, ...]:
    """Return the messages defined in the interface's file, without derived ones."""
    match interface:
        case Message():
            return (interface,)
        case Service():
            return interface.request, interface.response
        case Action():
            return interface.goal, interface.result, interface.feedback


def services_of(interface: Interface) -> tuple[Service, ...]:
    """Return the service itself, or the services of an action."""
    if isinstance(interface, Action):
        return interface.send_goal, interface.get_result
    return (interface,) if isinstance(interface, Service) else ()


def element_of(type_: Type) -> Element:
    """Return the type itself, or that of its elements."""
    return type_.of if isinstance(type_, Array | Sequence) else type_


def references_of(message: Message) -> Iterator[tuple[Field, TypeName]]:
    """Yield the fields whose type contains a message, and the type of that message."""
    for member in message.fields:
        element = element_of(member.type)
        if isinstance(element, Named):
            yield member, element.name


def nested_types(messages: Iterable[Message]) -> set[TypeName]:
    """Return the message types of all fields."""
    return {name for message in messages for _, name in references_of(message)}


_GOAL_ID = Field("goal_id", Named(TypeName("unique_identifier_msgs", "msg", "UUID")))
_STAMP = Field("stamp", Named(TypeName("builtin_interfaces", "msg", "Time")))


def _suffixed(name: TypeName, suffix: str) -> TypeName:
    return TypeName(name.package, name.kind, f"{name.name}_{suffix}")
