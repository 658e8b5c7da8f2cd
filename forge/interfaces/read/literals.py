"""Parse the literals of .msg files: ranges, bounds, quotes and escapes (ROS 2 documentation, Interfaces)."""

from __future__ import annotations

import re

from forge.base.text import counted
from forge.interfaces.model import Array, Primitive, Sequence, String, Type, Value


class ParseError(Exception):
    """An error message, its offset in the parsed text, and a hint."""

    def __init__(self, message: str, *, offset: int = 0, hint: str | None = None) -> None:
        """Count `offset` from 0."""
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.hint = hint

    def shifted(self, by: int) -> ParseError:
        """Return the same error with its offset increased by `by`."""
        return ParseError(self.message, offset=self.offset + by, hint=self.hint)


INTEGER_RANGES = {
    "octet": (0, 255),
    **{f"int{bits}": (-(1 << bits - 1), (1 << bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, (1 << bits) - 1) for bits in (8, 16, 32, 64)},
}
QUOTES = "\"'"
_TRUTH = {"true": True, "1": True, "false": False, "0": False}

_ESCAPE = re.compile(r"""\\(?:([\\"'nrtvbfa?])|([0-7]{1,3})|x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4}))""")
_SIMPLE_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "v": "\v", "b": "\b", "f": "\f", "a": "\a"}
SURROGATES = re.compile("[\ud800-\udfff]")

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
    """Parse `text`, which has no leading or trailing blanks, as a value of `type_`.

    Raises ParseError if it is malformed, out of range, or too long.
    """
    match type_:
        case Array(Primitive() | String() as of) | Sequence(Primitive() | String() as of):
            values = _collection(text, of)
            check_length(values, type_)
            return values
        case String():
            return within_bound(_text(text), type_)
        case Primitive(name):
            return _number(text, name)
        case _:
            raise ParseError("a field of a message type cannot have a default", hint="remove the value")


def check_length(values: tuple[object, ...], type_: Array | Sequence) -> None:
    """Raise ParseError unless a value of the type can have so many elements."""
    match type_:
        case Array(_, size) if len(values) != size:
            raise ParseError(f"expected {counted(size, 'element')}, found {len(values)}")
        case Sequence(_, int(bound)) if len(values) > bound:
            raise ParseError(f"expected at most {counted(bound, 'element')}, found {len(values)}")


def check_size(size: int, offset: int) -> int:
    """Return the size of an array, or the bound of a sequence or string; raises ParseError if it is invalid.

    Type descriptions store it in 64 bits (REP 2011: `capacity`, `string_capacity`), where 0 means unbounded.
    """
    if size < 1:
        raise ParseError("a size must be at least 1", offset=offset)
    if size >> 64:
        raise ParseError("a size must fit in 64 bits", offset=offset)
    return size


def check_range(value: int, name: str, text: str, *, octet: str = "octet") -> None:
    """Raise ParseError if an integer is out of range for a type; `octet` is its name in the language."""
    low, high = INTEGER_RANGES[name]
    if not low <= value <= high:
        kind = octet if name == "octet" else name
        raise ParseError(f"'{text}' is out of range for {kind}", hint=f"the range is {low} to {high}")


def _collection(text: str, of: Primitive | String) -> tuple[bool | int | float | str, ...]:
    if not (text.startswith("[") and text.endswith("]") and len(text) > 1):
        raise ParseError("expected brackets around the value of an array", hint="for example [1, 2, 3]")
    inside = text[1:-1]
    if not inside:
        return ()
    if not isinstance(of, Primitive):
        return tuple(within_bound(value, of) for value in _texts(inside))
    values = []
    offset = 1
    for part in inside.split(","):
        try:
            values.append(_number(part.strip(), of.name))
        except ParseError as error:
            raise error.shifted(offset + len(part) - len(part.lstrip())) from None
        offset += len(part) + 1
    return tuple(values)


def _number(text: str, name: str) -> bool | int | float:
    """Parse a boolean, a float, or an integer, which may have leading zeros or a prefix 0x, 0o or 0b."""
    if name == "boolean":
        if text.lower() not in _TRUTH:
            raise _unreadable(text, "a bool", hint="write true or false")
        return _TRUTH[text.lower()]
    if name in {"float", "double"}:
        try:
            return float(text)
        except ValueError:
            raise _unreadable(text, "a number") from None
    try:
        value = int(text)
    except ValueError:
        try:
            value = int(text, 0)
        except ValueError:
            raise _unreadable(text, "an integer") from None
    check_range(value, name, text, octet="byte")
    return value


def _unreadable(text: str, kind: str, hint: str | None = None) -> ParseError:
    if not text:
        return ParseError(f"expected {kind}", hint=hint)
    if text.startswith("//"):
        hint = "comments start with '#'"
    shown = text if text[0] in QUOTES else f"'{text}'"
    return ParseError(f"{shown} is not {kind}", hint=hint)


def _text(text: str) -> str:
    """Return a string without its quotes and with the characters of its escapes."""
    for quote in QUOTES:
        if text.startswith(quote) and text.endswith(quote):
            text = text[1:-1]
            if stray := re.match(rf"(?:[^\\{quote}]|\\.)*{quote}", text):
                raise ParseError(
                    f"a quote inside a quoted string must be escaped: \\{quote}",
                    offset=stray.end(),
                    hint="or use the other kind of quotes around the string",
                )
            break
    plain = _ESCAPE.sub(escaped_character, text)
    if "\\" in text and (lone := SURROGATES.search(plain)):
        message = f"'\\u{ord(lone.group()):04x}' is half of a surrogate pair"
        raise ParseError(message, hint="write the character itself")
    return plain


def escaped_character(escape: re.Match[str]) -> str:
    """Return the character of an escape; the groups are a sign, an octal and hexadecimal codes."""
    simple, octal, *hexadecimal = escape.groups()
    if simple:
        return _SIMPLE_ESCAPES.get(simple, simple)
    return chr(int(octal, 8)) if octal else chr(int(next(filter(None, hexadecimal)), 16))


def _texts(inside: str) -> list[str]:
    """Parse the elements of a string array; only quotes can be escaped in them."""
    values = []
    offset = 0
    while offset < len(inside):
        element = _TEXT_ELEMENT.match(inside, offset)
        if not element:
            raise ParseError("missing element or closing quote", offset=offset + 1)
        match element.groups():
            case str(double), _, _:
                values.append(double.replace('\\"', '"'))
            case _, str(single), _:
                values.append(single.replace("\\'", "'"))
            case _, _, bare:
                values.append(bare.rstrip())
        offset = element.end()
        # rosidl accepts two quoted elements without a comma between them, and a trailing comma.
        offset += inside[offset : offset + 1] == ","
    return values


def within_bound(text: str, type_: String) -> str:
    """Return the text; raises ParseError if it exceeds the bound of its type."""
    if type_.bound is not None and len(text) > type_.bound:
        raise ParseError(f"a string of {len(text)} characters exceeds the bound {type_.bound}")
    return text
