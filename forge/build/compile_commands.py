"""Join the packages' compile_commands.json files into one for the workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.files import write_if_changed
from forge.base.layout import COMPILE_COMMANDS

if TYPE_CHECKING:
    from pathlib import Path


def merge_compile_commands(build: Path, *, force: bool = False) -> bool:
    """Join the packages' files into `build`/compile_commands.json; return True if it was written.

    Nothing is read if no package's file is newer, except with `force`, which is needed after a package was
    removed. Files are joined as text, since they may be large.
    """
    target = build / COMPILE_COMMANDS
    sources = sorted(build.glob(f"*/{COMPILE_COMMANDS}"))
    if not sources:
        target.unlink(missing_ok=True)
        return False
    if not force and target.is_file():
        made = target.stat().st_mtime_ns
        if all(part.stat().st_mtime_ns <= made for part in sources):
            return False
    bodies = (_body(part.read_text(encoding="utf-8", errors="surrogateescape")) for part in sources)
    text = "[\n" + ",\n".join(filter(None, bodies)) + "\n]\n"
    return write_if_changed(target, text)


def _body(text: str) -> str:
    """Return the text between the brackets of a list, or '' if the file is incomplete."""
    text = text.strip()
    return text[1:-1].strip("\r\n ") if text.startswith("[") and text.endswith("]") else ""
