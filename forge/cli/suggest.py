"""Suggestions for mistyped commands and options."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable

_CHOICE = re.compile(r"argument COMMAND: invalid choice: '([^']*)'")
_UNKNOWN = re.compile(r"unrecognized arguments: (\S+)")
_ROS2 = frozenset(
    {"action", "bag", "component", "control", "daemon", "launch", "lifecycle", "multicast", "node", "param"}
    | {"plugin", "security", "service", "topic", "wtf"}
)
"""Commands of `ros2` that forge does not have, because they communicate with running nodes."""

_SELECT = "--packages-select"


def suggestion(message: str, commands: Iterable[str], options: Iterable[str]) -> tuple[str, str | None]:
    """Return a shorter form of argparse's error message, and a suggestion.

    `options` are those of the requested command.
    """
    choice, unknown = _CHOICE.match(message), _UNKNOWN.match(message)
    if choice:
        word = choice[1]
        hint = did_you_mean(word, commands)
        if word in _ROS2:
            hint = f"'ros2 {word}' is part of a ROS installation: source that first"
        if word == "cd":
            hint = "a program cannot change the folder of its shell; 'forge completion' defines 'forge_cd'"
        return f"unknown command '{word}'", hint
    if unknown:
        return message, _instead(unknown[1].partition("=")[0], frozenset(options))
    return message, None


def _instead(word: str, options: frozenset[str]) -> str | None:
    if word.startswith("-"):
        return did_you_mean(word, options)
    return f"to select packages: '{_SELECT} {word}'" if _SELECT in options else None
