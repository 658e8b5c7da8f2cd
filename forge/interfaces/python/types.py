"""Types and values of interfaces as Python source text."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from math import copysign, isfinite, isnan
from typing import Final

from forge.base.names import snake_case
from forge.interfaces.model import (
    Array,
    Element,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
    element_of,
)
from forge.interfaces.read.literals import INTEGER_RANGES

INTEGERS: Final = {name: limits for name, limits in INTEGER_RANGES.items() if name != "octet"}
TYPE_CODES: Final = dict(
    zip(
        ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float", "double"),
        "bBhHiIqQfd",
        strict=True,
    )
)
LARGEST = 3.4028234663852886e38
"""The largest number of single precision. FLT_MAX in C is rounded up, and no field accepts it."""
_TOO_LARGE = 3.4028235677973366e38
"""From here on, numbers are nearer to infinity."""
DTYPES: Final = {**{name: name for name in INTEGERS}, "float": "float32", "double": "float64"}


def module_name(name: TypeName) -> str:
    return f"{name.package}.{name.kind}._{snake_case(name.name)}"


def type_text(type_: Type) -> str:
    """Return a type as `get_fields_and_field_types` formats it."""
    match type_:
        case Primitive(name):
            return name
        case String(wide, bound):
            word = "wstring" if wide else "string"
            return word if bound is None else f"{word}<{bound}>"
        case Named(name):
            return f"{name.package}/{name.name}"
        case Array(of, size):
            return f"{type_text(of)}[{size}]"
        case Sequence(of, None):
            return f"sequence<{type_text(of)}>"
        case Sequence(of, bound):
            return f"sequence<{type_text(of)}, {bound}>"


def literal(type_: Type, value: Value) -> str:
    """Return the expression for a value, of the type that a field stores."""
    if not isinstance(type_, Array | Sequence):
        return scalar(type_, value)
    items = [scalar(type_.of, item) for item in value] if isinstance(value, tuple) else []
    listed = f"[{', '.join(items)}]"
    name = numeric(type_)
    if name is None:
        return listed
    if isinstance(type_, Array):
        return f"_numpy.array({listed}, _numpy.{DTYPES[name]})"
    return f"_array({TYPE_CODES[name]!r}, {listed})" if items else f"_array({TYPE_CODES[name]!r})"


def scalar(element: Element, value: object) -> str:
    """Return the expression for one value; repr() quotes and escapes strings."""
    match element:
        case Primitive("octet") if isinstance(value, int):
            return repr(bytes([value]))
        case Primitive("boolean"):
            return repr(bool(value))
        case Primitive("float") if isinstance(value, float) and LARGEST < abs(value) < _TOO_LARGE:
            return _float(copysign(LARGEST, value))
        case Primitive("float" | "double") if isinstance(value, int | float):
            return _float(float(value))
        case Primitive("char" | "wchar") if isinstance(value, int):
            return repr(chr(value))
        case _:
            return repr(value)


def _float(value: float) -> str:
    if isfinite(value):
        return repr(value)
    word = "nan" if isnan(value) else "inf"
    return f"-float({word!r})" if value < 0 else f"float({word!r})"


def slot_type(type_: Type) -> str:
    """Return the expression that creates the type's description of rosidl_parser."""
    match type_:
        case Primitive(name):
            inner = f"BasicType({name!r})"
        case String(wide, bound):
            word = "WString" if wide else "String"
            inner = f"Unbounded{word}()" if bound is None else f"Bounded{word}({bound})"
        case Named(name):
            inner = f"NamespacedType({[name.package, name.kind]!r}, {name.name!r})"
        case Array(of, size):
            inner = f"Array({slot_type(of)}, {size})"
        case Sequence(of, None):
            inner = f"UnboundedSequence({slot_type(of)})"
        case Sequence(of, bound):
            inner = f"BoundedSequence({slot_type(of)}, {bound})"
    return f"_definition.{inner}"


def numeric(type_: Type) -> str | None:
    """Return the numeric type of a collection that is stored as an array, else None."""
    element = element_of(type_)
    if type_ is element or not isinstance(element, Primitive):
        return None
    return element.name if element.name in TYPE_CODES else None


def zero(element: Element) -> str:
    """Return the expression for the initial value of a field without a default."""
    match element:
        case Primitive("boolean"):
            return "False"
        case Primitive("octet"):
            return repr(b"\0")
        case Primitive("char" | "wchar"):
            return repr("\0")
        case Primitive("float" | "double"):
            return "0.0"
        case Primitive():
            return "0"
        case _:
            return "''"


def names_in(code: Iterable[str]) -> set[str]:
    """Return the names with a leading '_' in code, except those of attributes."""
    return {name for text in code for name in re.findall(r"(?<!\.)\b_\w+", text)}


def imports(lines: Iterable[str], used: Collection[str]) -> list[str]:
    """Return the import lines of the used names; a blank line separates two groups."""
    selected = (line for line in lines if not line or line.rpartition(" ")[2] in used)
    return "\n".join(selected).strip("\n").splitlines()
