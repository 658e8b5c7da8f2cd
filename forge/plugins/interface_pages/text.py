"""Comments as text for HTML pages; the templates escape it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.notation import visible

if TYPE_CHECKING:
    from collections.abc import Iterable

_PREFORMATTED = re.compile(r"^\s|\S {2,}\S|\t", re.MULTILINE)
_SENTENCE = re.compile(r"(.+?[.!?])(?:\s|$)")
_LONGEST_SUMMARY = 160

TITLES = {1: ("",), 2: ("Request", "Response"), 3: ("Goal", "Result", "Feedback")}
"""The titles of the messages of an interface, by their number."""


@frozen
class Paragraph:
    """A paragraph of a comment; white space in preformatted ones is kept."""

    text: str
    preformatted: bool = False


def paragraphs(doc: Iterable[str]) -> tuple[Paragraph, ...]:
    """Split a comment at blank lines."""
    blocks = re.split(r"\n(?:[ \t]*\n)+", visible("\n".join(doc)).strip("\n"))
    return tuple(
        Paragraph(block, preformatted=bool(_PREFORMATTED.search(block))) for block in blocks if block.strip()
    )


def summary(doc: Iterable[str]) -> str:
    """Return the first sentence of a comment on one line; an empty text if there is no comment."""
    first = next((" ".join(each.text.split()) for each in paragraphs(doc)), "")
    sentence = _SENTENCE.match(first)
    text = sentence[1] if sentence else first
    return text if len(text) <= _LONGEST_SUMMARY else f"{text[:_LONGEST_SUMMARY].rstrip()} …"
