"""Types and values as C99 source text."""

from __future__ import annotations

import math

from forge.interfaces.cpp.headers import symbol
from forge.interfaces.cpp.text import literal, nearest_single
from forge.interfaces.model import Array, Element, Named, Primitive, Sequence, String, Type, Value

_ARITHMETIC = {
    "boolean": "bool",
    "octet": "uint8_t",
    "char": "signed char",
    "wchar": "uint16_t",
    "float": "float",
    "double": "double",
    "long double": "long double",
    **{f"{sign}int{bits}": f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_REALS = frozenset({"float", "double", "long double"})
_INFINITIES = {"float": "HUGE_VALF", "double": "HUGE_VAL", "long double": "HUGE_VALL"}
_INT = range(-(1 << 31), 1 << 31)
_SIGNED_CHAR = range(-128, 128)


def spell(type_: Primitive | String | Named | Sequence) -> str:
    """Return the type of a member, or of the elements of an array."""
    match type_:
        case Primitive(name):
            return _ARITHMETIC[name]
        case String(wide):
            return "rosidl_runtime_c__U16String" if wide else "rosidl_runtime_c__String"
        case Named(name):
            return symbol(name)
        case Sequence(Primitive(name)):
            return f"rosidl_runtime_c__{name.replace(' ', '_')}__Sequence"
        case Sequence(of):
            return f"{spell(of)}__Sequence"


def declare(type_: Type, name: str) -> str:
    if isinstance(type_, Array):
        return f"{spell(type_.of)} {name}[{type_.size}]"
    return f"{spell(type_)} {name}"


def number(value: Value, type_: Primitive) -> str:
    """Return an expression of exactly this value, for a member or constant of this type."""
    if type_.name in _REALS and isinstance(value, int | float):
        return _real(float(value), type_)
    text = literal(value, type_)
    return f"(signed char){text}" if type_.name == "char" and int(text) not in _SIGNED_CHAR else text


def numbers(value: Value, of: Primitive) -> str:
    items = value if isinstance(value, tuple) else (value,)
    return "{" + ", ".join(number(item, of) for item in items) + "}"


def units(value: str) -> str:
    """Return the initializer of a zero-terminated array of UTF-16 code units, as C99 has no u"..." literals.

    Printable ASCII characters are character literals.
    """
    data = value.encode("utf-16-le", "surrogatepass")
    codes = [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data), 2)]
    return "{" + ", ".join([*map(_unit, codes), "0"]) + "}"


def fits_int(value: Value) -> bool:
    """Return True if an enumerator of C99 can have the value; its type is int."""
    return isinstance(value, int) and value in _INT


def is_plain(type_: Type) -> bool:
    """Return True if values of the type own no memory."""
    return isinstance(type_, Primitive) or (isinstance(type_, Array) and isinstance(type_.of, Primitive))


def needs_math(value: Value | None, type_: Type) -> bool:
    """Return True if the value needs a macro of <math.h>."""
    of: Element = type_.of if isinstance(type_, Array | Sequence) else type_
    if not isinstance(of, Primitive) or of.name not in _REALS or value is None:
        return False
    return any(text in numbers(value, of) for text in ("NAN", "HUGE_VAL"))


def _real(value: float, type_: Primitive) -> str:
    if type_.name == "float":
        value = nearest_single(value)
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return ("-" if value < 0 else "") + _INFINITIES[type_.name]
    return literal(value, type_)


def _unit(code: int) -> str:
    character = chr(code)
    return f"'{character}'" if " " <= character <= "~" and character not in "'\\" else f"0x{code:04x}"
