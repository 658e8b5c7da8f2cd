"""Messages as dictionaries, YAML and comma-separated values."""

from __future__ import annotations

import sys
from array import array
from collections import OrderedDict
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from itertools import dropwhile
from typing import TYPE_CHECKING, Any

from rosidl_parser.definition import (
    AbstractString,
    AbstractWString,
    Array,
    BasicType,
    BoundedSequence,
    NamespacedType,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType


def message_to_ordereddict(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> OrderedDict[str, Any]:
    """Return the fields of a message and of nested messages, with arrays as lists and bytes as text.

    `truncate_length` truncates strings and lists and appends '...'; `no_arr` and `no_str` replace collections
    and strings by their type and length.
    """
    return _Abridgement(truncate_length, no_arr, no_str).dictionary(msg)


def message_to_yaml(
    msg: Any,
    *,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
    flow_style: bool = False,
) -> str:
    """Return a message as YAML, with one field per line; `flow_style` writes each list on one line.

    The names of values of enumerations are comments. The other options are those of `message_to_ordereddict`.
    Raises ImportError without PyYAML.
    """
    fields = _Abridgement(truncate_length, no_arr, no_str, with_names=True).dictionary(msg)
    yaml = _yaml()

    class Dumper(yaml.Dumper):  # type: ignore[misc, name-defined]
        """A dumper that keeps the order of dictionaries, and writes comments after numbers."""

        def process_scalar(self) -> None:
            super().process_scalar()
            if isinstance(self.event.value, _Commented) and not self.flow_level:
                self.write_indicator(f" # {self.event.value.comment}", need_whitespace=True)

    Dumper.add_representer(
        OrderedDict,
        lambda dumper, data: yaml.nodes.MappingNode(
            "tag:yaml.org,2002:map",
            [(dumper.represent_data(key), dumper.represent_data(value)) for key, value in data.items()],
        ),
    )
    Dumper.add_multi_representer(
        IntEnum, lambda dumper, data: dumper.represent_scalar("tag:yaml.org,2002:int", _Commented(data))
    )
    text: str = yaml.dump(
        fields, Dumper=Dumper, allow_unicode=True, width=sys.maxsize, default_flow_style=flow_style
    )
    return text


def message_to_csv(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> str:
    """Return the values of a message and of nested messages, separated by commas, without quotes.

    The options are those of `message_to_ordereddict`.
    """
    return _joined(_Abridgement(truncate_length, no_arr, no_str).values(msg))


def get_message_slot_types(msg: Any) -> OrderedDict[str, Any]:
    """Return the entry of SLOT_TYPES for each field, in order."""
    if hasattr(msg, "get_fields_and_field_types"):
        names = list(msg.get_fields_and_field_types())
    else:  # a class written by hand, for which rosidl_runtime_py in Humble reads the slots
        names = [slot.removeprefix("_") for slot in msg.__slots__]
    return OrderedDict(zip(names, msg.SLOT_TYPES, strict=True))


def _convert_value(
    value: Any,
    *,
    field_type: Any = None,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
) -> Any:
    """Return a value as `message_to_ordereddict` does; tests of rosidl_runtime_py call it by this name."""
    return _Abridgement(truncate_length, no_arr, no_str).plain(value, field_type)


@dataclass(frozen=True)
class _Abridgement:
    """The options of conversions: which parts of long messages to omit."""

    length: int | None
    without_arrays: bool
    without_strings: bool
    with_names: bool = False
    """Whether values of enumerations are kept as members instead of numbers."""

    def dictionary(self, msg: Any) -> OrderedDict[str, Any]:
        """Return a message's fields."""
        types = get_message_slot_types(msg)
        fields = OrderedDict((name, self.plain(getattr(msg, name), type_)) for name, type_ in types.items())
        if self.with_names:
            for name, enumeration in getattr(msg, "_ENUMERATIONS", {}).items():
                with suppress(ValueError):
                    fields[name] = enumeration(fields[name])
        return fields

    def values(self, msg: Any) -> Iterator[str]:
        """Yield the text of each of a message's fields."""
        for name, type_ in get_message_slot_types(msg).items():
            yield self._text(getattr(msg, name), type_)

    def plain(self, value: Any, type_: Any = None) -> Any:
        """Return a value as dictionaries, lists, numbers and text."""
        if hasattr(value, "dtype"):  # numpy's arrays and numbers
            value = value.tolist()
        if isinstance(value, bytes | bytearray):
            return self._cut(value.decode("latin-1"))
        if isinstance(value, str):
            return self._string(value)
        if isinstance(value, bool | int | float):
            return int(value) if isinstance(value, IntEnum) else value
        if isinstance(value, list | tuple | array):
            return self._collection(value, type_)
        if isinstance(value, dict):  # keys are not truncated: two could become equal
            return {key: self.plain(item) for key, item in value.items()}
        return self.dictionary(value)

    def _collection(self, value: Any, type_: Any) -> Any:
        """Return a list, or a tuple for a tuple, or the placeholder."""
        if self.without_arrays and type_ is not None:
            return _outline(value, type_)
        kept = [self.plain(item) for item in value[: self.length]]
        listed = kept + ["..."] * (len(kept) < len(value))
        return tuple(listed) if isinstance(value, tuple) else listed

    def _text(self, value: Any, type_: Any = None) -> str:
        """Return a value as comma-separated text."""
        if hasattr(value, "dtype"):
            value = value.tolist()
        if isinstance(value, bytes):
            return str(value if self._fits(value) else value[: self.length] + b"...")
        if isinstance(value, str):
            return self._string(value)
        if isinstance(value, bool | int | float):
            return str(value)
        if isinstance(value, list | tuple | array):
            if self.without_arrays and type_ is not None:
                return _outline(value, type_)
            kept = [self._text(item) for item in value[: self.length]]
            return _joined(kept + ["..."] * (len(kept) < len(value)))
        return _joined(self.values(value))

    def _string(self, value: str) -> str:
        return f"<string length: <{len(value)}>>" if self.without_strings else self._cut(value)

    def _cut(self, value: str) -> str:
        return value if self._fits(value) else f"{value[: self.length]}..."

    def _fits(self, value: str | bytes) -> bool:
        return self.length is None or len(value) <= self.length


class _Commented(str):
    """The text of a number, and the name of its value."""

    __slots__ = ("comment",)
    comment: str

    def __new__(cls, value: IntEnum) -> _Commented:
        """Return the text of a member."""
        text = super().__new__(cls, int(value))
        text.comment = value.name
        return text


def _joined(parts: Any) -> str:
    """Join with commas; as in rosidl, empty parts at the start are ignored."""
    return ",".join(dropwhile(lambda part: not part, parts))


def _outline(value: Any, type_: Any) -> str:
    """Return the placeholder for an omitted collection."""
    name = _type_name(type_.value_type)
    if isinstance(type_, Array):
        return f"<array type: {name}[{type_.size}]>"
    if isinstance(type_, BoundedSequence):
        return f"<sequence type: {name}[{type_.maximum_size}], length: {len(value)}>"
    return f"<sequence type: {name}, length: {len(value)}>"


def _type_name(type_: Any) -> str:
    match type_:
        case BasicType():
            return str(type_.typename)
        case AbstractString():
            return "string"
        case AbstractWString():
            return "wstring"
        case NamespacedType():
            return "/".join(type_.namespaced_name())
        case _:
            return str(type_.name)


def _yaml() -> ModuleType:
    """Import PyYAML; raises ImportError with installation instructions."""
    try:
        import yaml
    except ImportError as error:
        message = f"messages as YAML need PyYAML: '{sys.executable} -m pip install PyYAML'"
        raise ImportError(message, name="yaml") from error
    return yaml
