"""What was meant by a word that the command line does not know; pure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable

_CHOICE = re.compile(r"argument COMMAND: invalid choice: '([^']*)'")
_UNKNOWN = re.compile(r"unrecognized arguments: (\S+)")
_ROS2 = frozenset(
    {"action", "bag", "component", "control", "daemon", "launch", "lifecycle", "multicast", "node", "param"}
    | {"plugin", "security", "service", "topic", "wtf"}
)
"""Commands of `ros2` that forge does not have: they talk to running nodes."""

_SELECT = "--packages-select"


def meant(message: str, commands: Iterable[str], options: Iterable[str]) -> tuple[str, str | None]:
    """Return what is wrong with a command line, in few words, and what to type instead.

    `message` is argparse's; `options` are those of the command that was asked for.
    """
    choice, unknown = _CHOICE.match(message), _UNKNOWN.match(message)
    if choice:
        word = choice[1]
        hint = did_you_mean(word, commands)
        if word in _ROS2:
            hint = f"'ros2 {word}' is part of an installed ROS: source that first"
        return f"'{word}' is no command of forge", hint
    if unknown:
        return message, _instead(unknown[1].partition("=")[0], frozenset(options))
    return message, None


def _instead(word: str, options: frozenset[str]) -> str | None:
    if word.startswith("-"):
        return did_you_mean(word, options)
    return f"to choose packages: '{_SELECT} {word}'" if _SELECT in options else None
