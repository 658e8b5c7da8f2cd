"""Parse the text of an .idl file: the subset of OMG IDL 4.2 that rosidl supports."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, cast

from forge.base.errors import InterfaceError, Location, Problem, raise_if_any
from forge.interfaces.idl.structures import StructureReader
from forge.interfaces.model import Action, Interface, Message, Service, Source, TypeName
from forge.interfaces.read.errors import ParseError
from forge.interfaces.read.keywords import check_keyword

if TYPE_CHECKING:
    from lark import Lark, Token, Tree
    from lark.exceptions import UnexpectedInput


_SECTIONS = {2: ("_Request", "_Response"), 3: ("_Goal", "_Result", "_Feedback")}
_DEPTH = 2
"""The number of modules around a struct: the package and the namespace."""

_DEEPEST = 60
"""The maximum nesting of the syntax tree, far beyond that of any real definition."""

_UNUSED = """
    abstract any bitfield bitmask bitset exception fixed import interface local map native switch
    typeid typeprefix union valuetype void
"""
_UNSUPPORTED = frozenset(_UNUSED.split())
"""Keywords of OMG IDL 4.2 that ROS does not support."""

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


def parse_idl(source: Source) -> Interface:
    """Parse one .idl file; the namespace of the interface is that of its modules, not its folder.

    Raises InterfaceError with the first syntax error, or else with all semantic problems.
    """
    reader = read_idl(source)
    raise_if_any(sorted(reader.problems, key=lambda problem: problem.position), InterfaceError)
    return reader.interface()


def read_idl(source: Source) -> FileReader:
    """Read the definitions of a file, and collect problems and warnings.

    Raises InterfaceError with the first syntax error.
    """
    from lark.exceptions import UnexpectedInput

    text = source.text.removeprefix("\ufeff")
    reader = FileReader(source, text)
    try:
        tree = _parser().parse(text)
    except UnexpectedInput as error:
        raise InterfaceError(reader.problem(_explained(error, text))) from None
    deep = _too_deep(tree)
    if deep is not None:
        raise InterfaceError(
            reader.problem(ParseError("this is nested too deeply", offset=deep.start_pos or 0))
        )
    reader.read(tree)
    return reader


@cache
def _parser() -> Lark:
    from lark import Lark

    return Lark.open("grammar.lark", rel_to=__file__, parser="lalr")


def _too_deep(tree: Tree[Token]) -> Token | None:
    """Return a token that is nested too deeply, if any; modules are checked later."""
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
    expected = getattr(error, "accepts", None) or getattr(error, "allowed", None) or ()
    names = [shown for name, shown in _EXPECTED.items() if name in expected]
    expectation = f"{' or '.join(names[:2])} is expected" if names else None
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
    """Each scoped name of a message: its first and last word, and the message."""
    typedefs: list[Token] = field(default_factory=list)
    """The name of each typedef."""
    aliases: list[Token] = field(default_factory=list)
    """Each name of a typedef as a type."""
    structs: list[tuple[Token, TypeName]] = field(default_factory=list)
    """The name of each struct, as a word of the text and in full."""
    includes: list[Token] = field(default_factory=list)
    """The paths of #include directives, in quotes or angle brackets."""
    modules: list[Token] = field(default_factory=list)
    """The names of modules."""
    _messages: list[Message] = field(default_factory=list)
    _starts: list[int] = field(default_factory=list)
    """The offset of each line, computed on first use."""

    def read(self, tree: Tree[Token]) -> None:
        """Read all structs, with their constants and types."""
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
            word = cast("Token", definition.children[0])
            name = self._name(path, word)
            self.structs.append((word, name))
            self._messages.append(structures.message(name, definition, notes))
        self.references += structures.references
        self.typedefs += structures.typedefs
        self.aliases += structures.aliases
        self._check_number([definition for _, definition, _ in structs])

    def has_interface(self) -> bool:
        """Tell whether the number of structs is that of a message, a service or an action."""
        return 1 <= len(self._messages) <= len(_SECTIONS) + 1

    def interface(self) -> Interface:
        """Return the interface, without invalid members; call this only if there is one."""
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

    def place(self, offset: int) -> Location:
        """Return line and column of an offset in the text."""
        if not self._starts:
            self._starts = [0, *(match.end() for match in re.finditer("\n", self.text))]
        number = bisect_right(self._starts, offset)
        start = self._starts[number - 1]
        end = self.text.find("\n", start)
        line = self.text[start : None if end < 0 else end].rstrip("\r")
        return Location(str(self.source.path), number, offset - start + 1, line)

    def problem(self, error: ParseError) -> Problem:
        return Problem(error.message, self.place(error.offset), error.hint)

    def report(self, error: ParseError) -> None:
        self.problems.append(self.problem(error))

    def warn(self, error: ParseError) -> None:
        self.warnings.append(self.problem(error))

    def _definitions(
        self, children: Iterable[object], path: tuple[Token, ...]
    ) -> Iterator[tuple[tuple[Token, ...], list[Tree[Token]], Tree[Token]]]:
        for child in cast("Iterable[Tree[Token]]", children):
            if child.data != "definition":
                self.includes.append(cast("Token", child.children[0]))
                continue
            *annotations, definition = cast("list[Tree[Token]]", child.children)
            if definition.data != "module":
                yield path, annotations, definition
            elif len(path) > _DEPTH:
                offset = cast("Token", definition.children[0]).start_pos or 0
                self.report(ParseError("modules are nested too deeply", offset=offset))
            else:
                name = cast("Token", definition.children[0])
                self.modules.append(name)
                yield from self._definitions(definition.children[1:], (*path, name))

    def _name(self, path: tuple[Token, ...], name: Token) -> TypeName:
        if len(path) != _DEPTH:
            message = f"a struct must be inside {_DEPTH} modules: the package and a namespace"
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
        except ParseError as error:
            self.report(error)

    def _check_number(self, structs: list[Tree[Token]]) -> None:
        stem = PurePosixPath(self.source.relative).stem
        names = [cast("Token", struct.children[0]) for struct in structs]
        if not self.has_interface():
            message = f"expected 1 struct (a message), 2 (a service) or 3 (an action), found {len(names)}"
            self.problems.append(Problem(message, Location(str(self.source.path))))
            return
        for name, suffix in zip(names, _SECTIONS.get(len(names), ("",)), strict=True):
            if name != stem + suffix:
                hint = f"rename it to '{stem}{suffix}'"
                error = ParseError(
                    f"the name of struct '{name}' does not match the file",
                    offset=name.start_pos or 0,
                    hint=hint,
                )
                self.report(error)
        if len({message.name.kind for message in self._messages}) > 1:
            error = ParseError("all structs of a file must be in one module", offset=names[1].start_pos or 0)
            self.report(error)
