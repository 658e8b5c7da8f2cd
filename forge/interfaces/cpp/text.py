"""Types, values and comments as C++17 source text; everything outside comments is printable ASCII."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence as Items

from forge.interfaces.model import Array, Element, Named, Primitive, Sequence, String, Type, TypeName, Value
from forge.interfaces.notation import BIDI_CONTROLS

_ARITHMETIC = {
    "boolean": "bool",
    "octet": "unsigned char",
    "char": "unsigned char",
    "wchar": "char16_t",
    "float": "float",
    "double": "double",
    "long double": "long double",
    **{f"{sign}int{bits}": f"std::{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_INTEGER_SUFFIXES = {"uint8": "u", "uint16": "u", "uint32": "u", "int64": "ll", "uint64": "ull"}
_REAL_SUFFIXES = {"float": "f", "double": "", "long double": "l"}
_LOWEST = {"int32": -(1 << 31), "int64": -(1 << 63)}
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
_UNPRINTABLE = re.compile(f"[\0-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]|{BIDI_CONTROLS.pattern}")
_SURROGATES = range(0xD800, 0xE000)
_FIRST_UNIVERSAL = 0xA0
_FIRST_ASTRAL = 0x10000


def qualified(name: TypeName) -> str:
    return f"::{name.package}::{name.kind}::{name.name}"


def spell(type_: Type) -> str:
    """Return the type of a member inside the struct template."""
    match type_:
        case Primitive(name):
            return _ARITHMETIC[name]
        case String(wide):
            return f"::rosidl_runtime_cpp::{'U16String' if wide else 'String'}<ContainerAllocator>"
        case Named(name):
            return f"{qualified(name)}_<ContainerAllocator>"
        case Array(of, size):
            return f"std::array<{spell(of)}, {size}>"
        case Sequence(of, None):
            return f"::rosidl_runtime_cpp::Sequence<{spell(of)}, ContainerAllocator>"
        case Sequence(of, bound):
            return f"::rosidl_runtime_cpp::BoundedSequence<{spell(of)}, {bound}, ContainerAllocator>"


def literal(value: Value, type_: Type) -> str:
    """Return an expression for the exact value of a member or constant."""
    match type_:
        case Array(of):
            return f"{{{{{_joined(value, of)}}}}}"
        case Sequence(of):
            return f"{{{_joined(value, of)}}}"
        case String():
            return _text(str(value), type_)
        case Primitive(name):
            return _number(value, name)
        case Named(name):
            raise TypeError(f"a message has no literal: {name}")


def comment(lines: Items[str], unit: str | None = None) -> tuple[str, ...]:
    """Return documentation as comment lines; none of them continues on the next line."""
    *before, last = lines or [""]
    if unit is not None:
        last = f"{last} [{unit}]".lstrip()
    plain = (_UNPRINTABLE.sub(" ", line) for line in (*before, last) if lines or unit)
    comments = (f"/// {line}".rstrip() for line in plain)
    # A backslash or its trigraph at the end would splice lines.
    return tuple(f"{line} ." if line.endswith(("\\", "??/")) else line for line in comments)


def _joined(value: Value, of: Element) -> str:
    return ", ".join(literal(item, of) for item in (value if isinstance(value, tuple) else (value,)))


def _number(value: Value, name: str) -> str:
    if isinstance(value, tuple):
        raise TypeError(f"a {name} is one number, not {len(value)}")
    if name in _REAL_SUFFIXES:
        return _real(float(value), name)
    if name == "boolean":
        return "true" if value else "false"
    number = ord(value) if isinstance(value, str) else int(value)
    suffix = _INTEGER_SUFFIXES.get(name, "")
    if number == _LOWEST.get(name):
        return f"(-{-(number + 1)}{suffix} - 1)"
    return f"{number}{suffix}"


def _real(value: float, name: str) -> str:
    """Return the literal; values that overflow or underflow are written explicitly, to avoid warnings."""
    limits = f"std::numeric_limits<{_ARITHMETIC[name]}>"
    if name == "float":
        value = nearest_single(value)
    if math.isnan(value):
        return f"{limits}::quiet_NaN()"
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}{limits}::infinity()"
    return f"{value!r}{_REAL_SUFFIXES[name]}"


def nearest_single(value: float) -> float:
    """Return the value, or infinity or zero if that is nearest in single precision."""
    try:
        single: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return value if single else single


def _text(value: str, type_: String) -> str:
    """Return a literal of the text; one that contains NUL is passed with its length."""
    body = f'u"{_without_trigraphs("".join(map(_universal, value)))}"' if type_.wide else quoted(value)
    if "\0" not in value:
        return body
    units = len(value.encode("utf-16-le", "surrogatepass")) // 2 if type_.wide else len(_utf8(value))
    return f"{spell(type_)}({body}, {units})"


def quoted(value: str) -> str:
    """Return a string literal whose bytes are UTF-8, regardless of the source encoding of the compiler."""
    return f'"{_without_trigraphs(_utf8(value).decode("latin-1").translate(_BYTES))}"'


def _without_trigraphs(text: str) -> str:
    return text.replace("?", "\\?") if "??" in text else text


def _ascii(character: str) -> str:
    """Return the character, or an escape of three octal digits, which a following digit cannot extend."""
    if character in _ESCAPES:
        return _ESCAPES[character]
    return character if " " <= character <= "~" else f"\\{ord(character):03o}"


_BYTES = str.maketrans({chr(byte): _ascii(chr(byte)) for byte in range(256)})


def _universal(character: str) -> str:
    number = ord(character)
    if number < _FIRST_UNIVERSAL:
        return _ascii(character)
    if number in _SURROGATES:
        return f'\\x{number:04x}" u"'  # ends the literal: a hexadecimal escape has no fixed length
    return f"\\u{number:04x}" if number < _FIRST_ASTRAL else f"\\U{number:08x}"


def _utf8(value: str) -> bytes:
    return value.encode("utf-8", "surrogatepass")
