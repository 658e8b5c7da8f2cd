"""Serialize and deserialize ROS 2 messages: classic CDR (XCDR1), as used by middlewares and in rosbag2 files.

    data = forge_cdr.serialize(message)
    message = forge_cdr.deserialize(data, PointCloud2)

Writes little-endian data and reads both byte orders. Bytes after the message and the options in the
header are ignored; invalid data raises CdrError, a subclass of ValueError.

`deserialize(data, type, copy=False)` leaves sequences of numbers of 4096 bytes and more in `data` until
the field is accessed; `data` must be immutable and stays alive. `view` returns such a field without a copy.

This package is part of forge's run time; rosidl has no counterpart.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from struct import error as _StructError
from typing import TYPE_CHECKING, Any, Final, TypeVar

from forge_cdr.errors import CdrError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["CdrError", "deserialize", "serialize", "view"]

_M = TypeVar("_M")
_LAZY: Final = 4095
"""Copying up to this many bytes is as fast as deferring the copy."""

_NO_LIMIT: Final = sys.maxsize
_REFUSALS: Final = (
    *(_StructError, BufferError, OverflowError, ValueError),
    *(AttributeError, LookupError, TypeError),
)
"""The errors of generated code for unexpected values or data."""


def serialize(message: object) -> bytes:
    """Return the serialized message, including the header.

    Raises CdrError if the value of a field cannot be serialized, such as more elements than its bound, and
    TypeError if it is not a message.
    """
    try:
        return _WRITERS[message.__class__](message)
    except _REFUSALS:
        return _serialize_exactly(message)


def deserialize(data: bytes | bytearray | memoryview, type: type[_M], copy: bool = True) -> _M:
    """Deserialize a message of a type.

    Never allocates more memory than the data can fill. Raises CdrError if the data is invalid, and TypeError
    if the type is not a message class, or if `copy` is False and the data is mutable.
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
    """Return a sequence of numbers without copying it; read-only if it is still in the data.

    Raises AttributeError if there is no such field, and TypeError if it is not a sequence of numbers.
    """
    from forge_cdr.lazy import postponed

    found = postponed(message, f"_{field}")
    return memoryview(getattr(message, field)) if found is None else found


_WRITERS: Final[dict[type, Callable[[Any], bytes]]] = {}
_READERS: Final[dict[type, Callable[[Any, int], Any]]] = {}
"""Cached generated functions by class; empty on machines that cannot use them."""


def _serialize_exactly(message: object) -> bytes:
    """Serialize a message of a new class, or one that generated code has rejected."""
    class_ = message.__class__
    if class_ not in _WRITERS and (made := _generated(class_, "writer")):
        _WRITERS[class_] = made
        return serialize(message)
    from forge_cdr import described

    return described.write(message)


def _deserialize_exactly(data: bytes | memoryview, class_: type, copy: bool) -> Any:
    """Deserialize a message of a new class, or one that generated code has rejected."""
    if class_ not in _READERS and (made := _generated(class_, "reader")):
        _READERS[class_] = made
        return deserialize(data, class_, copy)
    from forge_cdr import described

    return described.read(data, class_)


def _generated(class_: type, word: str) -> Callable[..., Any] | None:
    """Return the generated writer or reader of a class, if it exists."""
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
