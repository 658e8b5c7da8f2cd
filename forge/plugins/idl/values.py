"""Parse expressions in .idl files (OMG IDL 4.2) and convert them to values of a type."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, cast

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Element, Named, Primitive, Sequence, String, Type, Value
from forge.interfaces.read.literals import (
    SURROGATES,
    ParseError,
    check_length,
    check_range,
    check_size,
    escaped_character,
    within_bound,
)

if TYPE_CHECKING:
    from lark import Token, Tree


_ESCAPE = re.compile(r"""\\(?:([\\"'nrtvbfa])|([0-7]{1,3})|x([0-9a-fA-F]{1,2}))""")
_WIDE_ESCAPE = re.compile(_ESCAPE.pattern[:-1] + r"|u([0-9a-fA-F]{4}))")
_DOUBLED = re.compile(r'\\(["\\])')
_LIMITS = {"char": 127, "wchar": 0xFFFF}
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_TUPLE_HINT = 'write a tuple in quotes, such as "(1, 2, 3)"'


_Kind = Literal["integer", "real", "text", "truth", "name"]
_KINDS: Mapping[type, _Kind] = {bool: "truth", int: "integer", float: "real", str: "text"}


@frozen
class Expression:
    """A literal or name, before its type is known."""

    kind: _Kind
    value: bool | int | float | str
    offset: int


def read_expression(tree: Tree[Token]) -> Expression:
    """Parse an expression; raises ParseError if rosidl does not support it."""
    token = next(iter(tree.scan_values(lambda _: True)))
    offset = token.start_pos or 0
    match tree.data:
        case "signed":
            return _signed(str(tree.children[0]), read_expression(cast("Tree[Token]", tree.children[1])))
        case "group":
            return read_expression(cast("Tree[Token]", tree.children[0]))
        case "number":
            return _number(str(token), offset)
        case "texts":
            texts = (_unescape(cast("Token", text)) for text in tree.children)
            return Expression("text", "".join(texts), offset)
        case "truth":
            return Expression("truth", str(token) == "TRUE", offset)
        case _:
            names = cast("Tree[Token]", tree.children[0]).children
            return Expression("name", "::".join(map(str, names)), offset)


def read_size(tree: Tree[Token]) -> int:
    """Parse a size or bound: a decimal number. Raises ParseError."""
    size = read_expression(tree)
    if size.kind != "integer":
        hint = "constants are not supported here"
        raise ParseError("a size must be a decimal number", offset=size.offset, hint=hint)
    return check_size(int(size.value), size.offset)


def value_of(written: Expression, type_: Type) -> Value:
    """Convert an expression to a value of `type_`; raises ParseError if it has another type."""
    try:
        if not isinstance(type_, Array | Sequence):
            return _single(written, type_)
        values = _collection(written, type_.of)
        check_length(values, type_)
        return values
    except ParseError as error:
        raise error.shifted(written.offset) from None


def _signed(sign: str, operand: Expression) -> Expression:
    """Negate the operand if the sign is '-'; rosidl ignores other signs."""
    if sign != "-":
        return operand
    match operand.kind:
        case "integer" | "real":
            return Expression(operand.kind, -operand.value, operand.offset)  # type: ignore[operator]  # numbers
        case "name":
            return Expression("name", f"-{operand.value}", operand.offset)
        case _:
            raise ParseError("only numbers can have a sign", offset=operand.offset)


def _number(text: str, offset: int) -> Expression:
    if text.isdigit():
        if text.startswith("0") and text.strip("0"):
            message = "a number with a leading zero is octal"
            raise ParseError(message, offset=offset, hint="write it in decimal")
        try:
            return Expression("integer", int(text), offset)
        except ValueError:
            raise ParseError("the number has too many digits", offset=offset) from None
    return Expression("real", float(text.rstrip("dD")), offset)


def _unescape(token: Token) -> str:
    """Return the text of a string literal.

    Wide literals support Unicode escapes. Like rosidl, replace remaining doubled backslashes by single ones.
    """
    wide = token.startswith("L")
    inside = token[2:-1] if wide else token[1:-1]
    if "\\" not in inside:
        return inside
    plain = (_WIDE_ESCAPE if wide else _ESCAPE).sub(escaped_character, inside)
    if SURROGATES.search(plain):
        message = "this escape is half of a surrogate pair"
        raise ParseError(message, offset=token.start_pos or 0, hint="write the character itself")
    return _DOUBLED.sub(r"\1", plain)


def _single(written: Expression, type_: Type) -> bool | int | float | str:
    match type_:
        case String():
            if written.kind not in {"text", "name"}:
                raise ParseError("expected a string in double quotes")
            return within_bound(str(written.value), type_)
        case Primitive("boolean"):
            if written.kind == "truth" or (written.kind == "integer" and written.value in {0, 1}):
                return bool(written.value)
            raise ParseError(f"'{written.value}' is not a boolean", hint="write TRUE or FALSE")
        case Primitive("float" | "double" | "long double"):
            is_number = written.kind in {"integer", "real"}
            if not is_number and not (written.kind == "name" and _NOT_FINITE.fullmatch(str(written.value))):
                raise ParseError(f"'{written.value}' is not a number")
            return float(str(written.value))  # from text: a very long integer becomes infinite, not an error
        case Primitive("char" | "wchar" as name):
            limit = _LIMITS[name]
            if written.kind == "integer" and 0 <= int(written.value) <= limit:
                return chr(int(written.value))
            text = str(written.value)
            if written.kind == "text" and len(text) == 1 and ord(text) <= limit:
                return text
            hint = f"write it as a number up to {limit}"
            raise ParseError(f"'{written.value}' is not a single {name}", hint=hint)
        case Primitive(name):
            if written.kind != "integer":
                raise ParseError(f"'{written.value}' is not an integer")
            check_range(int(written.value), name, str(written.value))
            return int(written.value)
        case _:
            raise ParseError("a member of a struct's type cannot have a default", hint="leave it out")


def _collection(written: Expression, of: Element) -> tuple[bool | int | float | str, ...]:
    """Parse a Python tuple in a string, which is the form of array defaults in .idl files of rosidl."""
    if isinstance(of, Named):
        raise ParseError("a member of a struct's type cannot have a default", hint="leave it out")
    if written.kind != "text":
        raise ParseError("expected a string with the value of an array", hint=_TUPLE_HINT)
    try:
        body = ast.parse(str(written.value).strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ParseError("the string is not a tuple", hint=_TUPLE_HINT) from None
    if not isinstance(body, ast.Tuple | ast.List):
        raise ParseError("the string is not a tuple", hint='a tuple of one element is "(1,)"')
    return tuple(_single(_element(node), of) for node in body.elts)


def _element(node: ast.expr) -> Expression:
    match node:
        case ast.UnaryOp(ast.USub(), ast.Constant() | ast.Name() as operand):
            return _signed("-", _element(operand))
        case ast.Constant(bool() | int() | float() | str() as value):
            return Expression(_KINDS[type(value)], value, 0)
        case ast.Name(name):
            return Expression("name", name, 0)
        case _:
            raise ParseError("an element must be a number, a string, True or False", hint=_TUPLE_HINT)
