"""Extract documentation and unit from the comments of a declaration, as rosidl_adapter does."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable

_BRACKET = re.compile(r"\[([^,\]]*)(\]|,|\Z)")
"""A bracket up to ']', ',' or the end of the comment; it is a unit only if it ends with ']'."""


BIDI_CONTROLS = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Bidirectional control characters, which make code look different from what it does (CVE-2021-42574)."""


def read_comments(lines: Iterable[str]) -> tuple[tuple[str, ...], str | None]:
    """Return the documentation and the unit in comment lines, which include their '#'.

    If there is exactly one pair of brackets, its contents are the unit and are removed from the text.
    """
    texts = [line.lstrip("#").rstrip() for line in lines]
    block_text, unit = "\n".join(texts), None
    brackets = [bracket for bracket in _BRACKET.finditer(block_text) if bracket[1] and bracket[2] == "]"]
    if len(brackets) == 1:
        unit = brackets[0][1]
        # If the blanks before the bracket span several lines, no line contains all of it: the text is kept.
        written = block_text[len(block_text[: brackets[0].start()].rstrip()) : brackets[0].end()]
        texts = [text.replace(written, "").rstrip() for text in texts]
    if len(texts) == 1:
        return ((texts[0].lstrip(),) if texts[0] else ()), unit
    squeezed = [text for number, text in enumerate(texts) if text or (number and texts[number - 1])]
    block = "\n".join(squeezed).strip("\n")
    return tuple(textwrap.dedent(block).split("\n")) if block else (), unit
