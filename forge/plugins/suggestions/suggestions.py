"""Suggestions for mistyped commands, options and values."""

from __future__ import annotations

import re
from collections.abc import Collection

from forge.base.names import did_you_mean, nearest

_COMMAND = re.compile(r"argument COMMAND: invalid choice: '([^']*)'")
_CHOICE = re.compile(r"argument .*?: invalid choice: '([^']*)' \(choose from (.*)\)$")
_UNKNOWN = re.compile(r"unrecognized arguments: (\S+)")
_ROS2 = frozenset(
    {"action", "bag", "component", "control", "daemon", "launch", "lifecycle", "multicast", "node", "param"}
    | {"plugin", "security", "service", "topic", "wtf"}
)
"""Commands of `ros2` that forge does not have, because they communicate with running nodes."""

_ELSEWHERE = {
    "compile": "build",
    "create": "pkg create",
    "ls": "list",
    "make": "build",
    "new": "pkg create",
    "rebuild": "build --force",
    "remove": "clean packages",
    "show": "interface show",
    "watch": "build --watch",
}
"""Commands of other build tools, and their equivalents in forge."""
_DASHES = "\u2010\u2011\u2012\u2013\u2014\u2015\u2212\ufe58\ufe63\uff0d"
"""Characters that editors and web pages show in place of '-' or '--'."""
_SELECT = "--packages-select"
_CMAKE_ARGS = "--cmake-args"
_BUILD_TYPES = {
    "--release": "Release",
    "--debug": "Debug",
    "--relwithdebinfo": "RelWithDebInfo",
    "--build-type": "Release",
}
"""Options of other build tools for CMake's build type."""


def suggestion(message: str, commands: Collection[str], options: Collection[str]) -> str:
    """Return what to type instead of a command line that argparse rejected, '' if unknown."""
    command, choice, unknown = (pattern.match(message) for pattern in (_COMMAND, _CHOICE, _UNKNOWN))
    if command:
        word = command[1]
        if word in _ELSEWHERE:
            return f"did you mean 'forge {_ELSEWHERE[word]}'?"
        if word in _ROS2:
            return (
                f"'ros2' has it: forge shell -- ros2 {word}; it is part of a ROS installation, "
                f"and of the packages that 'forge fetch ros2{word}' fetches"
            )
        if word == "cd":
            return "a program cannot change the folder of its shell; 'forge completion' defines 'forge_cd'"
        return did_you_mean(word, commands) or ""
    if choice:
        return did_you_mean(choice[1], (word.strip("'") for word in choice[2].split(", "))) or ""
    return _instead(unknown[1], options) if unknown else ""


def _instead(argument: str, options: Collection[str]) -> str:
    word = argument.partition("=")[0]
    if word.startswith(tuple(_DASHES)):
        name = word.lstrip(f"-{_DASHES}")
        meant = f"-{name}" if len(name) == 1 else f"--{name}"
        correction = meant if meant in options else _instead(meant, options).partition("'")[2].rstrip("'?")
        return f"'{word[0]}' is not '-': write '{correction or meant}'"
    if not word.startswith("-"):
        return f"to select packages: '{_SELECT} {word}'" if word and _SELECT in options else ""
    if word.startswith("-D") and _CMAKE_ARGS in options:
        return f"to define a variable of CMake: '{_CMAKE_ARGS} {argument}'"
    if word in _BUILD_TYPES and _CMAKE_ARGS in options:
        return f"to set the build type: '{_CMAKE_ARGS} -DCMAKE_BUILD_TYPE={_BUILD_TYPES[word]}'"
    # With their common dashes, short options would be similar to each other.
    names = {option.lstrip("-"): option for option in options if option.startswith("--")}
    near = nearest(word.lstrip("-"), names)
    return f"did you mean '{names[near]}'?" if near else ""
