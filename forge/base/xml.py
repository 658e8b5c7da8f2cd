"""Parses XML into a small tree with positions: elements with line, column and inner text.

Document type declarations are rejected, because entities allow exponential expansion; so is excessive
nesting.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING
from xml.parsers import expat

from forge.base.errors import Location, Problem, WorkspaceError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


DEEPEST = 100
"""Maximum nesting depth of elements."""

_START_TAG = re.compile(rb"""(?:[^"'>]|"[^"]*"|'[^']*')*>""")
"""The rest of a start tag; '>' inside quoted attributes does not end it."""

_LEFT_OPEN = frozenset(
    expat.errors.codes[text]
    for text in (expat.errors.XML_ERROR_TAG_MISMATCH, expat.errors.XML_ERROR_NO_ELEMENTS)
)


@dataclass(slots=True)
class Element:
    """An element: bytes `start` to `end` of `content`; `text` is its direct text."""

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
        """The content between start and end tag, as written."""
        written = self.content[self.start : self.end]
        tag = _START_TAG.match(written)
        return written[tag.end() if tag else len(written) :].decode(errors="replace")

    def all(self, tag: str) -> Iterator[Element]:
        """Yield the direct children with this tag."""
        return (child for child in self.children if child.tag == tag)


def parse_xml(content: bytes, path: Path) -> Element:
    """Return the root element of an XML document; raises WorkspaceError with the position of an error."""
    builder = _Builder(content)
    try:
        builder.parser.Parse(content, True)  # noqa: FBT003  (expat's own signature)
    except expat.ExpatError as error:
        problem = _problem(expat.ErrorString(error.code), content, path, error.lineno, error.offset + 1)
        raise WorkspaceError(replace(problem, hint=builder.remedy(error.code))) from None
    except _RefusedError as error:
        raise WorkspaceError(_problem(str(error), content, path, error.line, None)) from None
    assert builder.root is not None  # noqa: S101  (expat rejects a document without a root)
    return builder.root


class _RefusedError(Exception):
    """Well-formed XML that is rejected."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class _Builder:
    """Builds the tree from expat's callbacks."""

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
            raise _RefusedError(
                f"elements are nested more than {DEEPEST} levels deep", parser.CurrentLineNumber
            )
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
        """Return a hint for an expat error code."""
        if code in _LEFT_OPEN and self.open:
            element = self.open[-1]
            return f"<{element.tag}> in line {element.line} is not closed: add </{element.tag}>"
        try:
            self.content.decode()
        except UnicodeDecodeError:
            return "the file is not valid UTF-8: save it as UTF-8"
        return None

    def characters(self, text: str) -> None:
        self.texts[-1].append(text)

    def doctype(self, *_: object) -> None:
        raise _RefusedError("document type declarations are not allowed", self.parser.CurrentLineNumber)


def _problem(message: str, content: bytes, path: Path, line: int, column: int | None) -> Problem:
    lines = content.decode(errors="replace").split("\n")
    source = lines[line - 1].rstrip("\r") if line <= len(lines) else None
    return Problem(f"not well-formed XML: {message}", Location(path, line, column, source))
