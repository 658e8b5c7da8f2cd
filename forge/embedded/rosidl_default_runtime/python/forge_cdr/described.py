"""Serialization based on the description in a class: slow, exact, on any machine and in both byte orders.

Generated code handles the common cases and rejects others without a reason. This module supports all values
and reports errors with their location. It needs only `__slots__` and `SLOT_TYPES`, so it also works with
the classes of rosidl.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections import UserString
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from rosidl_parser import definition

from forge_cdr import pieces
from forge_cdr.errors import CdrError

if TYPE_CHECKING:
    from collections.abc import Iterator

_HEADER_SIZE: Final = 4
_ORDERS: Final = {b"\0\0": ">", b"\0\1": "<"}
_HOST: Final = "<" if sys.byteorder == "little" else ">"
_NUMBERS: Final = {
    **dict(zip(("int8", "int16", "int32", "int64"), "bhiq", strict=True)),
    **dict(zip(("uint8", "uint16", "uint32", "uint64"), "BHIQ", strict=True)),
    "float": "f",
    "double": "d",
}
_CODES: Final = {**_NUMBERS, "boolean": "?", "octet": "c", "char": "B", "wchar": "I"}
_HIGHEST: Final = {"char": 0x7F, "wchar": 0xFFFF}
_FAILURES: Final = (struct.error, TypeError, ValueError, AttributeError, OverflowError)


def write(message: Any) -> bytes:
    """Return the serialized message, in little endian; raises CdrError, or TypeError for other objects."""
    writer = _Writer()
    writer.message(message, described_class(type(message)))
    return bytes(writer.out)


def read(data: bytes | memoryview, class_: type) -> Any:
    """Return the message in the data, in either byte order; raises CdrError or TypeError as `write` does."""
    described = described_class(class_)
    order = _ORDERS.get(bytes(data[:2]))
    if len(data) < _HEADER_SIZE:
        raise CdrError(f"{len(data)} bytes are too few for a header of {_HEADER_SIZE}")
    if order is None:
        raise CdrError(f"the header '{bytes(data[:2]).hex()}' is not that of classic CDR, '0000' or '0001'")
    return _Reader(memoryview(data), order).message(described, class_)


def described_class(class_: type) -> Any:
    """Return the generated class: this one, or its base class; raises TypeError."""
    for base in class_.__mro__:
        if "SLOT_TYPES" in vars(base) and "__slots__" in vars(base):
            return base
    raise TypeError(f"'{class_.__name__}' is not a message class")


def _fields(class_: Any) -> Iterator[tuple[str, Any]]:
    """Yield each field's slot and its type; rosidl has one more slot in some releases."""
    return zip(class_.__slots__, class_.SLOT_TYPES, strict=False)


def _class_of(owner: type, type_: Any) -> Any:
    """Return the class of a field; the parts of an action are only in its module."""
    # Classes created at run time are in a separate package: root.package.kind._module.
    root = owner.__module__.split(".")[:-3]
    namespace = ".".join((*root, *type_.namespaces))
    found: Any = getattr(sys.modules[owner.__module__], type_.name, None)
    if found is None or found.__module__.rpartition(".")[0] != namespace:
        found = getattr(import_module(namespace), type_.name)
    return found


class _Walk:
    """The position of a reader or writer: the field and the offset."""

    def __init__(self) -> None:
        self.path: list[str] = []

    @property
    def offset(self) -> int:
        """The number of bytes so far, including the header."""
        raise NotImplementedError

    def wrong(self, problem: str) -> CdrError:
        """Return an error about the current field."""
        path = "".join(self.path).lstrip(".")
        return CdrError(f"'{path}' {problem}" if path else f"the message {problem}", self.offset)

    def checked(self, text: str, type_: Any) -> str:
        """Return the text, unless it has more characters than the bound of its type."""
        bound = getattr(type_, "maximum_size", None)
        if bound is not None and len(text) > bound:
            raise self.wrong(f"has {len(text)} characters, {bound} are allowed")
        return text

    @contextmanager
    def at(self, step: str) -> Iterator[None]:
        """Enter a field or an element; errors inside refer to it."""
        self.path.append(step)
        try:
            yield
        except CdrError:
            raise
        except _FAILURES as error:
            raise self.wrong(f"does not fit: {error}") from error
        self.path.pop()


class _Writer(_Walk):
    """Writes to a growing buffer."""

    def __init__(self) -> None:
        super().__init__()
        self.out = bytearray(pieces.HEADER_BYTES)

    @property
    def offset(self) -> int:
        return len(self.out)

    def message(self, value: Any, class_: Any) -> None:
        """Add a message's members."""
        if not isinstance(value, class_):
            raise self.wrong(f"is of type '{type(value).__name__}', not '{class_.__name__}'")
        fields = list(_fields(class_))
        for slot, type_ in fields:
            with self.at(f".{slot[1:]}"):
                self.value(getattr(value, slot), type_, class_)
        if not fields:
            self.out.append(0)

    def value(self, value: Any, type_: Any, owner: type) -> None:
        """Add one field's value, or that of an element."""
        match type_:
            case definition.BasicType():
                self.basic(value, type_.typename)
            case definition.AbstractString():
                text = self.checked(self.text(value), type_).encode() + b"\0"
                self.add("I", len(text))
                self.out += text
            case definition.AbstractWString():
                units = self.checked(self.text(value), type_).encode("utf-16-le")
                self.add("I", len(units) // 2)
                self.out += struct.pack(f"<{len(units) // 2}I", *memoryview(units).cast("H"))
            case definition.NamespacedType():
                self.message(value, _class_of(owner, type_))
            case _:
                self.collection(value, type_, owner)

    def text(self, value: Any) -> str:
        """Return the value of a string field as a str."""
        if not isinstance(value, str | UserString):
            raise self.wrong(f"is of type '{type(value).__name__}', not 'str'")
        return str(value)

    def collection(self, value: Any, type_: Any, owner: type) -> None:
        """Add an array or a sequence."""
        if isinstance(type_, definition.Array):
            size = getattr(value, "size", None) or len(value)
            if size != type_.size:
                raise self.wrong(f"has {size} elements, not {type_.size}")
        else:
            size, bound = len(value), getattr(type_, "maximum_size", None)
            if bound is not None and size > bound:
                raise self.wrong(f"has {size} elements, {bound} are allowed")
            self.add("I", size)
        of = type_.value_type
        if isinstance(of, definition.BasicType) and of.typename in _NUMBERS:
            self.numbers(value, _NUMBERS[of.typename])
            return
        for index, item in enumerate(value):
            with self.at(f"[{index}]"):
                self.value(item, of, owner)

    def numbers(self, values: Any, code: str) -> None:
        """Add numbers from any collection."""
        made = array(code, values.ravel() if hasattr(values, "ravel") else values)
        if made:
            self.align(made.itemsize)
        if _HOST == ">":
            made.byteswap()
        self.out += made.tobytes()

    def basic(self, value: Any, name: str) -> None:
        """Add one primitive."""
        if name == "octet":
            value = bytes(value)
        elif name in _HIGHEST:
            value = ord(self.text(value))
            if value > _HIGHEST[name]:
                raise self.wrong(f"is the character {value}, the highest is {_HIGHEST[name]}")
        self.add(_CODES[name], value)

    def add(self, code: str, value: Any) -> None:
        """Add a value after its padding."""
        packed = struct.pack(f"<{code}", value)
        self.align(len(packed))
        self.out += packed

    def align(self, size: int) -> None:
        """Add the padding before a value."""
        self.out += bytes(-(len(self.out) - _HEADER_SIZE) % size)


class _Reader(_Walk):
    """Reads from a buffer."""

    def __init__(self, data: memoryview, order: str) -> None:
        super().__init__()
        self.data = data
        self.order = order
        self.position = _HEADER_SIZE

    @property
    def offset(self) -> int:
        return self.position

    def message(self, described: Any, class_: type) -> Any:
        """Read a message's members into a new object of the class."""
        made: Any = object.__new__(class_)
        fields = list(_fields(described))
        for slot, type_ in fields:
            with self.at(f".{slot[1:]}"):
                setattr(made, slot, self.value(type_, described))
        if not fields:
            self.take(1)
        return made

    def value(self, type_: Any, owner: type) -> Any:
        """Read one field's value, or that of an element."""
        match type_:
            case definition.BasicType():
                return self.basic(type_.typename)
            case definition.AbstractString():
                text = self.take(self.number("I"))
                return self.checked(str(text[:-1] if len(text) and not text[-1] else text, "utf-8"), type_)
            case definition.AbstractWString():
                size = self.number("I")
                units = struct.unpack(f"{self.order}{size}I", self.take(4 * size))
                return self.checked(array("H", units).tobytes().decode("utf-16"), type_)
            case definition.NamespacedType():
                class_ = _class_of(owner, type_)
                return self.message(class_, class_)
            case _:
                return self.collection(type_, owner)

    def collection(self, type_: Any, owner: type) -> Any:
        """Read an array or a sequence."""
        is_array = isinstance(type_, definition.Array)
        size = type_.size if is_array else self.size(type_)
        of = type_.value_type
        if isinstance(of, definition.BasicType) and of.typename in _NUMBERS:
            made = self.numbers(_NUMBERS[of.typename], size)
            return _to_numpy(made) if is_array else made
        items = []
        for index in range(size):
            with self.at(f"[{index}]"):
                items.append(self.value(of, owner))
        return items

    def size(self, type_: Any) -> int:
        """Read the length of a sequence; each element has at least one byte."""
        size, bound = self.number("I"), getattr(type_, "maximum_size", None)
        if bound is not None and size > bound:
            raise self.wrong(f"has {size} elements, {bound} are allowed")
        if size > len(self.data) - self.position:
            left = len(self.data) - self.position
            raise self.wrong(f"has {size} elements, more than the {left} bytes that are left")
        return int(size)

    def numbers(self, code: str, size: int) -> array[Any]:
        """Read adjacent numbers."""
        made: array[Any] = array(code)
        if size:
            self.align(made.itemsize)
            made.frombytes(self.take(size * made.itemsize))
        if self.order != _HOST:
            made.byteswap()
        return made

    def basic(self, name: str) -> Any:
        """Read one primitive."""
        value = self.number(_CODES[name])
        if name not in _HIGHEST:
            return value
        if value > _HIGHEST[name]:
            raise self.wrong(f"is the character {value}, the highest is {_HIGHEST[name]}")
        return chr(value)

    def number(self, code: str) -> Any:
        """Read a value after its padding."""
        size = struct.calcsize(f"<{code}")
        self.align(size)
        return struct.unpack(f"{self.order}{code}", self.take(size))[0]

    def align(self, size: int) -> None:
        """Skip the padding before a value."""
        self.position += -(self.position - _HEADER_SIZE) % size

    def take(self, size: int) -> memoryview:
        """Return the next bytes."""
        left = max(0, len(self.data) - self.position)
        if size > left:
            raise self.wrong(f"needs {size} bytes, {left} are left")
        self.position += size
        return self.data[self.position - size : self.position]


def _to_numpy(values: array[Any]) -> Any:
    import numpy as np

    return np.array(values)
