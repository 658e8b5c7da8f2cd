"""Parse the text of an .idl file: the subset of OMG IDL 4.2 that rosidl supports."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cache
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, cast

from forge.base.errors import InterfaceError, Place, Problem, raise_if_any
from forge.interfaces.idl.structures import StructureReader
from forge.interfaces.model import Action, Message, Service, TypeName
from forge.interfaces.read.declarations import check_keyword
from forge.interfaces.read.errors import ParseError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from lark import Lark, Token, Tree
    from lark.exceptions import UnexpectedInput

    from forge.interfaces.model import Interface, Source

_SECTIONS = {2: ("_Request", "_Response"), 3: ("_Goal", "_Result", "_Feedback")}
_DEPTH = 2
"""How many modules stand around a struct: the package's and, in it, the namespace."""

_DEEPEST = 60
"""How deep the syntax may nest; no type of ROS comes near."""

_UNUSED = """
    abstract any bitfield bitmask bitset exception fixed import interface local map native switch
    typeid typeprefix union valuetype void
"""
_REFUSED = frozenset(_UNUSED.split())
"""Words of IDL for which ROS has no use."""

_EXPLANATIONS: dict[str, tuple[str, str | None]] = {
    "#": ("the only preprocessor line that ROS reads is #include", None),
    '"': ("a text ends in the line in which it begins", None),
    "'": ("ROS reads no character literals", 'write a text: "a"'),
    **{
        sign: (f"'{sign}' is not expected here", "ROS calculates nothing: write the result")
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


def parse_idl(source: Source) -> Interface:
    """Parse one .idl file; its modules, not its folder, say which namespace the interface is in.

    Raises InterfaceError: the first mistake of syntax, or else every problem of what it says.
    """
    reader = read_idl(source)
    raise_if_any(sorted(reader.problems, key=_position), InterfaceError)
    return reader.interface()


def read_idl(source: Source) -> FileReader:
    """Return all that a file's text says, with the problems and warnings found in it.

    Raises InterfaceError with the first mistake of syntax.
    """
    from lark.exceptions import UnexpectedInput  # noqa: PLC0415  (takes 40 ms; needed only for .idl files)

    text = source.text.removeprefix("\ufeff")
    reader = FileReader(source, text)
    try:
        tree = _grammar().parse(text)
    except UnexpectedInput as error:
        raise InterfaceError(reader.problem(_explained(error, text))) from None
    deep = _too_deep(tree)
    if deep is not None:
        raise InterfaceError(reader.problem(ParseError("this nests too deep", offset=deep.start_pos or 0)))
    reader.read(tree)
    return reader


@cache
def _grammar() -> Lark:
    from lark import Lark  # noqa: PLC0415  (as above)

    return Lark.open("grammar.lark", rel_to=__file__, parser="lalr")


def _too_deep(tree: Tree[Token]) -> Token | None:
    """Return a word that is nested too deep, if there is one; modules are counted where they are read."""
    layer: list[Any] = []
    waiting: list[Any] = [tree]
    while waiting:
        node = waiting.pop()
        inside = waiting if getattr(node, "data", "") in {"start", "definition", "module"} else layer
        inside += node.children if inside is waiting else [node]
    depth = 0
    while layer:
        words = (node for node in layer if not hasattr(node, "children"))
        if depth > _DEEPEST and (word := next(words, None)):
            return cast("Token", word)
        layer = [child for node in layer for child in getattr(node, "children", ())]
        depth += 1
    return None


def _explained(error: UnexpectedInput, text: str) -> ParseError:
    """Return what is wrong where the grammar refused to go on."""
    offset = error.pos_in_stream if error.pos_in_stream is not None else len(text)
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        return ParseError("the file ends too early", offset=len(text.rstrip()), hint="is a '};' missing?")
    words = re.compile(r"(\w*)\W*\Z").search(text[max(0, offset - 40) : offset])
    before = words[1] if words else ""
    here = re.compile(r"\w+|.", re.DOTALL).match(text, offset)
    word = here[0] if here else ""
    if word in _REFUSED or (word == "<" and before in _REFUSED):
        refused = word if word in _REFUSED else before
        return ParseError(f"ROS has no counterpart of IDL's '{refused}'", offset=offset)
    message, hint = _EXPLANATIONS.get(word, (f"'{word}' is not expected here", _expectation(error)))
    return ParseError(message, offset=offset, hint=hint)


def _expectation(error: UnexpectedInput) -> str | None:
    """Return what should have come instead, where that is one or two things."""
    expected = getattr(error, "accepts", None) or getattr(error, "allowed", None) or ()
    names = [shown for name, shown in _EXPECTED.items() if name in expected]
    return f"{' or '.join(names[:2])} is expected" if names else None


def _position(problem: Problem) -> tuple[int, int]:
    place = problem.place
    return (place.line or 0, place.column or 0) if place else (0, 0)


@dataclass(slots=True)
class FileReader:
    """Reads the definitions of one file; what is wrong stays in `problems`, what is odd in `warnings`."""

    source: Source
    text: str
    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    _messages: list[Message] = field(default_factory=list)
    _starts: list[int] = field(default_factory=list)
    """Where each line begins, once anybody has asked for a place."""

    def read(self, tree: Tree[Token]) -> None:
        """Take in every struct, and the constants and types that belong to it."""
        structures = StructureReader(self.report, self.place, self.warn)
        structs: list[tuple[tuple[Token, ...], Tree[Token], list[Tree[Token]]]] = []
        for path, notes, definition in self._definitions(tree.children, ()):
            match definition.data:
                case "struct":
                    structs.append((path, definition, notes))
                case "typedef":
                    structures.add_typedef(definition)
                case "constant":
                    structures.add_constant(path, definition, notes)
                case _:
                    pass
        for path, definition, notes in structs:
            name = self._name(path, cast("Token", definition.children[0]))
            self._messages.append(structures.message(name, definition, notes))
        self._check_number([definition for _, definition, _ in structs])

    def interface(self) -> Interface:
        """Return the interface, once there are no problems."""
        first = self._messages[0]
        stem = PurePosixPath(self.source.relative).stem
        name = TypeName(first.name.package, first.name.kind, stem)
        match self._messages:
            case [message]:
                return message
            case [request, response]:
                return Service(name, request, response)
            case messages:
                return Action(name, *messages)

    def place(self, offset: int) -> Place:
        """Return line and column of an offset in the text."""
        if not self._starts:
            self._starts = [0, *(match.end() for match in re.finditer("\n", self.text))]
        number = bisect_right(self._starts, offset)
        start = self._starts[number - 1]
        end = self.text.find("\n", start)
        line = self.text[start : None if end < 0 else end].rstrip("\r")
        return Place(str(self.source.path), number, offset - start + 1, line)

    def problem(self, fault: ParseError) -> Problem:
        """Return a fault as a problem of this file."""
        return Problem(fault.message, self.place(fault.offset), fault.hint)

    def report(self, fault: ParseError) -> None:
        """Remember what is wrong."""
        self.problems.append(self.problem(fault))

    def warn(self, fault: ParseError) -> None:
        """Remember what is legal but odd."""
        self.warnings.append(self.problem(fault))

    def _definitions(
        self, children: Iterable[object], path: tuple[Token, ...]
    ) -> Iterator[tuple[tuple[Token, ...], list[Tree[Token]], Tree[Token]]]:
        """Yield each definition with the modules around it and the annotations before it."""
        for child in cast("Iterable[Tree[Token]]", children):
            if child.data != "definition":
                continue
            *annotations, definition = cast("list[Tree[Token]]", child.children)
            if definition.data != "module":
                yield path, annotations, definition
            elif len(path) > _DEPTH:
                offset = cast("Token", definition.children[0]).start_pos or 0
                self.report(ParseError("ROS has no use for a module this deep", offset=offset))
            else:
                name = cast("Token", definition.children[0])
                yield from self._definitions(definition.children[1:], (*path, name))

    def _name(self, path: tuple[Token, ...], name: Token) -> TypeName:
        """Return the full name of a struct, after a look at the modules that it stands in."""
        if len(path) != _DEPTH:
            message = f"a struct stands in {_DEPTH} modules: the package's and, in it, a namespace"
            hint = f"module {self.source.package} {{ module msg {{ struct {name} {{ ... }}; }}; }};"
            self.report(ParseError(message, offset=name.start_pos or 0, hint=hint))
            return TypeName(self.source.package, "msg", str(name))
        package, kind = path
        if package != self.source.package:
            message = f"the module is '{package}', but the package is '{self.source.package}'"
            self.report(ParseError(message, offset=package.start_pos or 0))
        self._check_keyword(kind, "module")
        self._check_keyword(name, "struct")
        return TypeName(self.source.package, str(kind), str(name))

    def _check_keyword(self, token: Token, what: str) -> None:
        try:
            check_keyword(str(token), token.start_pos or 0, what)
        except ParseError as fault:
            self.report(fault)

    def _check_number(self, structs: list[Tree[Token]]) -> None:
        """Refuse a file whose structs are no message, no service and no action."""
        stem = PurePosixPath(self.source.relative).stem
        names = [cast("Token", struct.children[0]) for struct in structs]
        if not 1 <= len(names) <= len(_SECTIONS) + 1:
            message = (
                f"an .idl file has 1 struct (a message), 2 (a service) or 3 (an action), not {len(names)}"
            )
            self.problems.append(Problem(message, Place(str(self.source.path))))
            return
        for name, suffix in zip(names, _SECTIONS.get(len(names), ("",)), strict=True):
            if name != stem + suffix:
                hint = f"by the file's name it is '{stem}{suffix}'"
                fault = ParseError(f"struct '{name}' has another name", offset=name.start_pos or 0, hint=hint)
                self.report(fault)
        if len({message.name.kind for message in self._messages}) > 1:
            fault = ParseError("the structs of a file are in one module", offset=names[1].start_pos or 0)
            self.report(fault)
