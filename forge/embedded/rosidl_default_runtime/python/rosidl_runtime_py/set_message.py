"""Set the fields of messages from dictionaries, as on command lines or in YAML."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from rosidl_parser.definition import AbstractNestedType, BasicType, NamespacedType

from rosidl_runtime_py.convert import get_message_slot_types
from rosidl_runtime_py.import_message import import_message_from_namespaced_type

if TYPE_CHECKING:
    from collections.abc import Callable

_HEADER: Final = ("std_msgs.msg._header", "Header")
_TIME: Final = ("builtin_interfaces.msg._time", "Time")
_OCTET: Final = BasicType("octet")


def set_message_fields(
    msg: Any,
    values: Mapping[str, Any],
    expand_header_auto: bool = False,
    expand_time_now: bool = False,
) -> list[Callable[[Any], None]]:
    """Set the fields in `values`, converted to the types of the fields; others are unchanged.

    Returns a function for each time that is set later: the value 'auto' of a header (with
    `expand_header_auto`) or 'now' of a time (with `expand_time_now`); calling it with a time sets the field.
    Raises AttributeError for an unknown field, KeyError for a constant, TypeError if a dictionary is
    expected; exceptions of the fields propagate.
    """
    setting = _Setting(expand_header_auto, expand_time_now)
    setting.fill(msg, values)
    return setting.open_times


@dataclass(frozen=True)
class _Setting:
    """One call of `set_message_fields`."""

    headers: bool
    times: bool
    open_times: list[Callable[[Any], None]] = field(default_factory=list)

    def fill(self, msg: Any, values: Any) -> None:
        """Set the fields of one message."""
        if not isinstance(values, Mapping):
            kind = type(values).__name__
            raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {kind}")
        types = get_message_slot_types(msg)
        for name, value in values.items():
            now = getattr(msg, name)
            type_ = types[name]
            if not self._left_open(msg, name, value):
                setattr(msg, name, self._converted(now, value, type_))

    def _left_open(self, msg: Any, name: str, value: Any) -> bool:
        """Return True if the value stands for the time of sending, and store its field."""
        now = getattr(msg, name)
        class_ = (type(now).__module__, type(now).__name__)
        if self.headers and class_ == _HEADER and value == "auto":
            self.open_times.append(partial(setattr, now, "stamp"))
            return True
        if self.times and class_ == _TIME and value == "now":
            self.open_times.append(partial(setattr, msg, name))
            return True
        return False

    def _converted(self, now: Any, value: Any, type_: Any) -> Any:
        """Convert the value to the type of the current value of the field."""
        if isinstance(now, array):
            return array(now.typecode, value)
        if hasattr(now, "dtype"):
            return _like(now, value)
        if isinstance(type_, AbstractNestedType):
            return self._items(now, value, type_.value_type)
        return _octet(value) if type_ == _OCTET else self._single(now, value)

    def _single(self, now: Any, value: Any) -> Any:
        """Convert a single value: unchanged, through its type, or as a message with fields set."""
        if type(value) is type(now):
            return deepcopy(value)
        try:
            return type(now)(value)
        except TypeError:
            return self._message(type(now), value)

    def _items(self, now: Any, value: Any, element: Any) -> Any:
        """Convert a collection, with messages created from dictionaries."""
        if isinstance(element, NamespacedType):
            class_ = import_message_from_namespaced_type(element)
            return [self._message(class_, item) for item in value]
        if element == _OCTET and isinstance(value, Sequence) and not isinstance(value, str):
            return [_octet(item) for item in value]
        return deepcopy(value) if type(value) is type(now) else type(now)(value)

    def _message(self, class_: Any, values: Any) -> Any:
        fresh = class_()
        self.fill(fresh, values)
        return fresh


def _like(now: Any, value: Any) -> Any:
    """Return a numpy array of the same type, or a number if the field contains a numpy scalar."""
    import numpy as np

    return np.array(value, dtype=now.dtype) if now.shape else type(now)(value)


def _octet(value: Any) -> Any:
    """Return one byte for a number or a character in YAML, both of which rosidl rejects."""
    if isinstance(value, int):
        return bytes([value])
    return value.encode("latin-1") if isinstance(value, str) else bytes(value)
