"""ROS 2 messages to bytes and back: classic CDR (XCDR1), as on the wire and in rosbag2 files.

    data = forge_cdr.serialize(message)
    message = forge_cdr.deserialize(data, PointCloud2)

Little endian is written, both byte orders are read. What follows a message's last byte is ignored, as
are the options in the header; bytes that are no such message raise CdrError, which is a ValueError.

`deserialize(data, type, copy=False)` leaves sequences of numbers of 4096 bytes and more in `data`
until a field is looked at; that takes data nobody can change, and keeps it alive. `view` looks at such
a field without a copy.

forge brings this package along with its own run time; rosidl's has none of this name.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from struct import error as _StructError  # noqa: N812  (that is its name there)
from typing import TYPE_CHECKING, Any, Final, TypeVar

from forge_cdr.errors import CdrError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["CdrError", "deserialize", "serialize", "view"]

_M = TypeVar("_M")
_LAZY: Final = 4095
"""A copy of so many bytes costs no more than to put it off."""

_NO_LIMIT: Final = sys.maxsize
_REFUSALS: Final = (
    *(_StructError, BufferError, OverflowError, ValueError),
    *(AttributeError, LookupError, TypeError),
)
"""What the fast way fails with when it meets something else than it expects."""


def serialize(message: object) -> bytes:
    """Return a message's bytes, header included.

    Raises CdrError when a field holds what cannot be written, such as more elements than its bound
    allows; TypeError when this is no message.
    """
    try:
        return _WRITERS[message.__class__](message)
    except _REFUSALS:
        return _serialize_exactly(message)


def deserialize(data: bytes | bytearray | memoryview, type: type[_M], copy: bool = True) -> _M:  # noqa: A002, FBT001, FBT002  (the words of rclpy)
    """Return the message of a type that the data hold.

    Raises CdrError when they hold none, and never asks for more memory than the data can fill;
    TypeError when the type is no message class, or when `copy` is false and the data could change.
    """
    if data.__class__ is not bytes:
        data = memoryview(data).cast("B")
        if not copy and not data.readonly:
            raise TypeError("copy=False needs data that cannot change, such as bytes")
    try:
        return _READERS[type](data, _NO_LIMIT if copy else _LAZY)  # type: ignore[no-any-return]
    except _REFUSALS:
        return _deserialize_exactly(data, type, copy)  # type: ignore[no-any-return]


def view(message: object, field: str) -> memoryview:
    """Return a field with a sequence of numbers without copying it; read-only where it is still in the data.

    Raises AttributeError when there is no such field, TypeError when it holds no numbers.
    """
    from forge_cdr.lazy import postponed  # noqa: PLC0415  (few programs ask)

    found = postponed(message, f"_{field}")
    return memoryview(getattr(message, field)) if found is None else found


_WRITERS: Final[dict[type, Callable[[Any], bytes]]] = {}
_READERS: Final[dict[type, Callable[[Any, int], Any]]] = {}
"""What forge has generated for the classes that have been asked for so far, on machines that can use it."""


def _serialize_exactly(message: object) -> bytes:
    """Serialize a message of a new class, or one that generated code has refused."""
    class_ = message.__class__
    if class_ not in _WRITERS and (made := _generated(class_, "writer")):
        _WRITERS[class_] = made
        return serialize(message)
    from forge_cdr import described  # noqa: PLC0415  (only what is unusual needs it)

    return described.write(message)


def _deserialize_exactly(data: bytes | memoryview, class_: type, copy: bool) -> Any:  # noqa: ANN401, FBT001  (any message)
    """Deserialize a message of a new class, or one that generated code has refused."""
    if class_ not in _READERS and (made := _generated(class_, "reader")):
        _READERS[class_] = made
        return deserialize(data, class_, copy)
    from forge_cdr import described  # noqa: PLC0415  (as above)

    return described.read(data, class_)


def _generated(class_: type, word: str) -> Callable[..., Any] | None:
    """Return the writer or reader of a class, if there is a module with one beside that of the class."""
    module = f"{class_.__module__}__cdr"
    if sys.byteorder != "little" or class_.__module__ not in sys.modules or not _exists(module):
        return None
    make = getattr(import_module(module), f"{word}_{class_.__name__}", None)
    return make() if make else None


def _exists(module: str) -> bool:
    try:
        return module in sys.modules or find_spec(module) is not None
    except (ImportError, ValueError):
        return False  # there is no package around it
