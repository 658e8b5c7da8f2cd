"""Messages as plain classes, the way code generators usually write them: a checking property per field.

The constructor hands every field to its property, whether given or not; nothing is cut short. It is what
generated classes are measured against.
"""

import math
from array import array
from collections import UserList, UserString
from collections.abc import Iterator, Mapping
from collections.abc import Sequence as AbstractSequence
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np

from forge.interfaces.model import (
    Array,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    Type,
    TypeName,
    element_of,
)
from forge.interfaces.python.types import DTYPES, INTEGERS, TYPE_CODES, literal, numeric, zero

_HIGHEST = {"float": 3.402823466e38, "double": 1.7976931348623157e308}
_CLASS = """\
class {name}:
    __slots__ = [{slots}]

    def __init__(self, **kwargs):
        assert all('_' + key in self.__slots__ for key in kwargs), (
            'unknown: ' + ', '.join(sorted(key for key in kwargs if '_' + key not in self.__slots__)))
{assignments}
"""
_PROPERTY = """\
    @property
    def {field}(self):
        return self._{field}

    @{field}.setter
    def {field}(self, value):
{checks}
        self._{field} = {stored}
"""


def plain_class(message: Message, known: Mapping[TypeName, Message]) -> Any:
    """Return the class of a message, with those of the messages in it."""
    names: dict[str, Any] = {
        "Sequence": AbstractSequence,
        "Set": AbstractSet,
        "UserList": UserList,
        "UserString": UserString,
        "array": array,
        "math": math,
        "np": np,
    }
    for name in _inner(message):
        names[_word(name)] = plain_class(known[name], known)
    exec(_text(message), names)
    return names[message.name.name]


def _inner(message: Message) -> set[TypeName]:
    elements = (element_of(field.type) for field in message.fields)
    return {element.name for element in elements if isinstance(element, Named)}


def _word(name: TypeName) -> str:
    return f"{name.package}_{name.name}"


def _text(message: Message) -> str:
    start = _CLASS.format(
        name=message.name.name,
        slots=", ".join(f"'_{field.name}'" for field in message.fields),
        assignments="\n".join(line for field in message.fields for line in _assignment(field)),
    )
    return "\n".join([start, *map(_property, message.fields)])


def _assignment(field: Field) -> Iterator[str]:
    number, name = numeric(field.type), field.name
    if number and isinstance(field.type, Array) and field.default is None:
        yield f"        if '{name}' not in kwargs:"
        yield f"            self.{name} = np.zeros({field.type.size}, dtype=np.{DTYPES[number]})"
        yield "        else:"
        yield f"            self.{name} = np.array(kwargs.get('{name}'), dtype=np.{DTYPES[number]})"
        yield f"            assert self.{name}.shape == ({field.type.size},)"
    elif number and field.default is None:
        yield f"        self.{name} = array('{TYPE_CODES[number]}', kwargs.get('{name}', []))"
    else:
        yield f"        self.{name} = kwargs.get('{name}', {_default(field)})"


def _default(field: Field) -> str:
    if field.default is not None:
        return literal(field.type, field.default)
    match field.type:
        case Named(name):
            return f"{_word(name)}()"
        case Array(Named(name), size):
            return f"[{_word(name)}() for _ in range({size})]"
        case Array(of, size):
            return f"[{zero(of)}] * {size}"
        case Sequence():
            return "[]"
        case single:
            return zero(single)


def _property(field: Field) -> str:
    number = numeric(field.type)
    lines, stored = ["        if __debug__:", *(f"            {line}" for line in _checks(field))], "value"
    if number:
        fixed = isinstance(field.type, Array)
        stored = f"np.array(value, np.{DTYPES[number]})" if fixed else f"array('{TYPE_CODES[number]}', value)"
        lines = [*_shortcut(field, number), *lines]
    return _PROPERTY.format(field=field.name, checks="\n".join(lines), stored=stored)


def _shortcut(field: Field, number: str) -> Iterator[str]:
    if isinstance(field.type, Array):
        yield "        if isinstance(value, np.ndarray):"
        yield f"            assert value.dtype == np.{DTYPES[number]}, '{field.name}: wrong dtype'"
        yield f"            assert value.size == {field.type.size}, '{field.name}: wrong size'"
    else:
        yield "        if isinstance(value, array):"
        yield f"            assert value.typecode == '{TYPE_CODES[number]}', '{field.name}: wrong type code'"
    yield f"            self._{field.name} = value"
    yield "            return"


def _checks(field: Field) -> Iterator[str]:
    type_, element = field.type, element_of(field.type)
    python = _word(element.name) if isinstance(element, Named) else _python(element)
    if type_ is element:
        yield f"assert isinstance(value, {python}), '{field.name}: wrong type'"
        if limits := _limits(element, "value"):
            yield f"assert {limits}, '{field.name}: out of range'"
        return
    yield "assert isinstance(value, Sequence | Set | UserList), 'no collection'"
    yield "assert not isinstance(value, str | UserString), 'no collection'"
    if isinstance(type_, Array):
        yield f"assert len(value) == {type_.size}, '{field.name}: wrong length'"
    yield f"assert all(isinstance(v, {python}) for v in value), '{field.name}: wrong type'"
    if limits := _limits(element, "v"):
        yield f"assert all({limits} for v in value), '{field.name}: out of range'"


def _python(element: Type) -> str:
    match element:
        case Primitive("boolean"):
            return "bool"
        case Primitive("octet"):
            return "bytes"
        case Primitive(name):
            return "int" if name in INTEGERS else "float"
        case _:
            return "str"


def _limits(element: Type, word: str) -> str | None:
    match element:
        case Primitive(name) if name in INTEGERS:
            low, high = INTEGERS[name]
            return f"{low} <= {word} <= {high}"
        case Primitive(name) if name in _HIGHEST:
            return f"(not ({word} < -{_HIGHEST[name]} or {word} > {_HIGHEST[name]}) or math.isinf({word}))"
        case _:
            return None
