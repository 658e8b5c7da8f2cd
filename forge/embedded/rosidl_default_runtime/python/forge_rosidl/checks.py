"""Checks of field values: each function returns the value to store, or fails like rosidl's setters.

The checks are assertions, so `python -O` disables them, but not the conversions.
"""

# ruff: noqa: PT018  (users assign anything; one message for one check; see above)

from __future__ import annotations

from array import array
from collections import UserList, UserString
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from math import inf, isinf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


class Number(NamedTuple):
    """A numeric type: how Python and an array store it, and its range."""

    python: type
    code: str
    low: int | float
    high: int | float
    range: str

    def admits(self, value: Any) -> bool:
        """Return True if a value of the right Python type is in range; nan and infinities are in range."""
        return not (value < self.low or value > self.high) or (self.python is float and isinf(value))

    def admits_all(self, values: Any) -> bool:
        """Return True if all values are in range, without checking each one if possible."""
        if self.code == "d" or not values:
            return True
        if self.python is int:
            return bool(self.low <= min(values) and max(values) <= self.high)
        return all(map(self.admits, values))


def _signed(code: str, bits: int) -> Number:
    low, high = -(2 ** (bits - 1)), 2 ** (bits - 1) - 1
    return Number(int, code, low, high, f"integer in [{low}, {high}]")


def _unsigned(code: str, bits: int) -> Number:
    return Number(int, code, 0, 2**bits - 1, f"unsigned integer in [0, {2**bits - 1}]")


def _floating(code: str, high: float, shown: str) -> Number:
    return Number(float, code, -high, high, f"float in [-{shown}, {shown}]")


NUMBERS: Final = {
    "int8": _signed("b", 8),
    "uint8": _unsigned("B", 8),
    "int16": _signed("h", 16),
    "uint16": _unsigned("H", 16),
    "int32": _signed("i", 32),
    "uint32": _unsigned("I", 32),
    "int64": _signed("q", 64),
    "uint64": _unsigned("Q", 64),
    "float": _floating("f", 3.4028234663852886e38, "3.402823466e+38"),
    "double": _floating("d", 1.7976931348623157e308, "1.7976931348623157e+308"),
}


def refuse(unknown: Mapping[str, object]) -> None:
    """Fail because of unknown arguments of a constructor.

    `check_fields`, which enables the checks in rosidl since Iron, is accepted: here they are always enabled.
    """
    names = sorted(unknown.keys() - {"check_fields"})
    assert not names, f"Invalid arguments passed to constructor: {', '.join(names)}"


def boolean(name: str, value: Any) -> Any:
    """Accept True and False."""
    assert isinstance(value, bool), f"The '{name}' field must be of type 'bool'"
    return value


def number(name: str, value: Any, type_name: str) -> Any:
    """Accept an int or a float in the range of the IDL type."""
    kind = NUMBERS[type_name]
    assert isinstance(value, kind.python), f"The '{name}' field must be of type '{kind.python.__name__}'"
    article = "an" if kind.python is int else "a"
    assert kind.admits(value), f"The '{name}' field must be {article} {kind.range}"
    return value


def octet(name: str, value: Any) -> Any:
    """Accept one byte."""
    assert isinstance(value, bytes | bytearray) and len(value) == 1, (
        f"The '{name}' field must be of type 'bytes' or 'ByteString' with length 1"
    )
    return value


def character(name: str, value: Any, highest: int) -> Any:
    """Accept one character with a code point up to `highest`."""
    assert isinstance(value, str | UserString) and len(value) == 1 and ord(str(value)) <= highest, (
        f"The '{name}' field must be of type 'str' or 'UserString' with length 1 "
        f"and the character ord() in [0, {highest}]"
    )
    return value


def text(name: str, value: Any) -> Any:
    """Accept a string."""
    assert isinstance(value, str), f"The '{name}' field must be of type 'str'"
    return value


def bounded_text(name: str, value: Any, longest: int) -> Any:
    """Accept a string of at most `longest` characters."""
    assert isinstance(value, str | UserString) and len(value) <= longest, (
        f"The '{name}' field must be string value not longer than {longest}"
    )
    return value


def message(name: str, value: Any, class_: type) -> Any:
    """Accept a message of the class."""
    assert isinstance(value, class_), f"The '{name}' field must be a sub message of type '{class_.__name__}'"
    return value


def collection(
    name: str, value: Any, element: type, *, size: int | None = None, bound: int | None = None
) -> Any:
    """Accept a set or sequence of elements of a class: exactly `size`, or at most `bound`."""
    assert _fits(value, size, bound) and _all_of(value, element), (
        f"{_must(name, size, bound)} and each value of type '{element.__name__}'"
    )
    return value


def texts(name: str, value: Any, longest: int, *, size: int | None = None, bound: int | None = None) -> Any:
    """Accept a set or sequence of strings of at most `longest` characters each."""
    assert (
        _fits(value, size, bound) and _all_of(value, str) and all(len(item) <= longest for item in value)
    ), (
        f"{_must(name, size, bound)} and each string value not longer than {longest} "
        "and each value of type 'str'"
    )
    return value


def characters(
    name: str, value: Any, highest: int, *, size: int | None = None, bound: int | None = None
) -> Any:
    """Accept a set or sequence of single characters with code points up to `highest`."""
    assert (
        _fits(value, size, bound)
        and _all_of(value, str)
        and all(len(item) == 1 and ord(item) <= highest for item in value)
    ), f"{_must(name, size, bound)} and each value of type 'str' and the character ord() in [0, {highest}]"
    return value


def numbers(name: str, value: Any, type_name: str, bound: int | None = None) -> array[Any]:
    """Return an `array.array` of the right type code unchanged, and convert other numbers.

    Numbers in a buffer, such as a numpy array, are copied at once.
    """
    kind = NUMBERS[type_name]
    if isinstance(value, array):
        assert value.typecode == kind.code, (
            f"The '{name}' array.array() must have the type code of '{kind.code}'"
        )
        assert bound is None or len(value) <= bound, f"The '{name}' array.array() must have a size <= {bound}"
        return value if value.typecode == kind.code else array(kind.code, value)
    copied = copy_of(value, type_name)
    if copied is None:
        elements(name, value, type_name, bound=bound)
        return array(kind.code, value)
    assert bound is None or len(copied) <= bound, f"{_must(name, None, bound)}"
    return copied


def new_numbers(name: str, value: Iterable[Any], type_name: str, bound: int | None = None) -> array[Any]:
    """Return a new `array.array` for an argument of a constructor; exceptions of the array propagate."""
    made = copy_of(value, type_name)
    if made is None:
        made = array(NUMBERS[type_name].code, value)
    return made if bound is None else numbers(name, made, type_name, bound)


def copy_of(value: Any, type_name: str) -> array[Any] | None:
    """Return a copy of the numbers in a buffer, in C order; None if they do not all fit, or for other values.

    Numbers of another type than the field's are converted by numpy, if they are in one of its arrays.
    """
    if value.__class__ is list or value.__class__ is tuple:
        return None
    try:
        view = memoryview(value)
    except (TypeError, BufferError, ValueError):  # numpy has types that buffers do not support
        return None
    if not view.ndim:  # a single number
        return None
    kind = NUMBERS[type_name]
    made = array(kind.code)
    if view.itemsize != made.itemsize or view.format not in _FORMATS[kind.code]:
        if not hasattr(value, "astype"):
            if _is_iterable(view):
                return None
            from numpy import asarray

            value = asarray(value)
        if not _is_convertible(value, kind):
            return None
        view = memoryview(value.astype(kind.code))
    if view.nbytes:  # an empty view cannot be cast
        made.frombytes(view.cast("B") if view.c_contiguous else view.tobytes())
    return made


_READABLE: Final = frozenset("?cbBhHiIlLqQnNfdP")
_FORMATS: Final = {
    **{code: frozenset(same) for same in ("bhilq", "BHILQ") for code in same},
    **{code: frozenset({code}) for code in "fd"},
}
"""The formats of buffers whose elements, if of the same size, are those of an array with this type code."""


def _is_iterable(view: memoryview) -> bool:
    """Return False for a buffer whose elements only numpy can read, such as one in another byte order."""
    return view.ndim == 1 and view.format in _READABLE


def _is_convertible(values: Any, kind: Number) -> bool:
    """Return whether all elements of a numpy array are in the range of a type, and none loses a fraction."""
    if kind.python is int and values.dtype.kind == "b":
        return True
    if kind.python is int:
        return values.dtype.kind in "iu" and not ((values < kind.low) | (values > kind.high)).any()
    if values.dtype.kind != "f" or kind.code == "d" or values.itemsize <= array(kind.code).itemsize:
        return values.dtype.kind in "iuf"
    return not ((abs(values) > kind.high) & (abs(values) != inf)).any()


def elements(
    name: str, value: Any, type_name: str, *, size: int | None = None, bound: int | None = None
) -> None:
    """Fail unless the value is a set or sequence of numbers in the range of the IDL type."""
    kind = NUMBERS[type_name]
    assert _fits(value, size, bound) and (
        _is_raw(value, kind) or (_all_of(value, kind.python) and kind.admits_all(value))
    ), f"{_must(name, size, bound)} and each value of type '{kind.python.__name__}' and each {kind.range}"


def _fits(value: Any, size: int | None, bound: int | None) -> bool:
    """Return True if the value is a collection other than a string, of a valid length."""
    # A fast path for lists, the most frequent case.
    if value.__class__ is not list and not _is_collection(value):
        return False
    return (size is None or len(value) == size) and (bound is None or len(value) <= bound)


def _is_collection(value: object) -> bool:
    if isinstance(value, memoryview) and not _is_iterable(value):
        return False
    return isinstance(value, Sequence | AbstractSet | UserList) and not isinstance(value, str | UserString)


def _all_of(value: Any, class_: type) -> bool:
    """Return True if all elements are of the class; checks each distinct class once."""
    found = set(map(type, value))
    return found <= {class_} or all(issubclass(each, class_) for each in found)


def _is_raw(value: object, kind: Number) -> bool:
    """Return True if all elements are bytes, as in images and point clouds, which are always in range."""
    return kind.code == "B" and isinstance(value, bytes | bytearray)


def _must(name: str, size: int | None, bound: int | None) -> str:
    """Return the start of messages about collections."""
    length = f" with length {size}" if size is not None else f" with length <= {bound}" if bound else ""
    return f"The '{name}' field must be a set or sequence{length}"
