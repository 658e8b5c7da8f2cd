"""Type stubs (PEP 561) beside the generated Python: what fields hold and take, with the author's comments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String, element_of
from forge.interfaces.python.types import DTYPES, INTEGERS, numeric

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from collections.abc import Set as AbstractSet

    from forge.interfaces.model import Constant, Element, Field, Message, Type, TypeName

BUILTINS: Final = frozenset({"bool", "bytearray", "bytes", "float", "int", "list", "property", "str"})
"""Builtins that stubs speak of; a field of such a name hides it inside its class."""


@frozen
class StubNames:
    """How a module's stub names classes and builtins."""

    classes: Mapping[TypeName, str]
    hidden: AbstractSet[str]

    def word(self, builtin: str) -> str:
        """Return the name of a builtin, which may have a second one."""
        return f"_{builtin}" if builtin in self.hidden else builtin

    def element(self, element: Element) -> str:
        """Return the type of a single value, or of what a collection holds."""
        match element:
            case Named(name):
                return self.classes[name]
            case String() | Primitive("char" | "wchar"):
                return self.word("str")
            case Primitive("boolean"):
                return self.word("bool")
            case Primitive("octet"):
                return self.word("bytes")
            case Primitive(name):
                return self.word("int" if name in INTEGERS else "float")

    def held(self, type_: Type) -> str:
        """Return the type of what a field gives."""
        element, number = self.element(element_of(type_)), numeric(type_)
        match type_:
            case Array() if number:
                return f"_NDArray[_numpy.{DTYPES[number]}]"
            case Sequence() if number:
                return f"_array[{element}]"
            case Array() | Sequence():
                return f"{self.word('list')}[{element}]"
            case _:
                return element

    def taken(self, type_: Type) -> str:
        """Return the type of what a field accepts."""
        held, element = self.held(type_), self.element(element_of(type_))
        match type_:
            case Array() if numeric(type_):
                return f"{held} | _Sequence[{element}] | _Set[{element}]"
            case Array() | Sequence():
                return f"_Sequence[{element}] | _Set[{element}]"
            case Primitive("octet"):
                return f"{held} | {self.word('bytearray')}"
            case _:
                return held


@frozen
class MemberStub:
    """A field or a constant as the template shows it."""

    name: str
    held: str
    taken: str
    doc: tuple[str, ...]
    default: str | None


@frozen
class MessageStub:
    """A message class as the template shows it."""

    name: str
    own: str
    doc: tuple[str, ...]
    constants: tuple[MemberStub, ...]
    fields: tuple[MemberStub, ...]


def view_stub(message: Message, language: StubNames) -> MessageStub:
    """Return the texts of a message's stub."""
    names = {field.name for field in message.fields}
    return MessageStub(
        name=message.name.name,
        own="_self" if "self" in names else "self",
        doc=docstring(message.doc or (f"Message class '{message.name.name}'.",)),
        constants=tuple(_constant(constant, language) for constant in message.constants),
        fields=tuple(_field(field, language) for field in message.fields),
    )


def shadowed_builtins(messages: Iterable[Message]) -> frozenset[str]:
    """Return the builtins that the fields of a module's messages hide."""
    return BUILTINS & {field.name for message in messages for field in message.fields}


def stub_imports(messages: Collection[Message], hidden: Iterable[str], *, aliases: bool) -> list[str]:
    """Return the import lines of a module's stub, the standard library's first.

    `aliases` says that the module has a service or an action, which give messages second names.
    """
    fields = [field for message in messages for field in message.fields]
    types = [field.type for field in fields]
    lines = [f"from builtins import {word} as _{word}" for word in sorted(hidden)]
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
    """Return the lines of a docstring with its quotes; whatever they say, they stay inside.

    A line of nothing but blanks becomes an empty one, as in hand-written code.
    """
    safe = [_safe(line) for line in lines]
    if not any(safe):
        return ()
    if len(safe) == 1:
        return (f'"""{safe[0]}"""',)
    return (f'"""{safe[0]}', *safe[1:], '"""')


def _safe(line: str) -> str:
    """Return a line in which no backslash, quote or control character ends or bends the string around it."""
    escaped = line.rstrip().replace("\\", "\\\\")
    if '"""' in escaped or escaped.endswith('"'):
        escaped = escaped.replace('"', '\\"')
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in escaped
    )


def _constant(constant: Constant, language: StubNames) -> MemberStub:
    held = language.held(constant.type)
    return MemberStub(constant.name, held, held, docstring(constant.doc), None)


def _field(field: Field, language: StubNames) -> MemberStub:
    unit = (f"[{field.unit}]",) if field.unit else ()
    return MemberStub(
        name=field.name,
        held=language.held(field.type),
        taken=language.taken(field.type),
        doc=docstring((*field.doc, *unit)),
        default=None if field.default is None else f"{field.name.upper()}__DEFAULT",
    )
