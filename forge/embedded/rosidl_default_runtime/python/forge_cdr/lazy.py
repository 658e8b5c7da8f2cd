"""Sequences of numbers that stay in the received data until first access.

A message with such sequences has a hidden class derived from its own: the slots contain the positions of the
numbers, and the first access creates the array. Once all are created, the message has its own class again,
which `__class__` always reports. Messages without such sequences have no overhead.
"""

from __future__ import annotations

from array import array
from functools import cache
from typing import Any, Final, NamedTuple

from rosidl_parser.definition import AbstractSequence, BasicType

_CLASS: Final = object.__dict__["__class__"]


class Postponed(NamedTuple):
    """The value of a slot until its array is created."""

    view: memoryview
    code: Any


def postpone(message: Any, slot: str, view: memoryview, code: str) -> None:
    """Defer the creation of an array; its numbers stay in an immutable buffer."""
    setattr(message, slot, Postponed(view, code))
    if not isinstance(message, _Lazy):
        message.__class__ = _lazy_class(message.__class__)


def postponed(message: Any, slot: str) -> memoryview | None:
    """Return the deferred numbers of a slot inside the data, or None if the slot was accessed or set."""
    if not isinstance(message, _Lazy):
        return None
    held = vars(message.__class__)[slot].__get__(message)
    return held.view.cast(held.code) if isinstance(held, Postponed) else None


class _Lazy:
    """The base class of hidden classes."""

    __slots__ = ()

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Copy and pickle the message as an instance of its public class."""
        slots: tuple[str, ...] = self.__class__.__slots__
        for slot in slots:
            getattr(self, slot)
        return self.__reduce_ex__(protocol)


@cache
def _lazy_class(class_: Any) -> Any:
    """Return the hidden class of a message class."""
    types: dict[str, Any] = dict(zip(class_.__slots__, class_.SLOT_TYPES, strict=True))
    members = {slot: vars(class_)[slot] for slot, type_ in types.items() if _may_wait(type_)}
    names: dict[str, Any] = {slot: _property(member, members) for slot, member in members.items()}
    names |= {"__slots__": (), "__module__": class_.__module__, "__class__": property(lambda _: class_)}
    made = type(class_)(class_.__name__, (_Lazy, class_), names)
    made.__slots__ = class_.__slots__
    return made


def _may_wait(type_: Any) -> bool:
    """Return True if a field is a sequence of primitives."""
    return isinstance(type_, AbstractSequence) and isinstance(type_.value_type, BasicType)


def _property(member: Any, members: dict[str, Any]) -> property:
    """Return the property for a slot, which creates the array on first access."""

    def read(message: Any) -> Any:
        held = member.__get__(message)
        if isinstance(held, Postponed):
            made = array(held.code)
            made.frombytes(held.view)
            # Another thread may have been faster; both create the same array.
            store(message, made)
            return made
        return held

    def store(message: Any, value: Any) -> None:
        member.__set__(message, value)
        if not any(isinstance(_held(other, message), Postponed) for other in members.values()):
            _CLASS.__set__(message, message.__class__)

    return property(read, store)


def _held(member: Any, message: Any) -> Any:
    """Return the value of a slot; a message that is being read has empty slots."""
    try:
        return member.__get__(message)
    except AttributeError:
        return None
