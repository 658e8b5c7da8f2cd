"""Expressions in .idl files (OMG IDL 4.2) and their values for a type."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal, cast

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String
from forge.interfaces.read.errors import ParseError
from forge.interfaces.read.literals import INTEGER_RANGES, within_bound

if TYPE_CHECKING:
    import ast

    from lark import Token, Tree

    from forge.interfaces.model import Element, Type, Value

_ESCAPE = re.compile(r"""\\(?:([\\"'nrtvbfa])|([0-7]{1,3})|x([0-9a-fA-F]{1,2}))""")
_WIDE_ESCAPE = re.compile(_ESCAPE.pattern[:-1] + r"|u([0-9a-fA-F]{4}))")
_SIMPLE_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "v": "\v", "b": "\b", "f": "\f", "a": "\a"}
_DOUBLED = re.compile(r'\\(["\\])')
_SURROGATES = re.compile("[\ud800-\udfff]")
_LIMITS = {"char": 127, "wchar": 0xFFFF}
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_TUPLE_HINT = 'such a value is a text with a tuple in it, like "(1, 2, 3)"'


@frozen
class Expression:
    """A value as written, before anybody knows of which type it has to be."""

    kind: Literal["integer", "real", "text", "truth", "name"]
    value: bool | int | float | str
    offset: int


def read_expression(tree: Tree[Token]) -> Expression:
    """Return what an expression says; raises Fault where it says nothing that rosidl reads."""
    token = _first_token(tree)
    offset = token.start_pos or 0
    match tree.data:
        case "signed":
            return _signed(str(tree.children[0]), read_expression(cast("Tree[Token]", tree.children[1])))
        case "number":
            return _number(str(token), offset)
        case "texts":
            return Expression(
                "text", "".join(_unescape(cast("Token", text)) for text in tree.children), offset
            )
        case "truth":
            return Expression("truth", str(token) == "TRUE", offset)
        case _:
            names = cast("Tree[Token]", tree.children[0]).children
            return Expression("name", "::".join(map(str, names)), offset)


def read_size(tree: Tree[Token]) -> int:
    """Return a size or bound: a decimal number, at least 1. Raises Fault."""
    size = read_expression(tree)
    if size.kind != "integer":
        raise ParseError("a size is a decimal number", offset=size.offset, hint="constants are not looked up")
    if int(size.value) < 1:
        raise ParseError("a size is at least 1", offset=size.offset)
    return int(size.value)


def value_of(written: Expression, type_: Type) -> Value:
    """Return the value of `type_` that an expression stands for; raises Fault when it is none."""
    try:
        if not isinstance(type_, Array | Sequence):
            return _single(written, type_)
        return _within_size(_collection(written, type_.of), type_)
    except ParseError as fault:
        raise fault.shifted(written.offset) from None


def _first_token(tree: Tree[Token]) -> Token:
    return next(iter(tree.scan_values(lambda _: True)))


def _signed(sign: str, operand: Expression) -> Expression:
    """Return the operand, negated by '-'; rosidl heeds no other sign."""
    if sign != "-":
        return operand
    match operand.kind:
        case "integer" | "real":
            return Expression(operand.kind, -operand.value, operand.offset)  # type: ignore[operator]  # numbers
        case "name":
            return Expression("name", f"-{operand.value}", operand.offset)
        case _:
            raise ParseError("only numbers have a sign", offset=operand.offset)


def _number(text: str, offset: int) -> Expression:
    if text.isdigit():
        if text.startswith("0") and text.strip("0"):
            raise ParseError(
                "a number with a leading zero is octal", offset=offset, hint="write it in decimal"
            )
        try:
            return Expression("integer", int(text), offset)
        except ValueError:
            raise ParseError("a number of that many digits fits nowhere", offset=offset) from None
    return Expression("real", float(text.rstrip("dD")), offset)


def _unescape(token: Token) -> str:
    """Return the text of a literal; wide ones know code units, and rosidl halves what backslashes remain."""
    wide = token.startswith("L")
    inside = token[2:-1] if wide else token[1:-1]
    if "\\" not in inside:
        return inside
    plain = (_WIDE_ESCAPE if wide else _ESCAPE).sub(_character, inside)
    if _SURROGATES.search(plain):
        raise ParseError(
            "this escape is half a character", offset=token.start_pos or 0, hint="write it itself"
        )
    return _DOUBLED.sub(r"\1", plain)


def _character(escape: re.Match[str]) -> str:
    simple, octal, *hexadecimal = escape.groups()
    if simple:
        return _SIMPLE_ESCAPES.get(simple, simple)
    return chr(int(octal, 8)) if octal else chr(int(next(filter(None, hexadecimal)), 16))


def _single(written: Expression, type_: Type) -> bool | int | float | str:
    match type_:
        case String():
            if written.kind not in {"text", "name"}:
                raise ParseError("a text stands in double quotes")
            return within_bound(str(written.value), type_)
        case Primitive("boolean"):
            if written.kind == "truth" or (written.kind == "integer" and written.value in {0, 1}):
                return bool(written.value)
            raise ParseError(f"'{written.value}' is not a boolean", hint="write TRUE or FALSE")
        case Primitive("float" | "double" | "long double"):
            return _real(written)
        case Primitive("char" | "wchar" as name):
            return _one_character(written, name)
        case Primitive(name):
            return _integer(written, name)
        case _:
            raise ParseError("a member of a struct's type cannot have a default", hint="leave it out")


def _real(written: Expression) -> float:
    if written.kind in {"integer", "real"} or (
        written.kind == "name" and _NOT_FINITE.fullmatch(str(written.value))
    ):
        return float(str(written.value))  # by way of text: a long integer is infinite, not an error
    raise ParseError(f"'{written.value}' is not a number")


def _integer(written: Expression, name: str) -> int:
    if written.kind != "integer":
        raise ParseError(f"'{written.value}' is not an integer")
    low, high = INTEGER_RANGES[name]
    if not low <= int(written.value) <= high:
        raise ParseError(f"'{written.value}' is out of range for {name}", hint=f"it holds {low} to {high}")
    return int(written.value)


def _one_character(written: Expression, name: str) -> str:
    """Return the character of a one-letter text or of a number."""
    limit = _LIMITS[name]
    if written.kind == "integer" and 0 <= int(written.value) <= limit:
        return chr(int(written.value))
    if written.kind == "text" and len(str(written.value)) == 1 and ord(str(written.value)) <= limit:
        return str(written.value)
    raise ParseError(f"'{written.value}' is not one {name}", hint=f"write it as a number up to {limit}")


def _collection(written: Expression, of: Element) -> tuple[bool | int | float | str, ...]:
    """Return the elements of a Python tuple in a text, which is how IDL files write lists."""
    import ast  # noqa: PLC0415  (only defaults of arrays come here)

    if isinstance(of, Named):
        raise ParseError("a member of a struct's type cannot have a default", hint="leave it out")
    if written.kind != "text":
        raise ParseError("the value of an array is a text", hint=_TUPLE_HINT)
    try:
        body = ast.parse(str(written.value).strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ParseError("the text holds no tuple", hint=_TUPLE_HINT) from None
    if not isinstance(body, ast.Tuple | ast.List):
        raise ParseError("the text holds no tuple", hint='one element is "(1,)"')
    return tuple(_single(_element(node), of) for node in body.elts)


def _within_size(values: tuple[bool | int | float | str, ...], type_: Array | Sequence) -> Value:
    """Return the elements, unless they are too many or, for an array, too few."""
    match type_:
        case Array(_, size) if len(values) != size:
            raise ParseError(f"an array of {size} cannot hold {len(values)}")
        case Sequence(_, int(bound)) if len(values) > bound:
            raise ParseError(f"a sequence of at most {bound} cannot hold {len(values)}")
        case _:
            return values


def _element(node: ast.expr) -> Expression:
    """Return an element of the tuple as if it stood alone."""
    import ast  # noqa: PLC0415  (as above)

    match node:
        case ast.UnaryOp(ast.USub(), ast.Constant() | ast.Name() as operand):
            return _signed("-", _element(operand))
        case ast.Constant(bool(truth)):
            return Expression("truth", truth, 0)
        case ast.Constant(int(integer)):
            return Expression("integer", integer, 0)
        case ast.Constant(float(real)):
            return Expression("real", real, 0)
        case ast.Constant(str(text)):
            return Expression("text", text, 0)
        case ast.Name(name):
            return Expression("name", name, 0)
        case _:
            raise ParseError("an element is a number, a text, True or False", hint=_TUPLE_HINT)
