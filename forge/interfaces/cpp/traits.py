"""The traits header of an interface: conversion to YAML, and the specializations of rosidl's traits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.cpp.text import qualified
from forge.interfaces.model import (
    Action,
    Array,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    element_of,
    messages_of,
    services_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.interfaces.model import Field, Interface, Type, TypeName

_OCTETS = frozenset({"octet", "char"})


@frozen
class YamlView:
    """The function that writes a message as YAML, member by member."""

    name: str
    writer: str
    argument: str
    statements: tuple[str, ...]


@frozen
class Identity:
    """Both names of a type, and the base classes of the traits for fixed and bounded size."""

    data_type: str
    name: str
    fixed: str
    bounded: str


@frozen
class TypeTraits:
    """The specializations for a type; an action has only `traits`."""

    name: str
    traits: tuple[str, ...]
    identity: Identity | None = None


def yaml_view(message: Message) -> YamlView:
    """Return the function that writes a message; it is empty for an empty message."""
    statements = tuple(map(_statement, message.fields))
    named = bool(statements)
    return YamlView(message.name.name, " _out" if named else "", " _message" if named else "", statements)


def type_traits(interface: Interface) -> Iterator[TypeTraits]:
    """Yield the traits of all types in the header of an interface, parts before the whole."""
    roles: dict[TypeName, str] = {}
    for service in services_of(interface):
        roles |= {service.request.name: "is_service_request", service.response.name: "is_service_response"}
    if isinstance(interface, Action):
        parts = {"goal": interface.goal, "result": interface.result, "feedback": interface.feedback}
        roles |= {message.name: f"is_action_{part}" for part, message in parts.items()}
    for message in messages_of(interface):
        types = [field.type for field in message.members]
        fixed = _base("has_fixed_size", types, own=all(map(_is_fixed, types)))
        bounded = _base("has_bounded_size", types, own=all(map(_is_bounded, types)))
        role = (roles[message.name],) if message.name in roles else ()
        yield _identified(message.name, fixed, bounded, ("is_message", *role))
    for service in services_of(interface):
        halves = [Named(service.request.name), Named(service.response.name)]
        fixed, bounded = (_base(trait, halves, own=True) for trait in ("has_fixed_size", "has_bounded_size"))
        yield _identified(service.name, fixed, bounded, ("is_service",))
    if isinstance(interface, Action):
        yield TypeTraits(qualified(interface.name), ("is_action",))


def _identified(name: TypeName, fixed: str, bounded: str, traits: tuple[str, ...]) -> TypeTraits:
    spelled = qualified(name)
    return TypeTraits(spelled, traits, Identity(spelled.removeprefix("::"), str(name), fixed, bounded))


def _base(trait: str, types: Iterable[Type], *, own: bool) -> str:
    """Return the base class of a trait: false if `own` is, else it depends on the types of members."""
    if not own:
        return "std::false_type"
    names = sorted({of.name for of in map(element_of, types) if isinstance(of, Named)})
    if not names:
        return "std::true_type"
    parts = " &&\n    ".join(f"{trait}<{qualified(name)}>::value" for name in names)
    return f"std::integral_constant<bool,\n    {parts}>"


def _is_fixed(type_: Type) -> bool:
    return not isinstance(type_, Sequence) and not isinstance(element_of(type_), String)


def _is_bounded(type_: Type) -> bool:
    if isinstance(type_, Sequence) and type_.bound is None:
        return False
    of = element_of(type_)
    return not (isinstance(of, String) and of.bound is None)


def _statement(field: Field) -> str:
    many = "s" if isinstance(field.type, Array | Sequence) else ""
    match element_of(field.type):
        case Named():
            kind = "message"
        case Primitive(name) if name in _OCTETS:
            kind = "octet"
        case _:
            kind = "scalar"
    return f'_out.{kind}{many}("{field.name}", _message.{field.name});'
