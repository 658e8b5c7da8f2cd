"""compile_commands.json for the whole workspace, joined from those that CMake writes for each package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.files import write_if_changed

if TYPE_CHECKING:
    from pathlib import Path

FILE = "compile_commands.json"


def merge_compile_commands(build: Path, *, anew: bool = False) -> bool:
    """Join the packages' files below `build` into one there; tell if that was written.

    Nothing is read while no package's file is newer, unless it is to be made `anew`, as after a package
    went away. Files are joined as text: they may be large, and each is a list of its own.
    """
    whole = build / FILE
    parts = sorted(build.glob(f"*/{FILE}"))
    if not parts:
        whole.unlink(missing_ok=True)
        return False
    if not anew and whole.is_file():
        made = whole.stat().st_mtime_ns
        if all(part.stat().st_mtime_ns <= made for part in parts):
            return False
    bodies = (_body(part.read_text(encoding="utf-8", errors="surrogateescape")) for part in parts)
    text = "[\n" + ",\n".join(filter(None, bodies)) + "\n]\n"
    return write_if_changed(whole, text)


def _body(text: str) -> str:
    """Return what is between the brackets of a list; nothing when it was left half-written."""
    text = text.strip()
    return text[1:-1].strip("\r\n ") if text.startswith("[") and text.endswith("]") else ""
