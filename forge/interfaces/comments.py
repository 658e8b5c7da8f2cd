"""What comments say about a declaration: its documentation and its unit (interface spec 1.7)."""

from __future__ import annotations

import re
import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

_UNIT = re.compile(r"\s*\[([^,\]]+)\]")


def read_comments(lines: Iterable[str]) -> tuple[tuple[str, ...], str | None]:
    """Return the documentation and the unit in comment lines that still have their '#'.

    The inside of brackets is the unit when there is exactly one such pair, and leaves the text.
    """
    texts = [line.lstrip("#").rstrip() for line in lines]
    texts, unit = _without_unit(texts)
    if len(texts) == 1:
        return ((texts[0].lstrip(),) if texts[0] else ()), unit
    squeezed = [text for number, text in enumerate(texts) if text or (number and texts[number - 1])]
    block = "\n".join(squeezed).strip("\n")
    return tuple(textwrap.dedent(block).split("\n")) if block else (), unit


def _without_unit(texts: list[str]) -> tuple[list[str], str | None]:
    found = list(_UNIT.finditer("\n".join(texts)))
    if len(found) != 1:
        return texts, None
    # Where the blanks before the bracket span lines, no line holds the whole, and the text stays.
    return [text.replace(found[0].group(), "").rstrip() for text in texts], found[0][1]
