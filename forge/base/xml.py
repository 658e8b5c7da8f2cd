"""Parses XML into a small tree with positions: elements with line, column and inner text.

Document type declarations are rejected, because entities allow exponential expansion; so is excessive
nesting.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from forge.base.errors import Location, Problem, WorkspaceError

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
        start = self.end if self.inner_start is None else self.inner_start
        return self.content[start : self.end].decode(errors="replace")

    @property
    def inner_start(self) -> int | None:
        """The first byte after the start tag, None if the element has no end tag."""
        tag = _START_TAG.match(self.content, self.start, self.end)
        return tag.end() if tag else None

    def place(self, path: Path) -> Location:
        return place_in(self.content, path, self.line, self.column)

    def all(self, tag: str) -> Iterator[Element]:
        return (child for child in self.children if child.tag == tag)


def parse_xml(content: bytes, path: Path) -> Element:
    """Return the root element of an XML document; raises WorkspaceError with the position of an error."""
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    document = Element("", {}, 0, 0, 0, content)
    open_elements, texts = [document], [list[str]()]

    def error_at(
        message: str, line: int, column: int | None = None, hint: str | None = None
    ) -> WorkspaceError:
        place = place_in(content, path, line, column)
        return WorkspaceError(Problem(f"not well-formed XML: {message}", place, hint))

    def start(tag: str, attributes: dict[str, str]) -> None:
        line, column = parser.CurrentLineNumber, parser.CurrentColumnNumber + 1
        if len(open_elements) > DEEPEST:
            raise error_at(f"elements are nested more than {DEEPEST} levels deep", line)
        element = Element(tag, attributes, line, column, parser.CurrentByteIndex, content)
        open_elements[-1].children.append(element)
        open_elements.append(element)
        texts.append([])

    def end(_tag: str) -> None:
        element = open_elements.pop()
        element.end, element.text = parser.CurrentByteIndex, "".join(texts.pop())

    def refuse_doctype(*_: object) -> None:
        raise error_at("document type declarations are not allowed", parser.CurrentLineNumber)

    def remedy(code: int) -> str | None:
        if code in _LEFT_OPEN and open_elements[1:]:
            element = open_elements[-1]
            return f"<{element.tag}> in line {element.line} is not closed: add </{element.tag}>"
        try:
            content.decode()
        except UnicodeDecodeError:
            return "the file is not valid UTF-8: save it as UTF-8"
        return None

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = lambda text: texts[-1].append(text)
    parser.StartDoctypeDeclHandler = refuse_doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        message, hint = expat.ErrorString(error.code), remedy(error.code)
        raise error_at(message, error.lineno, error.offset + 1, hint) from None
    return document.children[0]


def place_in(content: bytes, path: Path, line: int, column: int | None) -> Location:
    """Return a position in a document, with its line."""
    lines = content.decode(errors="replace").split("\n")
    return Location(path, line, column, lines[line - 1].rstrip("\r") if line <= len(lines) else None)


def as_utf8(content: bytes, path: Path) -> bytes:
    """Return an XML document in UTF-8; raises WorkspaceError if its declared encoding is wrong or unknown."""
    mark = next((name for start, name in _ENCODING_MARKS if content.startswith(start)), None)
    declared = _DECLARED_ENCODING.match(content)
    encoding = mark or (declared[1].decode() if declared else "utf-8")
    try:
        text = content.decode(encoding)
    except LookupError:
        raise WorkspaceError(Problem(f"unknown encoding '{encoding}'", Location(path, 1))) from None
    except ValueError as error:
        problem = Problem(f"the file is not valid {encoding}: {error}", Location(path))
        raise WorkspaceError(problem) from None
    return text.removeprefix("\ufeff").encode(errors="surrogatepass")


def mentions(content: bytes, text: str) -> bool:
    """Return True if a document contains an ASCII text, in bytes or in wider characters."""
    return any(text.encode(encoding) in content for encoding in ("ascii", *_WIDE))


_WIDE = ("utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be")

_ENCODING_MARKS = (
    *((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32")),
    *((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")),
    *((b"<\0\0\0", "utf-32-le"), (b"\0\0\0<", "utf-32-be"), (b"<\0", "utf-16-le"), (b"\0<", "utf-16-be")),
)
"""Byte patterns that identify an encoding without a declaration, longest first."""

_DECLARED_ENCODING = re.compile(rb"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([A-Za-z][A-Za-z0-9._-]*)["']""")
