"""Parse one declaration of a .msg file: type, name and value (ROS 2 documentation, Interfaces)."""

from __future__ import annotations

import keyword
import re
from functools import cache

from forge.base.frozen import frozen
from forge.base.names import CPP_KEYWORDS, LOWER_NAME, did_you_mean, snake_case
from forge.interfaces.model import Array, Element, Named, Primitive, Sequence, String, Type, TypeName
from forge.interfaces.read.literals import ParseError, check_size

PRIMITIVES = {
    "bool": "boolean",
    "byte": "octet",
    "char": "uint8",
    "float32": "float",
    "float64": "double",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_SUGGESTIONS = {
    "boolean": "bool",
    "double": "float64",
    "duration": "builtin_interfaces/Duration",
    "float": "float32",
    "int": "int32",
    "long": "int64",
    "octet": "byte",
    "short": "int16",
    "str": "string",
    "text": "string",
    "time": "builtin_interfaces/Time",
    "uint": "uint32",
}
"""Common wrong type names, and the intended types."""

_CONSTANT_NAME = re.compile(r"[A-Z](?:_?[A-Z0-9])*")
_SECTION_NAME = re.compile(
    r"(?:Sample_)?[A-Z][A-Za-z0-9]*(?:_Feedback)?(?:_Result)?(?:_Goal)?(?:_Response)?(?:_Request)?"
)
_SIZE = r"[+-]?\d\w*"
_TYPE = re.compile(
    rf"(?P<word>\w+)(?:/(?P<name>\w+)|<=(?P<bound>{_SIZE}))?(?P<array>\[(?:(?P<most><=)?(?P<size>{_SIZE}))?\])?"
)
_START_OF_TYPE = re.compile(
    rf"(?:\w+(?:/(?!\w)|<=(?!{_SIZE})|(?:/\w+|<={_SIZE})?(?:\[(?:\]|(?:<=)?(?:{_SIZE}\]?)?))?))?"
)
"""The longest part of a malformed type to which something could be added."""

_KEYWORDS = {
    "Python": frozenset(keyword.kwlist),
    "C++": CPP_KEYWORDS,
    "C": frozenset({"restrict"}),  # the only keyword that is in neither of the others
}


@frozen
class Declaration:
    """A field or a constant as written, and where its name and its value start in the line."""

    type: Type
    name: str
    constant: bool
    value: str | None
    name_offset: int
    value_offset: int


def read_declaration(text: str, package: str) -> Declaration:
    """Parse a line without comment and trailing blanks.

    A type name without a package refers to `package`. Raises ParseError.
    """
    written, _, rest = text.partition(" ")
    if not written:
        start = len(text) - len(text.lstrip())
        hint = "remove the leading white space"
        raise ParseError("a declaration must start in the first column", offset=start, hint=hint)
    if written.startswith(("//", "/*")):
        raise ParseError(f"'{written}' is not a type", hint="comments start with '#'")
    if written.startswith("---"):
        raise ParseError("a separator must be exactly '---', in .srv and .action files only")
    if not rest.strip():
        if "=" in written:
            raise ParseError("expected a space after the type of a constant", hint="write 'TYPE NAME=VALUE'")
        raise ParseError(f"expected a name after '{written}'", offset=len(written), hint="write 'TYPE name'")
    type_ = _read_type(written, package)
    offset = len(text) - len(rest.lstrip())
    constant = "=" in rest
    name, _, value = text[offset:].partition("=" if constant else " ")
    value = value.lstrip()
    if constant:
        name = name.rstrip()
        first, blank, last = name.partition(" ")
        if blank or not first:
            at = offset + len(name) - len(last.lstrip(" "))
            hint = "a line that contains '=' declares a constant"
            raise ParseError("expected 'TYPE NAME = VALUE'", offset=at, hint=hint)
        _check_name(name, offset, "constant")
        if not isinstance(type_, Primitive) and type_ not in {String(), String(wide=True)}:
            raise ParseError("a constant must be a number, a bool or an unbounded string")
    else:
        _check_name(name, offset, "field")
        check_keyword(name, offset, "field")
    written_value = value if value or constant else None
    return Declaration(type_, name, constant, written_value, offset, len(text) - len(value))


@cache
def _read_type(written: str, package: str) -> Type:
    """Parse a type; cached, because a package repeats few types many times."""
    match = _TYPE.fullmatch(written)
    if not match:
        raise _malformed(written)
    word, name, bound = match["word"], match["name"], match["bound"]
    of: Element
    if name is not None:
        if not LOWER_NAME.fullmatch(word):
            raise ParseError(f"invalid package name '{word}'")
        of = _message(word, name, match.start("name"))
    elif bound is not None:
        if word not in {"string", "wstring"}:
            message = f"only string and wstring can have a bound, not '{word}'"
            raise ParseError(message, offset=len(word), hint="write a bounded sequence as 'TYPE[<=N]'")
        of = String(word == "wstring", _size(bound, match.start("bound")))
    elif word in PRIMITIVES:
        of = Primitive(PRIMITIVES[word])
    elif word in {"string", "wstring"}:
        of = String(word == "wstring")
    elif word in _SUGGESTIONS:
        raise ParseError(f"unknown type '{word}'", hint=f"use '{_SUGGESTIONS[word]}'")
    elif word[0].isupper():
        of = _message(package, word, 0)
    else:
        near = did_you_mean(word, [*PRIMITIVES, "string", "wstring"])
        raise ParseError(f"unknown type '{word}'", hint=near)
    if match["array"] is None:
        return of
    if match["size"] is not None:
        size = _size(match["size"], match.start("size"))
        return Sequence(of, size) if match["most"] else Array(of, size)
    if isinstance(of, String) and of.wide and of.bound is not None:
        message = f"rosidl reads 'wstring<={of.bound}[]' as 'wstring<={of.bound}[<={of.bound}]'"
        raise ParseError(message, hint="write that instead, or 'wstring[]'")
    return Sequence(of)


def _malformed(written: str) -> ParseError:
    start = _START_OF_TYPE.match(written)
    offset = start.end() if start else 0
    if offset == len(written) and written.count("[") > written.count("]"):
        return ParseError("a type cannot contain spaces", offset=offset)
    if written.count("/") > 1:
        return ParseError(
            f"type '{written}' has more than two parts",
            offset=written.index("/", written.index("/") + 1),
            hint="write 'package/Name' for a message of another package",
        )
    brackets = re.search(r"\[(<=)?([^\]]*)\]", written)
    if brackets and offset >= brackets.end():
        hint = "define a message for the inner array"
        return ParseError("arrays of arrays are not supported", offset=offset, hint=hint)
    if brackets:
        return _no_size(brackets[2], brackets.start(2))
    return ParseError(f"'{written}' is not a type", offset=offset)


def _message(package: str, name: str, offset: int) -> Named:
    if not _SECTION_NAME.fullmatch(name):
        hint = "use CamelCase: letters and digits"
        raise ParseError(f"invalid message name '{name}'", offset=offset, hint=hint)
    return Named(TypeName(package, "msg", name))


def _size(text: str, offset: int) -> int:
    """Parse a size or bound as int() does, as rosidl."""
    try:
        size = int(text)
    except ValueError:
        raise _no_size(text, offset) from None
    return check_size(size, offset)


def _no_size(text: str, offset: int) -> ParseError:
    return ParseError(f"invalid size '{text}'", offset=offset, hint="write a decimal number")


def valid_name(name: str, kind: str) -> str:
    """Return the name, or a similar one, that a 'field' or a 'constant' may have; '' if there is none."""
    pattern = _CONSTANT_NAME if kind == "constant" else LOWER_NAME
    if pattern.fullmatch(name):
        return name
    better = re.sub(r"[^a-z0-9]+", "_", snake_case(name)).strip("_")
    better = better.upper() if kind == "constant" else better
    return better if pattern.fullmatch(better) else ""


def _check_name(name: str, offset: int, kind: str) -> None:
    better = valid_name(name, kind)
    if better != name:
        case = "upper" if kind == "constant" else "lower"
        hint = f"use {case}-case letters, digits and single underscores"
        hint = f"name it '{better}'" if better else hint
        raise ParseError(f"invalid {kind} name '{name}'", offset=offset, hint=hint)


def check_keyword(name: str, offset: int, what: str) -> None:
    """Raise ParseError if the name is a keyword of a target language; `what` is the kind of the name.

    A field may be named like a keyword of Python alone, as with rosidl; `python_keywords` warns about it.
    """
    languages = [language for language, words in _KEYWORDS.items() if name in words]
    if languages and not (what == "field" and languages == ["Python"]):
        raise ParseError(
            f"{what} name '{name}' is a keyword of {' and '.join(languages)}",
            offset=offset,
            hint=f"rename it, for example to '{name}_value'",
        )
