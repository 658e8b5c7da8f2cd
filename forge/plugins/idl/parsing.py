"""Parse the text of an .idl file: the subset of OMG IDL 4.2 that rosidl supports."""

from __future__ import annotations

import re
import textwrap
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, cast

from forge.base.errors import InterfaceError, Location, Problem
from forge.base.names import did_you_mean, python_attribute
from forge.interfaces.model import (
    HIDDEN_MEMBER,
    SECTIONS,
    Array,
    Constant,
    Field,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Source,
    String,
    Type,
    TypeName,
    Value,
    interface_of,
)
from forge.interfaces.read.declarations import check_keyword
from forge.interfaces.read.literals import ParseError
from forge.plugins.idl.values import Expression, read_expression, read_size, value_of

if TYPE_CHECKING:
    from lark import Lark, Token, Tree
    from lark.exceptions import UnexpectedInput


_SECTIONS = {len(suffixes): suffixes for suffixes in SECTIONS.values()}
"""The suffixes of the structs of an interface, by their number."""
_DEPTH = 2
"""The number of modules around a struct: the package and the namespace."""

_UNSUPPORTED = frozenset(
    """
    abstract any bitfield bitmask bitset exception fixed import interface local map native switch
    typeid typeprefix union valuetype void
    """.split()
)
"""Keywords of OMG IDL 4.2 that ROS does not support."""

_WITHOUT_EFFECT = frozenset("appendable external key must_understand mutable optional range".split())
"""Annotations that change how other DDS tools serialize, limit or match values."""

_EXPLANATIONS: dict[str, tuple[str, str | None]] = {
    "#": ("the only supported preprocessor directive is #include", None),
    '"': ("a string must end on the line where it starts", None),
    "'": ("character literals are not supported", 'write a string: "a"'),
    **{
        sign: (f"'{sign}' is not expected here", "expressions are not supported: write the result")
        for sign in "+-*/%|&^<>"
    },
}
_EXPECTED = {
    "SEMICOLON": "';'",
    "RBRACE": "'}'",
    "LBRACE": "'{'",
    "RSQB": "']'",
    "RPAR": "')'",
    "MORETHAN": "'>'",
    "NAME": "a name",
    "EQUAL": "'='",
}

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


def read_idl(source: Source) -> FileReader:
    """Read the definitions of a file, and collect problems and warnings.

    The namespace of the interface comes from its modules, not from its folder. Raises InterfaceError with the
    first syntax error.
    """
    from lark.exceptions import UnexpectedInput

    text = source.text.removeprefix("\ufeff")
    reader = FileReader(source, text)
    try:
        tree = _parser().parse(text)
    except UnexpectedInput as error:
        raise InterfaceError(reader.problem(_explained(error, text))) from None
    try:
        reader.read(tree)
    except RecursionError:
        place = Location(str(source.path))
        raise InterfaceError(Problem("a type or expression is nested too deeply", place)) from None
    return reader


@cache
def _parser() -> Lark:
    from lark import Lark

    return Lark.open("grammar.lark", rel_to=__file__, parser="lalr")


def _explained(error: UnexpectedInput, text: str) -> ParseError:
    offset = error.pos_in_stream if error.pos_in_stream is not None else len(text)
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        return ParseError("unexpected end of file", offset=len(text.rstrip()), hint="is a '};' missing?")
    words = re.compile(r"(\w*)\W*\Z").search(text[max(0, offset - 40) : offset])
    before = words[1] if words else ""
    here = re.compile(r"\w+|.", re.DOTALL).match(text, offset)
    word = here[0] if here else ""
    if word in _UNSUPPORTED or (word == "<" and before in _UNSUPPORTED):
        keyword = word if word in _UNSUPPORTED else before
        return ParseError(f"'{keyword}' of OMG IDL is not supported by ROS", offset=offset)
    if (number := re.search(r"\b0\Z", text[:offset])) and re.fullmatch(r"[xX][0-9a-fA-F]+", word):
        message = f"hexadecimal numbers such as '0{word}' are not supported"
        return ParseError(message, offset=number.start(), hint=f"write {int(word[1:], 16)}")
    expected = getattr(error, "accepts", None) or getattr(error, "allowed", None) or ()
    names = [shown for name, shown in _EXPECTED.items() if name in expected]
    expectation = f"{' or '.join(names[:2])} is expected" if names else None
    if text.startswith("/*", offset):
        return ParseError("the comment is not closed", offset=offset, hint="add '*/'")
    message, hint = _EXPLANATIONS.get(word, (f"'{word}' is not expected here", expectation))
    return ParseError(message, offset=offset, hint=hint)


@dataclass(slots=True)
class FileReader:
    """Reads the definitions of one file; `problems` are errors, `warnings` are for `--strict`."""

    source: Source
    text: str
    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    references: list[tuple[Token, Token, TypeName]] = field(default_factory=list)
    """The scoped names of messages: first and last word of each, and the message."""
    typedefs: list[Token] = field(default_factory=list)
    """The name of each typedef."""
    aliases: list[Token] = field(default_factory=list)
    """Each name of a typedef as a type."""
    structs: list[tuple[Token, TypeName]] = field(default_factory=list)
    """The names of each struct: as written, and in full."""
    includes: list[Token] = field(default_factory=list)
    """The paths of #include directives, in quotes or angle brackets."""
    modules: list[Token] = field(default_factory=list)
    """The names of modules."""
    _types: dict[str, Type] = field(default_factory=dict)
    _enumerations: set[str] = field(default_factory=set)
    _constants: dict[tuple[str, ...], list[tuple[Tree[Token], list[Tree[Token]]]]] = field(
        default_factory=dict
    )
    _messages: list[Message] = field(default_factory=list)
    _starts: list[int] = field(default_factory=list)
    """The offset of each line, computed on first use."""

    def read(self, tree: Tree[Token]) -> None:
        """Read all structs, with their constants and types."""
        structs: list[tuple[tuple[Token, ...], Tree[Token], list[Tree[Token]]]] = []
        for path, notes, definition in self._definitions(tree.children, ()):
            match definition.data:
                case "struct":
                    structs.append((path, definition, notes))
                case "typedef":
                    with self._reporting():
                        type_tree, declarator = _subtrees(definition)
                        word = _token(declarator)
                        self.typedefs.append(word)
                        type_ = self._declared(self._type(type_tree), declarator)
                        if self._types.setdefault(str(word), type_) != type_:
                            message = f"'{word}' is already defined as another type"
                            raise ParseError(message, offset=_start(word))
                case "enumeration":
                    self._enumerations.add(str(_token(definition)))
                case "constant":
                    # It is only read if its module contains the constants of a struct.
                    self._constants.setdefault(tuple(map(str, path)), []).append((definition, notes))
                case _:
                    pass
        for path, definition, notes in structs:
            word = _token(definition)
            name = self._name(path, word)
            self.structs.append((word, name))
            self._messages.append(self._message(name, definition, notes))
        words = [word for word, _ in self.structs]
        if not self.has_interface():
            message = f"expected 1 struct (a message), 2 (a service) or 3 (an action), found {len(words)}"
            self.problems.append(Problem(message, Location(str(self.source.path))))
            return
        file = PurePosixPath(self.source.relative)
        stem, sections = file.stem, _SECTIONS[len(words)]
        if file.parent.name == "msg" and len(words) > 1 and f"{stem}{sections[0]}" not in words:
            message = f"a message is one struct, but the file has {len(words)}"
            self._report(message, words[1], "write each message into a separate file")
            return
        for word, suffix in zip(words, sections, strict=True):
            if word != stem + suffix:
                message = f"the name of struct '{word}' does not match the file"
                self._report(message, word, f"rename it to '{stem}{suffix}'")
        if len({message.name.kind for message in self._messages}) > 1:
            self._report("all structs of a file must be in one module", words[1])

    def has_interface(self) -> bool:
        """Return whether the number of structs is valid for a message, a service or an action."""
        return len(self._messages) in _SECTIONS

    def interface(self) -> Interface:
        """Return the interface, without invalid members; call this only if there is one."""
        first = self._messages[0]
        stem = PurePosixPath(self.source.relative).stem
        name = TypeName(first.name.package, first.name.kind, stem)
        return interface_of(name, self._messages)

    def place(self, offset: int) -> Location:
        if not self._starts:
            self._starts = [0, *(match.end() for match in re.finditer("\n", self.text))]
        number = bisect_right(self._starts, offset)
        start = self._starts[number - 1]
        end = self.text.find("\n", start)
        line = self.text[start : None if end < 0 else end].rstrip("\r")
        return Location(str(self.source.path), number, offset - start + 1, line)

    def problem(self, error: ParseError) -> Problem:
        return Problem(error.message, self.place(error.offset), error.hint)

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Report a ParseError and continue after the block."""
        try:
            yield
        except ParseError as error:
            self.problems.append(self.problem(error))

    def _report(self, message: str, at: Token, hint: str | None = None) -> None:
        self.problems.append(self.problem(ParseError(message, offset=_start(at), hint=hint)))

    def _warn(self, text: str, offset: int) -> None:
        self.warnings.append(self.problem(ParseError(text, offset=offset)))

    def _definitions(
        self, children: Iterable[object], path: tuple[Token, ...]
    ) -> Iterator[tuple[tuple[Token, ...], list[Tree[Token]], Tree[Token]]]:
        for child in cast("Iterable[Tree[Token]]", children):
            if child.data != "definition":
                self.includes.append(_token(child))
                continue
            *annotations, definition = cast("list[Tree[Token]]", child.children)
            if definition.data != "module":
                yield path, annotations, definition
            elif len(path) > _DEPTH:
                self._report("modules are nested too deeply", _token(definition))
            else:
                name = _token(definition)
                self.modules.append(name)
                yield from self._definitions(definition.children[1:], (*path, name))

    def _name(self, path: tuple[Token, ...], name: Token) -> TypeName:
        if len(path) != _DEPTH:
            message = f"a struct must be inside {_DEPTH} modules: the package and a namespace"
            hint = f"module {self.source.package} {{ module msg {{ struct {name} {{ ... }}; }}; }};"
            self._report(message, name, hint)
            return TypeName(self.source.package, "msg", str(name))
        package, kind = path
        if package != self.source.package:
            message = f"the module is '{package}', but the package is '{self.source.package}'"
            self._report(message, package)
        for token, what in ((kind, "module"), (name, "struct")):
            with self._reporting():
                check_keyword(str(token), _start(token), what)
        return TypeName(self.source.package, str(kind), str(name))

    def _message(self, name: TypeName, tree: Tree[Token], annotations: list[Tree[Token]]) -> Message:
        """Convert a struct to a message, without invalid members."""
        constants: dict[str, Constant] = {}
        for definition, notes in self._constants.get((name.package, name.kind, f"{name.name}_Constants"), []):
            with self._reporting():
                type_tree, expression = _subtrees(definition)
                word = cast("Token", definition.children[1])
                _check_name(word, "constant", constants)
                type_ = self._type(type_tree)
                if not (isinstance(type_, Primitive) or (isinstance(type_, String) and type_.bound is None)):
                    message = f"constant '{word}' cannot be of this type"
                    hint = "a constant must be a number, a boolean or an unbounded string"
                    raise ParseError(message, offset=_start(word), hint=hint)
                value = value_of(read_expression(expression), type_)
                doc = _documentation(self._annotations(notes))
                constants[str(word)] = Constant(str(word), type_, value, doc, self.place(_start(word)))
        fields: dict[str, Field] = {}
        for member in _subtrees(tree):
            if member.data == "member":
                with self._reporting():
                    self._add_members(member, fields, constants)
        if list(fields) == [HIDDEN_MEMBER]:
            fields.clear()
        doc = _documentation(self._annotations(annotations))
        return Message(name, tuple(fields.values()), tuple(constants.values()), doc)

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
            self._warn("rosidl before Rolling declares all of these as arrays", offset)
        for declarator in declarators:
            name = _token(declarator)
            with self._reporting():
                _check_name(name, "field", fields, constants)
                type_ = self._declared(base, declarator)
                default = self._default(annotations, type_)
                doc, place = _documentation(annotations), self.place(_start(name))
                units = [each["value"].value for each in annotations.get("unit", []) if "value" in each]
                unit = str(units[0]) if len(units) == 1 else None
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
        if written in self._enumerations:
            message = f"'{written}' is an enum, which ROS does not support as the type of a member"
            raise ParseError(message, offset=offset, hint="use an integer type, and constants for its values")
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
            hint = "define a struct for the inner array"
            raise ParseError("arrays of arrays are not supported", offset=offset, hint=hint)
        if isinstance(base, Sequence):
            hint = "define a struct for the sequence"
            raise ParseError("arrays of sequences are not supported", offset=offset, hint=hint)
        return Array(base, read_size(_subtrees(cast("Tree[Token]", sizes[0]))[0]))

    def _default(self, annotations: Annotations, type_: Type) -> Value | None:
        """Return the value of @default; rosidl ignores the annotation if there are several."""
        defaults = annotations.get("default", [])
        for parameters in defaults:
            if list(parameters) != ["value"]:
                offset = min((each.offset for each in parameters.values()), default=0)
                raise ParseError("expected '@default (value=...)'", offset=offset)
        if len(defaults) > 1:
            self._warn("rosidl ignores the default if there are several", defaults[1]["value"].offset)
        return value_of(defaults[0]["value"], type_) if len(defaults) == 1 else None

    def _annotations(self, trees: list[Tree[Token]]) -> Annotations:
        annotations: Annotations = {}
        for tree in trees:
            name, *parameters = tree.children
            if str(name) in _WITHOUT_EFFECT:
                self._warn(
                    f"ROS ignores '@{name}': values are serialized as without it", _start(cast("Token", name))
                )
            values: dict[str, Expression] = {}
            with self._reporting():
                for parameter in cast("list[Tree[Token]]", list(filter(None, parameters))):
                    key, value = parameter.children if parameter.data == "parameter" else ("", parameter)
                    values[str(key)] = read_expression(cast("Tree[Token]", value))
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
