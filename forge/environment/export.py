"""Formats environment variables for other programs: sh, JSON, and .env files."""

from __future__ import annotations

import json
import re
import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

_SPECIAL = re.compile(r'[\\"$`]')
_ESCAPED = r"\\\g<0>"


def as_sh(variables: Mapping[str, str], gone: Iterable[str]) -> str:
    """Return lines for `eval` in POSIX shells."""
    lines = [f"export {name}={shlex.quote(value)}" for name, value in sorted(variables.items())]
    return "".join(f"{line}\n" for line in (*lines, *(f"unset {name}" for name in sorted(gone))))


def as_json(variables: Mapping[str, str], gone: Iterable[str]) -> str:
    """Return an object with strings for variables that are set and null for unset ones."""
    return json.dumps({**variables, **dict.fromkeys(gone)}, indent=2, sort_keys=True) + "\n"


def as_dotenv(variables: Mapping[str, str], gone: Iterable[str]) -> str:
    """Return a .env file for editors and containers; it cannot unset variables."""
    del gone
    lines = (f'{name}="{_SPECIAL.sub(_ESCAPED, value)}"' for name, value in sorted(variables.items()))
    return "".join(f"{line}\n" for line in lines)


FORMATS: Mapping[str, Callable[[Mapping[str, str], Iterable[str]], str]] = {
    "sh": as_sh,
    "json": as_json,
    "dotenv": as_dotenv,
}
"""The formats by the name on the command line."""
