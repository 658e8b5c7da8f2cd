"""XML text to a small tree that knows its places: elements with line, column and inner text, pure.

Document type declarations are refused: nobody here needs one, and entities are how XML is made to explode.
So is what nests deeper than any manifest or test result does.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING
from xml.parsers import expat

from forge.errors import Place, Problem, WorkspaceError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


DEEPEST = 100
"""How many elements may stand inside each other."""

_START_TAG = re.compile(rb"""(?:[^"'>]|"[^"]*"|'[^']*')*>""")
"""Up to its end: a '>' inside a quoted attribute does not end it."""

_LEFT_OPEN = frozenset(
    expat.errors.codes[text]
    for text in (expat.errors.XML_ERROR_TAG_MISMATCH, expat.errors.XML_ERROR_NO_ELEMENTS)
)


@dataclass(slots=True)
class Element:
    """An element as written: the bytes `start` to `end` of `content`; `text` stands directly inside."""

    tag: str
    attributes: dict[str, str]
    line: int
    column: int
    start: int
    content: bytes = field(repr=False)
    end: int = 0
    text: str = ""
    children: list[Element] = field(default_factory=list)

    @property
    def inner(self) -> str:
        """What stands between start and end tag, as written."""
        written = self.content[self.start : self.end]
        tag = _START_TAG.match(written)
        return written[tag.end() if tag else len(written) :].decode(errors="replace")

    def all(self, tag: str) -> Iterator[Element]:
        """Yield the direct children of that tag."""
        return (child for child in self.children if child.tag == tag)


def parse_xml(content: bytes, path: Path) -> Element:
    """Return the root element of an XML document; raises WorkspaceError with the place of a fault."""
    builder = _Builder(content)
    try:
        builder.parser.Parse(content, True)  # noqa: FBT003  (expat's own signature)
    except expat.ExpatError as error:
        problem = _problem(expat.ErrorString(error.code), content, path, error.lineno, error.offset + 1)
        raise WorkspaceError(replace(problem, hint=builder.remedy(error.code))) from None
    except _RefusedError as error:
        raise WorkspaceError(_problem(str(error), content, path, error.line, None)) from None
    assert builder.root is not None  # noqa: S101  (expat refuses a document without a root)
    return builder.root


class _RefusedError(Exception):
    """XML that is well-formed, and of no use here."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class _Builder:
    """Receives expat's calls and grows the tree."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.root: Element | None = None
        self.open: list[Element] = []
        self.texts: list[list[str]] = []
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.StartDoctypeDeclHandler = self.doctype

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        parser = self.parser
        if len(self.open) >= DEEPEST:
            raise _RefusedError(f"elements nest more than {DEEPEST} deep", parser.CurrentLineNumber)
        element = Element(
            tag,
            attributes,
            parser.CurrentLineNumber,
            parser.CurrentColumnNumber + 1,
            parser.CurrentByteIndex,
            self.content,
        )
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)
        self.texts.append([])

    def end(self, _tag: str) -> None:
        element = self.open.pop()
        element.end = self.parser.CurrentByteIndex
        element.text = "".join(self.texts.pop())

    def remedy(self, code: int) -> str | None:
        """Return what to mend, as far as expat's fault tells."""
        if code in _LEFT_OPEN and self.open:
            element = self.open[-1]
            return f"<{element.tag}> in line {element.line} is not closed: write </{element.tag}> after it"
        try:
            self.content.decode()
        except UnicodeDecodeError:
            return "the file is no UTF-8: save it again as UTF-8"
        return None

    def characters(self, text: str) -> None:
        self.texts[-1].append(text)

    def doctype(self, *_: object) -> None:
        raise _RefusedError("document type declarations are not allowed", self.parser.CurrentLineNumber)


def _problem(message: str, content: bytes, path: Path, line: int, column: int | None) -> Problem:
    lines = content.decode(errors="replace").split("\n")
    source = lines[line - 1].rstrip("\r") if line <= len(lines) else None
    return Problem(f"not well-formed XML: {message}", Place(path, line, column, source))
