"""Sequences of numbers that stay where they were received until somebody looks at them.

A message with such sequences is of a hidden class derived from its own: the slots hold where the
numbers are, and looking at one makes the array. Once all are made, the message is of its own class
again; `__class__` says so all along. Messages without such sequences pay nothing.
"""

# ruff: noqa: ANN401  (messages of any class)

from __future__ import annotations

from array import array
from functools import cache
from typing import Any, Final, NamedTuple

from rosidl_parser.definition import AbstractSequence, BasicType

_CLASS: Final = object.__dict__["__class__"]


class Postponed(NamedTuple):
    """What a slot holds until its array is made."""

    view: memoryview
    code: Any


def postpone(message: Any, slot: str, view: memoryview, code: str) -> None:
    """Leave the numbers of a slot in a buffer that will not change."""
    setattr(message, slot, Postponed(view, code))
    if not isinstance(message, _Lazy):
        message.__class__ = _lazy_class(message.__class__)


def postponed(message: Any, slot: str) -> memoryview | None:
    """Return the numbers of a slot that nobody has looked at or set yet, where they are, or None."""
    if not isinstance(message, _Lazy):
        return None
    held = vars(message.__class__)[slot].__get__(message)
    return held.view.cast(held.code) if isinstance(held, Postponed) else None


class _Lazy:
    """What hidden classes are derived from."""

    __slots__ = ()

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Copy and pickle the message as one of its own class."""
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
    """Tell if a field is a sequence of primitives, of numbers or not."""
    return isinstance(type_, AbstractSequence) and isinstance(type_.value_type, BasicType)


def _property(member: Any, members: dict[str, Any]) -> property:
    """Return what stands before a slot: it makes the array when the slot is read."""

    def read(message: Any) -> Any:
        held = member.__get__(message)
        if isinstance(held, Postponed):
            made = array(held.code)
            made.frombytes(held.view)
            # Another thread may have been faster, but then both have made the same.
            store(message, made)
            return made
        return held

    def store(message: Any, value: Any) -> None:
        member.__set__(message, value)
        if not any(isinstance(_held(other, message), Postponed) for other in members.values()):
            _CLASS.__set__(message, message.__class__)

    return property(read, store)


def _held(member: Any, message: Any) -> Any:
    """Return what a slot holds; a message that is being read has empty ones."""
    try:
        return member.__get__(message)
    except AttributeError:
        return None
