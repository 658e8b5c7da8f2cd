"""Rules about names: what a package may be called, snake case, near misses."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

_PACKAGE = re.compile(r"[a-zA-Z0-9][a-zA-Z0-9_-]*")
_WORD = re.compile(r"\w[\w.+-]{0,199}")
_EMAIL = re.compile(r"[-a-zA-Z0-9_%+]+(\.[-a-zA-Z0-9_%+]+)*@[-a-zA-Z0-9%]+(\.[-a-zA-Z0-9%]+)*\.[a-zA-Z]{2,}")
_LOWER_THEN_WORD = re.compile(r"(.)([A-Z][a-z]+)")
_LOWER_THEN_UPPER = re.compile(r"([a-z0-9])([A-Z])")


def is_package_name(text: str) -> bool:
    """Tell if a package may be called so (workspace spec 1.2)."""
    return _PACKAGE.fullmatch(text) is not None


def is_word(text: str) -> bool:
    """Tell if a name is fit for folders, scripts and CMake, whatever it names and whoever gave it.

    Every name of a package is, and those of Python projects and of other folders mostly are.
    """
    return _WORD.fullmatch(text) is not None


def is_below(path: str) -> bool:
    """Tell if a path stays in the folder that it is relative to, as far as its text says, and on one line."""
    return bool(path) and path.isprintable() and not path.startswith("/") and ".." not in path.split("/")


def is_email(text: str) -> bool:
    """Tell if a manifest accepts this as an e-mail address (workspace spec 1.2)."""
    return _EMAIL.fullmatch(text) is not None


def snake_case(name: str) -> str:
    """Return rosidl's file name for an interface: 'UInt8' gives 'u_int8', 'ColorRGBA' 'color_rgba'."""
    return _LOWER_THEN_UPPER.sub(r"\1_\2", _LOWER_THEN_WORD.sub(r"\1_\2", name)).lower()


def did_you_mean(name: str, known: Iterable[str], nearness: float = 0.6) -> str | None:
    """Return a hint naming the closest known name, or None when nothing is near; nearest of all is 1."""
    import difflib  # noqa: PLC0415  (6 ms at start-up for the rare mistake)

    near = difflib.get_close_matches(name, list(known), n=1, cutoff=nearness)
    return f"did you mean '{near[0]}'?" if near else None
