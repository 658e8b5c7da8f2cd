"""Type stubs (PEP 561) of generated modules, with the comments of definitions as docstrings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from collections.abc import Set as AbstractSet
from types import SimpleNamespace
from typing import Final

from forge.base.frozen import frozen
from forge.base.names import python_attribute
from forge.interfaces.model import (
    Array,
    Element,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    element_of,
)
from forge.interfaces.python.types import DTYPES, INTEGERS, numeric

BUILTINS: Final = frozenset(
    {"bool", "bytearray", "bytes", "float", "int", "list", "object", "property", "str"}
)
"""Builtins used in stubs; a field of such a name shadows one inside its class."""


@frozen
class StubNames:
    """The local names of classes and builtins in a stub."""

    classes: Mapping[TypeName, str]
    shadowed: AbstractSet[str]

    def builtin(self, name: str) -> str:
        """Return the local name of a builtin, which has a leading '_' if it is shadowed."""
        return f"_{name}" if name in self.shadowed else name

    def element(self, element: Element) -> str:
        """Return the type of a single value, or of an element of a collection."""
        match element:
            case Named(name):
                return self.classes[name]
            case String() | Primitive("char" | "wchar"):
                return self.builtin("str")
            case Primitive("boolean"):
                return self.builtin("bool")
            case Primitive("octet"):
                return self.builtin("bytes")
            case Primitive(name):
                return self.builtin("int" if name in INTEGERS else "float")

    def getter_type(self, type_: Type) -> str:
        element, number = self.element(element_of(type_)), numeric(type_)
        match type_:
            case Array() if number:
                return f"_NDArray[_numpy.{DTYPES[number]}]"
            case Sequence() if number:
                return f"_array[{element}]"
            case Array() | Sequence():
                return f"{self.builtin('list')}[{element}]"
            case _:
                return element

    def setter_type(self, type_: Type) -> str:
        read, element = self.getter_type(type_), self.element(element_of(type_))
        match type_:
            case Array() if numeric(type_):
                return f"{read} | _Sequence[{element}] | _Set[{element}]"
            case Array() | Sequence():
                return f"_Sequence[{element}] | _Set[{element}]"
            case Primitive("octet"):
                return f"{read} | {self.builtin('bytearray')}"
            case _:
                return read


def view_stub(message: Message, names: StubNames) -> SimpleNamespace:
    """Return the variables of a message class for the template of stubs."""
    fields = {field.name for field in message.fields}
    return SimpleNamespace(
        name=message.name.name,
        own="_self" if "self" in fields else "self",
        doc=docstring(message.doc or (f"Message class '{message.name.name}'.",)),
        constants=[
            (constant.name, names.getter_type(constant.type), docstring(constant.doc))
            for constant in message.constants
        ],
        fields=[
            SimpleNamespace(
                name=python_attribute(field.name),
                getter_type=names.getter_type(field.type),
                setter_type=names.setter_type(field.type),
                doc=docstring((*field.doc, *([f"[{field.unit}]"] if field.unit else []))),
                default=None if field.default is None else f"{field.name.upper()}__DEFAULT",
            )
            for field in message.fields
        ],
        # The type of the constructor's argument of this name, unless a field has it.
        # Not bool: an unpacked dict[str, float] could not be passed then.
        check_fields=None if "check_fields" in fields else names.builtin("object"),
    )


def stub_imports(messages: Collection[Message], shadowed: Iterable[str], *, aliases: bool) -> list[str]:
    """Return the import lines of a stub, the standard library's first.

    `aliases` is True if the module has a service or an action, whose messages are also class attributes.
    """
    fields = [field for message in messages for field in message.fields]
    types = [field.type for field in fields]
    lines = [f"from builtins import {name} as _{name}" for name in sorted(shadowed)]
    if any(isinstance(type_, Sequence) and numeric(type_) for type_ in types):
        lines.insert(0, "from array import array as _array")
    if any(isinstance(type_, Array | Sequence) for type_ in types):
        lines += [
            "from collections.abc import Sequence as _Sequence",
            "from collections.abc import Set as _Set",
        ]
    if any(message.constants for message in messages) or any(f.default is not None for f in fields):
        lines.append("from typing import Final as _Final")
    if aliases:
        lines.append("from typing import TypeAlias as _TypeAlias")
    if any(isinstance(type_, Array) and numeric(type_) for type_ in types):
        lines += ["", "import numpy as _numpy", "from numpy.typing import NDArray as _NDArray"]
    return lines


def docstring(lines: Iterable[str]) -> tuple[str, ...]:
    """Return the lines of a docstring, quoted and escaped. Blank lines become empty."""
    safe = [_safe(line) for line in lines]
    if not any(safe):
        return ()
    if len(safe) == 1:
        return (f'"""{safe[0]}"""',)
    return (f'"""{safe[0]}', *safe[1:], '"""')


def _safe(line: str) -> str:
    escaped = line.rstrip().replace("\\", "\\\\")
    if '"""' in escaped or escaped.endswith('"'):
        escaped = escaped.replace('"', '\\"')
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in escaped
    )
