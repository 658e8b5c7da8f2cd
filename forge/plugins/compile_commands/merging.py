"""Join the packages' compile_commands.json files into one for the workspace."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from forge.base.files import write_if_changed
from forge.base.layout import COMPILE_COMMANDS

_UNIT = "/Unity/unity_"
"""The part of a path that identifies CMake's unity files."""
_INCLUDED = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def merge_compile_commands(build: Path, *, force: bool = False) -> bool:
    """Join the packages' files into `build`/compile_commands.json; return True if it was written.

    No file is read if no package was configured since, except with `force`, which is needed after a package
    was removed. Files are joined as text, since they may be large; only those with units are parsed.
    """
    target = build / COMPILE_COMMANDS
    sources = sorted(build.glob(f"*/{COMPILE_COMMANDS}"))
    if not sources:
        target.unlink(missing_ok=True)
        return False
    if not force and target.is_file():
        # A configure run may change only the units of a package.
        read = (
            path for part in sources for path in (part, part.with_name("CMakeCache.txt")) if path.exists()
        )
        if max(path.stat().st_mtime_ns for path in read) <= target.stat().st_mtime_ns:
            return False
    bodies = (_body(part.read_text(encoding="utf-8", errors="surrogateescape")) for part in sources)
    text = "[\n" + ",\n".join(filter(None, bodies)) + "\n]\n"
    return write_if_changed(target, text)


def _body(text: str) -> str:
    """Return the text between the brackets of a list, or '' if the file is incomplete."""
    text = text.strip()
    if not (text.startswith("[") and text.endswith("]")):
        return ""
    if _UNIT in text:
        try:
            entries = [each for entry in json.loads(text) for each in _sources(entry)]
        except (ValueError, TypeError, AttributeError, RecursionError):  # not a list of objects
            return ""
        text = json.dumps(entries, indent=2)
    return text[1:-1].strip("\r\n ")


def _sources(entry: dict[str, str]) -> Iterator[dict[str, str]]:
    """Yield an entry for each source of a unit, which editors look for; yield any other entry unchanged."""
    unit = entry.get("file", "")
    if _UNIT not in unit:
        yield entry
        return
    try:
        text = Path(unit).read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return
    for source in _INCLUDED.findall(text):
        command = entry.get("command", "").replace(unit, source)
        yield {"directory": entry.get("directory", ""), "command": command, "file": source}
