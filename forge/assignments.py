"""Variables as text that other programs read: sh, JSON, and the .env files of editors; pure."""

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
    """Return lines for `eval`, in any shell of the family of sh."""
    lines = [f"export {name}={shlex.quote(value)}" for name, value in sorted(variables.items())]
    return "".join(f"{line}\n" for line in (*lines, *(f"unset {name}" for name in sorted(gone))))


def as_json(variables: Mapping[str, str], gone: Iterable[str]) -> str:
    """Return an object: a text for each variable that is set, null for each that is taken away."""
    return json.dumps({**variables, **dict.fromkeys(gone)}, indent=2, sort_keys=True) + "\n"


def as_dotenv(variables: Mapping[str, str], gone: Iterable[str]) -> str:
    """Return what editors and containers read; such a file cannot take a variable away."""
    del gone
    lines = (f'{name}="{_SPECIAL.sub(_ESCAPED, value)}"' for name, value in sorted(variables.items()))
    return "".join(f"{line}\n" for line in lines)


FORMATS: Mapping[str, Callable[[Mapping[str, str], Iterable[str]], str]] = {
    "sh": as_sh,
    "json": as_json,
    "dotenv": as_dotenv,
}
"""By the word on the command line."""
