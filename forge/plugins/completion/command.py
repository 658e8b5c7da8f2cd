"""`forge completion`: print a shell completion script.

The script contains a table of all options and fixed words, and passes it to `words.py`, which also
finds names, such as those of packages.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from forge.base.extensions import COMMANDS as PLUGINS
from forge.base.extensions import OWN, is_installed
from forge.base.frozen import frozen
from forge.base.options import option
from forge.base.templating import render
from forge.cli import main
from forge.cli.colcon_options import COLCON_OPTIONS, PASSED_ON
from forge.output.handlers import HANDLERS

_KINDS = {
    "PKG": "packages",
    "DIR": "folders",
    "PATH": "files",
    "FILE": "files",
    "SOURCE_DIR": "folders",
    "REPOSITORY": "repositories",
    "TYPE": "interfaces",
    "TYPE|SOURCE_DIR": "interfaces",
}
"""Kinds of values by metavar: names that words.py finds, and paths that shells complete."""
_POSITIONAL_KINDS = {
    "run": "runnable",
    "pkg executables": "installed",
    "pkg prefix": "installed",
    "pkg xml": "installed",
    "interface package": "interface_packages",
    "interface docs": "interface_packages",
}
_CMAKE_BUILD_TYPES = ("Debug", "Release", "RelWithDebInfo", "MinSizeRel")


@frozen
class Options:
    shell: str = option("shell to print the script for", positional=True, choices=("bash", "zsh", "fish"))


def run(options: Options) -> int:
    table = json.dumps(dict(_contexts()), separators=(",", ":"))
    if options.shell == "fish":
        table = table.replace("\\", "\\\\").replace("'", "\\'")
        table = f"'{table}'"
    else:
        table = shlex.quote(table)
    program = Path(__file__).with_name("words.py")
    answer = shlex.join((sys.executable, "-S", "-E", str(program)))
    print(render(f"completion/templates/{options.shell}.j2", answer=answer, table=table), end="")
    return 0


def _contexts() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the words that can follow each command and verb, derived from the parsers."""
    yield "", _context("", main.parser_of([]))
    for word in main.COMMANDS:
        if word in OWN[PLUGINS] and not is_installed(PLUGINS, word):
            continue
        commands = _verbs(main.parser_of([word]))
        assert commands is not None
        command = commands.choices[word]
        yield word, _context(word, command)
        verbs = _verbs(command)
        for verb, parser in verbs.choices.items() if verbs else ():
            yield f"{word} {verb}", _context(f"{word} {verb}", parser)
        for verb in _first_words(command):
            yield f"{word} {verb}", {**_context(f"{word} {verb}", command), "words": {}}


def _context(path: str, parser: argparse.ArgumentParser) -> dict[str, Any]:
    """Return subcommands, options, positional values, and the options that end a list of arguments.

    An option that is not offered has no summary.
    """
    actions = [action for action in parser._actions if action.help != argparse.SUPPRESS]
    verbs = _verbs(parser)
    positionals = [action for action in actions if not action.option_strings and action is not verbs]
    words = {choice.dest: choice.help or "" for choice in verbs._choices_actions} if verbs else {}
    if first := _first_words(parser):
        words = dict.fromkeys(first, "")
        # Package names follow only the choice 'packages', as in `clean packages a b`.
        positionals = positionals[1:] if path.endswith(" packages") else []
    options: dict[str, list[str | None]] = {}
    for action in actions:
        long = [flag for flag in action.option_strings if flag.startswith("--")]
        for flag in action.option_strings:
            offered = flag in long or not long
            summary = (action.help or "").replace("%%", "%") if offered else None
            options[flag] = [summary, *(_expected(action, path) if action.nargs != 0 else ())]
    rest = _expected(positionals[0], path) if positionals else []
    if path == "help":
        rest = ["many", "words", *main.COMMANDS]
    elif path in _POSITIONAL_KINDS:
        rest = ["many", _POSITIONAL_KINDS[path]]
    ends = sorted(COLCON_OPTIONS.get(path, ()))
    return {"words": words, "options": options, "rest": rest, "ends": ends}


def _verbs(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser] | None:
    return next(
        (action for action in parser._actions if isinstance(action, argparse._SubParsersAction)), None
    )


def _first_words(parser: argparse.ArgumentParser) -> tuple[str, ...]:
    """Return the choices of the first positional argument if others follow it; they act like verbs."""
    positionals = [action for action in parser._actions if not action.option_strings]
    return tuple(positionals[0].choices or ()) if len(positionals) > 1 else ()


def _expected(action: argparse.Action, path: str) -> list[str]:
    """Return the value of an option or positional argument: one, many or passed on, its kind, and words."""
    number = "many" if action.nargs in {"*", "+"} else "one"
    if action.dest == "mixin":
        return [number, "mixins", path.partition(" ")[0]]
    if action.dest == "profile":
        return [number, "profiles"]
    if action.dest == "cmake_args":
        return ["passed", "words", *(f"-DCMAKE_BUILD_TYPE={word}" for word in _CMAKE_BUILD_TYPES)]
    if not PASSED_ON.isdisjoint(action.option_strings):
        return ["passed", "anything"]
    if action.dest == "event_handlers":
        return [number, "words", *(f"{name}{'-' if enabled else '+'}" for name, enabled in HANDLERS.items())]
    if action.choices:
        return [number, "words", *map(str, action.choices)]
    if action.dest in {"base_paths", "paths"}:
        return [number, "folders"]
    return [number, _KINDS.get(str(action.metavar), "anything")]
