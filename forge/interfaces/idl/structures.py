"""Convert the structs of an .idl file to messages: types, members, constants and annotations (IDL 4.2)."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, cast

from forge.base.errors import Location
from forge.base.names import did_you_mean, python_attribute
from forge.interfaces.idl.values import Expression, read_expression, read_size, value_of
from forge.interfaces.model import (
    HIDDEN_MEMBER,
    Array,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
)
from forge.interfaces.read.errors import ParseError
from forge.interfaces.read.keywords import check_keyword

if TYPE_CHECKING:
    from lark import Token, Tree


_ALIASES = {
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
}
_NAME_PARTS = 3
_CANDIDATES = 100
"""The maximum number of types to compare with an unknown one, for the hint."""

Annotations = dict[str, list[dict[str, Expression]]]
"""The parameters of annotations by name; the parameter of '@name(value)' has the name ''."""


@dataclass(slots=True)
class StructureReader:
    """Collects the typedefs and constants of a file, and converts its structs to messages."""

    report: Callable[[ParseError], None]
    place: Callable[[int], Location]
    warn: Callable[[ParseError], None]
    references: list[tuple[Token, Token, TypeName]] = field(default_factory=list)
    """Each scoped name of a message: its first and last word, and the message."""
    typedefs: list[Token] = field(default_factory=list)
    """The name of each typedef."""
    aliases: list[Token] = field(default_factory=list)
    """Each name of a typedef as a type."""
    _types: dict[str, Type] = field(default_factory=dict)
    _constants: dict[tuple[str, ...], list[tuple[Tree[Token], list[Tree[Token]]]]] = field(
        default_factory=dict
    )

    def add_typedef(self, tree: Tree[Token]) -> None:
        type_tree, declarator = _subtrees(tree)
        name = _token(declarator)
        self.typedefs.append(name)
        try:
            type_ = self._declared(self._type(type_tree), declarator)
        except ParseError as error:
            self.report(error)
            return
        if self._types.setdefault(str(name), type_) != type_:
            self.report(ParseError(f"'{name}' is already defined as another type", offset=_start(name)))

    def add_constant(
        self, path: tuple[Token, ...], tree: Tree[Token], annotations: list[Tree[Token]]
    ) -> None:
        """Add a constant; it is read if its module is that of the constants of a struct."""
        self._constants.setdefault(tuple(map(str, path)), []).append((tree, annotations))

    def message(self, name: TypeName, tree: Tree[Token], annotations: list[Tree[Token]]) -> Message:
        """Convert a struct to a message, without invalid members."""
        constants: dict[str, Constant] = {}
        for constant in self._constants.get((name.package, name.kind, f"{name.name}_Constants"), []):
            with self._reporting():
                self._add_constant(*constant, constants)
        fields: dict[str, Field] = {}
        for member in _subtrees(tree):
            if member.data == "member":
                with self._reporting():
                    self._add_members(member, fields, constants)
        if list(fields) == [HIDDEN_MEMBER]:
            fields.clear()
        doc = _documentation(self._annotations(annotations))
        return Message(name, tuple(fields.values()), tuple(constants.values()), doc)

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Report a ParseError and continue after the block."""
        try:
            yield
        except ParseError as error:
            self.report(error)

    def _add_constant(
        self, tree: Tree[Token], annotations: list[Tree[Token]], constants: dict[str, Constant]
    ) -> None:
        type_tree, expression = _subtrees(tree)
        name = cast("Token", tree.children[1])
        _check_name(name, "constant", constants)
        type_ = self._type(type_tree)
        if not (isinstance(type_, Primitive) or (isinstance(type_, String) and type_.bound is None)):
            hint = "a constant must be a number, a boolean or an unbounded string"
            raise ParseError(f"constant '{name}' cannot be of this type", offset=_start(name), hint=hint)
        value = value_of(read_expression(expression), type_)
        doc = _documentation(self._annotations(annotations))
        constants[str(name)] = Constant(str(name), type_, value, doc, self.place(_start(name)))

    def _add_members(
        self, tree: Tree[Token], fields: dict[str, Field], constants: dict[str, Constant]
    ) -> None:
        parts = _subtrees(tree)
        split = next(number for number, part in enumerate(parts) if part.data != "annotation")
        annotations = self._annotations(parts[:split])
        declarators = parts[split + 1 :]
        base = self._type(parts[split])
        if len({len(declarator.children) for declarator in declarators}) > 1:
            offset = _start(_token(declarators[1]))
            self.warn(ParseError("rosidl before Rolling declares all of these as arrays", offset=offset))
        for declarator in declarators:
            name = _token(declarator)
            with self._reporting():
                _check_name(name, "field", fields, constants)
                type_ = self._declared(base, declarator)
                default = self._default(annotations, type_)
                doc, unit = _documentation(annotations), _unit(annotations)
                place = self.place(_start(name))
                fields[str(name)] = Field(str(name), type_, default, doc, unit, place)

    def _type(self, tree: Tree[Token]) -> Type:
        match tree.data:
            case "basic":
                words = " ".join(map(str, tree.children))
                return Primitive(_ALIASES.get(words, words))
            case "text":
                bound = cast("Tree[Token] | None", tree.children[1])
                return String(tree.children[0] == "wstring", read_size(bound) if bound else None)
            case "sequence":
                return self._sequence(*cast("list[Tree[Token]]", tree.children))
            case _:
                return self._named(cast("list[Token]", cast("Tree[Token]", tree.children[0]).children))

    def _sequence(self, element: Tree[Token], size: Tree[Token] | None) -> Sequence:
        of = self._type(element)
        offset = _start(next(element.scan_values(lambda _: True)))
        if isinstance(of, Array | Sequence):
            hint = "define a struct for the inner one"
            raise ParseError("sequences of arrays or sequences are not supported", offset=offset, hint=hint)
        if isinstance(of, String) and of.wide and of.bound is not None and size is None:
            message = (
                f"rosidl reads 'sequence<wstring<{of.bound}>>' as a sequence of at most {of.bound} elements"
            )
            raise ParseError(message, offset=offset, hint="give a bound, or use plain wstring")
        return Sequence(of, read_size(size) if size else None)

    def _named(self, names: list[Token]) -> Type:
        written = "::".join(map(str, names))
        offset = _start(names[0])
        if len(names) == _NAME_PARTS:
            name = TypeName(*map(str, names))
            self.references.append((names[0], names[-1], name))
            return Named(name)
        if len(names) > 1:
            hint = "write 'package::msg::Name'"
            raise ParseError(f"'{written}' does not have three parts", offset=offset, hint=hint)
        if written not in self._types:
            hint = (
                did_you_mean(written, islice(self._types, _CANDIDATES))
                or "write the full name of a message: 'package::msg::Name'"
            )
            raise ParseError(f"unknown type '{written}'", offset=offset, hint=hint)
        self.aliases.append(names[0])
        return self._types[written]

    def _declared(self, base: Type, declarator: Tree[Token]) -> Type:
        name, *sizes = declarator.children
        if not sizes:
            return base
        offset = _start(cast("Token", name))
        if len(sizes) > 1 or isinstance(base, Array):
            raise ParseError(
                "arrays of arrays are not supported",
                offset=offset,
                hint="define a struct for the inner array",
            )
        if isinstance(base, Sequence):
            raise ParseError(
                "arrays of sequences are not supported",
                offset=offset,
                hint="define a struct for the sequence",
            )
        return Array(base, read_size(_subtrees(cast("Tree[Token]", sizes[0]))[0]))

    def _default(self, annotations: Annotations, type_: Type) -> Value | None:
        """Return the value of @default; rosidl ignores the annotation if there are several."""
        defaults = annotations.get("default", [])
        for parameters in defaults:
            if list(parameters) != ["value"]:
                offset = min((each.offset for each in parameters.values()), default=0)
                raise ParseError("expected '@default (value=...)'", offset=offset)
        if len(defaults) > 1:
            self.warn(
                ParseError(
                    "rosidl ignores the default if there are several", offset=defaults[1]["value"].offset
                )
            )
        return value_of(defaults[0]["value"], type_) if len(defaults) == 1 else None

    def _annotations(self, trees: list[Tree[Token]]) -> Annotations:
        annotations: Annotations = {}
        for tree in trees:
            name, *parameters = tree.children
            values: dict[str, Expression] = {}
            try:
                for parameter in cast("list[Tree[Token] | None]", parameters):
                    if parameter is not None and parameter.data == "parameter":
                        key, value = parameter.children
                        values[str(key)] = read_expression(cast("Tree[Token]", value))
                    elif parameter is not None:
                        values[""] = read_expression(parameter)
            except ParseError as error:
                self.report(error)
                continue
            annotations.setdefault(str(name), []).append(values)
        return annotations


def _documentation(annotations: Annotations) -> tuple[str, ...]:
    """Return the lines of '@verbatim (language="comment", text="...")'."""
    texts = [
        str(parameters["text"].value)
        for parameters in annotations.get("verbatim", [])
        if "text" in parameters and parameters.get("language", Expression("text", "", 0)).value == "comment"
    ]
    block = textwrap.dedent("\n".join(texts)).strip("\n")
    return tuple(block.split("\n")) if block else ()


def _unit(annotations: Annotations) -> str | None:
    values = [
        parameters["value"].value for parameters in annotations.get("unit", []) if "value" in parameters
    ]
    return str(values[0]) if len(values) == 1 else None


def _check_name(name: Token, what: str, *taken: Mapping[str, object]) -> None:
    check_keyword(str(name), _start(name), what)
    if any(str(name) in names for names in taken):
        raise ParseError(f"'{name}' is already declared", offset=_start(name))
    for other in (f"{name}_", name.removesuffix("_")):
        if python_attribute(other) == python_attribute(name) and any(other in names for names in taken):
            raise ParseError(f"'{name}' has the same name in Python as '{other}'", offset=_start(name))


def _subtrees(tree: Tree[Token]) -> list[Tree[Token]]:
    return [cast("Tree[Token]", child) for child in tree.children if hasattr(child, "data")]


def _token(tree: Tree[Token]) -> Token:
    return cast("Token", tree.children[0])


def _start(token: Token) -> int:
    return token.start_pos or 0
