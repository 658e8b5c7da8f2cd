"""Parse one declaration of a .msg file: type, name and value (ROS 2 documentation, Interfaces)."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, cast

from forge.base.frozen import frozen
from forge.base.names import did_you_mean, snake_case
from forge.interfaces.model import Array, Element, Named, Primitive, Sequence, String, Type, TypeName
from forge.interfaces.read.errors import ParseError
from forge.interfaces.read.keywords import check_keyword

if TYPE_CHECKING:
    from lark import Lark, Token, Tree


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

LOWER_NAME = re.compile(r"(?!.*__)(?!.*_$)[a-z][a-z0-9_]*")
TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_CONSTANT_NAME = re.compile(r"[A-Z](?:_?[A-Z0-9])*")
_SECTION_NAME = re.compile(
    r"(?:Sample_)?[A-Z][A-Za-z0-9]*(?:_Feedback)?(?:_Result)?(?:_Goal)?(?:_Response)?(?:_Request)?"
)


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
    _check_outline(text, written, rest)
    type_ = _read_type(written, package)
    offset = len(text) - len(rest.lstrip())
    constant = "=" in rest
    name, _, value = text[offset:].partition("=" if constant else " ")
    value = value.lstrip()
    if constant:
        name = name.rstrip()
        _check_constant(name, offset, type_)
    else:
        _check_field(name, offset)
    written_value = value if value or constant else None
    return Declaration(type_, name, constant, written_value, offset, len(text) - len(value))


@cache
def _read_type(written: str, package: str) -> Type:
    """Parse a type; cached, because a package repeats few types many times."""
    from lark.exceptions import UnexpectedInput

    try:
        tree = _grammar().parse(written)
    except UnexpectedInput as error:
        ended = getattr(getattr(error, "token", None), "type", "") == "$END"
        raise _explained(written, len(written) if ended else error.pos_in_stream or 0) from None
    return _type(tree, package)


@cache
def _grammar() -> Lark:
    from lark import Lark

    return Lark.open("declaration.lark", rel_to=__file__, parser="lalr", start="type")


def _check_outline(text: str, written: str, rest: str) -> None:
    if not written:
        start = len(text) - len(text.lstrip())
        raise ParseError(
            "a declaration must start in the first column",
            offset=start,
            hint="remove the leading white space",
        )
    if written.startswith(("//", "/*")):
        raise ParseError(f"'{written}' is not a type", hint="comments start with '#'")
    if written.startswith("---"):
        raise ParseError("a separator must be exactly '---', in .srv and .action files only")
    if not rest.strip():
        if "=" in written:
            raise ParseError("expected a space after the type of a constant", hint="write 'TYPE NAME=VALUE'")
        raise ParseError(f"expected a name after '{written}'", offset=len(written), hint="write 'TYPE name'")


def _explained(written: str, offset: int) -> ParseError:
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
        return ParseError(
            "arrays of arrays are not supported", offset=offset, hint="define a message for the inner array"
        )
    if brackets:
        return _no_size(brackets[2], brackets.start(2))
    return ParseError(f"'{written}' is not a type", offset=offset)


def _type(tree: Tree[Token], package: str) -> Type:
    match tree.data:
        case "array":
            return Array(_element(_subtree(tree), package), _size(tree.children[1]))
        case "sequence":
            return _unbounded(_element(_subtree(tree), package))
        case "bounded_sequence":
            return Sequence(_element(_subtree(tree), package), _size(tree.children[1]))
        case _:
            return _element(tree, package)


def _unbounded(of: Element) -> Sequence:
    """Return a sequence, unless rosidl generators and parsers interpret it differently."""
    if isinstance(of, String) and of.wide and of.bound is not None:
        raise ParseError(
            f"rosidl reads 'wstring<={of.bound}[]' as 'wstring<={of.bound}[<={of.bound}]'",
            hint="write that instead, or 'wstring[]'",
        )
    return Sequence(of)


def _subtree(tree: Tree[Token]) -> Tree[Token]:
    return cast("Tree[Token]", tree.children[0])


def _element(tree: Tree[Token], package: str) -> Element:
    words = [str(word) for word in tree.children]
    match tree.data:
        case "bounded_text":
            if words[0] not in {"string", "wstring"}:
                raise ParseError(
                    f"only string and wstring can have a bound, not '{words[0]}'",
                    offset=len(words[0]),
                    hint="write a bounded sequence as 'TYPE[<=N]'",
                )
            return String(words[0] == "wstring", _size(tree.children[1]))
        case "other":
            if not LOWER_NAME.fullmatch(words[0]):
                raise ParseError(f"invalid package name '{words[0]}'")
            return Named(TypeName(words[0], "msg", _message_name(words[1], len(words[0]) + 1)))
        case _:
            return _single(words[0], package)


def _single(word: str, package: str) -> Element:
    if word in PRIMITIVES:
        return Primitive(PRIMITIVES[word])
    if word in {"string", "wstring"}:
        return String(word == "wstring")
    if word in _SUGGESTIONS:
        raise ParseError(f"unknown type '{word}'", hint=f"use '{_SUGGESTIONS[word]}'")
    if word[0].isupper():
        return Named(TypeName(package, "msg", _message_name(word, 0)))
    raise ParseError(f"unknown type '{word}'", hint=did_you_mean(word, [*PRIMITIVES, "string", "wstring"]))


def _message_name(name: str, offset: int) -> str:
    if not _SECTION_NAME.fullmatch(name):
        raise ParseError(
            f"invalid message name '{name}'",
            offset=offset,
            hint="use CamelCase: letters and digits",
        )
    return name


def _size(token: object) -> int:
    """Parse a size or bound as int() does, as rosidl; it must be at least 1."""
    offset = getattr(token, "start_pos", None) or 0
    try:
        size = int(str(token))
    except ValueError:
        raise _no_size(str(token), offset) from None
    if size < 1:
        raise ParseError("a size must be at least 1", offset=offset)
    return size


def _no_size(text: str, offset: int) -> ParseError:
    return ParseError(f"invalid size '{text}'", offset=offset, hint="write a decimal number")


def _check_field(name: str, offset: int) -> None:
    if not LOWER_NAME.fullmatch(name):
        better = re.sub(r"[^a-z0-9]+", "_", snake_case(name)).strip("_")
        hint = f"name it '{better}'" if LOWER_NAME.fullmatch(better) else None
        rule = "use lower-case letters, digits and single underscores"
        raise ParseError(f"invalid field name '{name}'", offset=offset, hint=hint or rule)
    check_keyword(name, offset, "field")


def _check_constant(name: str, offset: int, type_: Type) -> None:
    first, blank, rest = name.partition(" ")
    if blank or not first:
        offset += len(name) - len(rest.lstrip(" "))
        raise ParseError(
            "expected 'TYPE NAME = VALUE'",
            offset=offset,
            hint="a line that contains '=' declares a constant",
        )
    if not _CONSTANT_NAME.fullmatch(name):
        better = re.sub(r"[^A-Z0-9]+", "_", snake_case(name).upper()).strip("_")
        hint = f"name it '{better}'" if _CONSTANT_NAME.fullmatch(better) else None
        rule = "use upper-case letters, digits and single underscores"
        raise ParseError(f"invalid constant name '{name}'", offset=offset, hint=hint or rule)
    if not isinstance(type_, Primitive) and type_ not in {String(), String(wide=True)}:
        raise ParseError("a constant must be a number, a bool or an unbounded string")
