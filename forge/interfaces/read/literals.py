"""Parse a literal of a type: range, bound, quotes and escapes (ROS 2 documentation, Interfaces)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.interfaces.model import Array, Named, Primitive, Sequence, String
from forge.interfaces.read.errors import ParseError

if TYPE_CHECKING:
    from forge.interfaces.model import Element, Type, Value

INTEGER_RANGES = {
    "octet": (0, 255),
    **{f"int{bits}": (-(1 << bits - 1), (1 << bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, (1 << bits) - 1) for bits in (8, 16, 32, 64)},
}
QUOTES = "\"'"
_TRUTH = {"true": True, "1": True, "false": False, "0": False}

_ESCAPE = re.compile(r"""\\(?:([\\"'nrtvbfa?])|([0-7]{1,3})|x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4}))""")
_SIMPLE_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "v": "\v", "b": "\b", "f": "\f", "a": "\a"}
_SURROGATES = re.compile("[\ud800-\udfff]")

_TEXT_ELEMENT = re.compile(
    r"""
    \s*
    (?: "(?P<double> (?:[^"\\]|\\.)* )"
      | '(?P<single> (?:[^'\\]|\\.)* )'
      | (?P<bare> [^,"'\s][^,]* )
    )
    \s*
    """,
    re.VERBOSE,
)


def read_value(text: str, type_: Type) -> Value:
    """Return the value that `text`, blanks stripped at both ends, stands for.

    Raises Fault when it is none of `type_`: wrong form, out of range, too long, too many.
    """
    match type_:
        case Array(of, size):
            values = _collection(text, of)
            if len(values) != size:
                raise ParseError(f"an array of {_elements(size)} cannot hold {len(values)}")
            return values
        case Sequence(of, bound):
            values = _collection(text, of)
            if bound is not None and len(values) > bound:
                raise ParseError(f"a sequence of at most {_elements(bound)} cannot hold {len(values)}")
            return values
        case String():
            return within_bound(_unescape(_unquote(text)), type_)
        case Primitive(name):
            return _number(text, name)
        case Named():
            raise ParseError("a field of a message type cannot have a default", hint="leave the value out")


def _collection(text: str, of: Element) -> tuple[bool | int | float | str, ...]:
    """Return the elements between brackets."""
    if isinstance(of, Named):
        raise ParseError("a field of a message type cannot have a default", hint="leave the value out")
    if not (text.startswith("[") and text.endswith("]") and len(text) > 1):
        raise ParseError("the value of an array stands in brackets", hint="write it like [1, 2, 3]")
    inside = text[1:-1]
    if not inside:
        return ()
    if isinstance(of, String):
        return tuple(within_bound(value, of) for value in _texts(inside))
    values = []
    offset = 1
    for part in inside.split(","):
        try:
            values.append(_number(part.strip(), of.name))
        except ParseError as fault:
            raise fault.shifted(offset + len(part) - len(part.lstrip())) from None
        offset += len(part) + 1
    return tuple(values)


def _number(text: str, name: str) -> bool | int | float:
    """Return the value of a boolean, a floating-point number or an integer."""
    if name == "boolean":
        if text.lower() not in _TRUTH:
            raise _unreadable(text, "a bool", hint="write true or false")
        return _TRUTH[text.lower()]
    if name in {"float", "double"}:
        return _real(text)
    return _integer(text, name)


def _real(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise _unreadable(text, "a number") from None


def _integer(text: str, name: str) -> int:
    """Return the integer; leading zeros are decimal, 0x, 0o and 0b as in Python."""
    try:
        value = int(text)
    except ValueError:
        try:
            value = int(text, 0)
        except ValueError:
            raise _unreadable(text, "an integer") from None
    low, high = INTEGER_RANGES[name]
    if not low <= value <= high:
        kind = "byte" if name == "octet" else name
        raise ParseError(f"'{text}' is out of range for {kind}", hint=f"it holds {low} to {high}")
    return value


def _unreadable(text: str, kind: str, hint: str | None = None) -> ParseError:
    if not text:
        return ParseError(f"{kind} is missing", hint=hint)
    shown = text if text[0] in QUOTES else f"'{text}'"
    return ParseError(f"{shown} is not {kind}", hint=hint)


def _unquote(text: str) -> str:
    """Return what stands between quotes, or the text as it is; escapes stay."""
    for quote in QUOTES:
        if text.startswith(quote) and text.endswith(quote):
            inside = text[1:-1]
            stray = re.match(rf"(?:[^\\{quote}]|\\.)*{quote}", inside)
            if stray:
                raise ParseError(
                    f"a quote inside quotes needs a backslash: \\{quote}",
                    offset=stray.end(),
                    hint="or put the text between the other kind of quotes",
                )
            return inside
    return text


def _unescape(text: str) -> str:
    """Return the text with C's escapes resolved once; unknown ones are kept as written."""
    if "\\" not in text:
        return text
    plain = _ESCAPE.sub(_character, text)
    lone = _SURROGATES.search(plain)
    if lone:
        raise ParseError(
            f"'\\u{ord(lone.group()):04x}' is half a character", hint="write the character itself"
        )
    return plain


def _character(escape: re.Match[str]) -> str:
    simple, octal, *hexadecimal = escape.groups()
    if simple:
        return _SIMPLE_ESCAPES.get(simple, simple)
    return chr(int(octal, 8)) if octal else chr(int(next(filter(None, hexadecimal)), 16))


def _texts(inside: str) -> list[str]:
    """Return the elements of a text array; only a quote can be escaped in them."""
    values = []
    offset = 0
    while offset < len(inside):
        element = _TEXT_ELEMENT.match(inside, offset)
        if not element:
            raise ParseError("an element is missing here, or its quotes do not close", offset=offset + 1)
        match element.groups():
            case str(double), _, _:
                values.append(double.replace('\\"', '"'))
            case _, str(single), _:
                values.append(single.replace("\\'", "'"))
            case _, _, bare:
                values.append(bare.rstrip())
        offset = element.end()
        # Upstream lets two quoted elements stand side by side, and a comma after the last.
        offset += inside[offset : offset + 1] == ","
    return values


def within_bound(text: str, type_: String) -> str:
    """Return the text; raises Fault when it has more characters than its type allows."""
    if type_.bound is not None and len(text) > type_.bound:
        raise ParseError(f"a text of {len(text)} characters does not fit into {type_.bound}")
    return text


def _elements(count: int) -> str:
    return "1 element" if count == 1 else f"{count} elements"
