"""Colours of text on terminals, by meaning.

NO_COLOR disables colours only. CLICOLOR_FORCE and FORCE_COLOR enable them for files and pipes, too.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Literal, TextIO

from forge.base.frozen import frozen

Meaning = Literal["success", "failure", "error", "warning", "note", "hint", "name", "detail"]

_CODES: Mapping[str, str] = {
    "success": "1;32",
    "failure": "1;31",
    "error": "1;31",
    "warning": "1;33",
    "note": "1;34",
    "hint": "1;36",
    "name": "1",
    "detail": "2",
}
"""Colours of the terminal's theme, which are readable on its background."""


@frozen
class Palette:
    enabled: bool = False

    def paint(self, meaning: Meaning, text: str) -> str:
        """Return a text in the colour of its meaning, unchanged if colours are disabled."""
        return f"\x1b[{_CODES[meaning]}m{text}\x1b[0m" if self.enabled else text


def palette_of(stream: TextIO, variables: Mapping[str, str] = os.environ) -> Palette:
    if variables.get("NO_COLOR"):
        return Palette(False)
    if any(variables.get(name, "0") not in {"", "0"} for name in ("CLICOLOR_FORCE", "FORCE_COLOR")):
        return Palette(True)
    plain = variables.get("CLICOLOR") == "0" or variables.get("TERM", "") in {"", "dumb"}
    return Palette(not plain and stream.isatty())


def colourless(text: str) -> str:
    """Return a text without escape sequences."""
    return re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", text)
