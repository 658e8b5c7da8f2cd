"""`forge completion`: print a shell completion script."""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.extensions import COMMANDS as PLUGINS
from forge.base.extensions import OWN, is_installed
from forge.base.frozen import frozen
from forge.base.options import option
from forge.cli import main
from forge.cli.colcon_options import COLCON_OPTIONS, PASSED_ON
from forge.cli.completing import (
    ANYTHING,
    FILES,
    FOLDERS,
    INSTALLED,
    INTERFACE_PACKAGES,
    INTERFACES,
    MIXINS,
    PACKAGES,
    PROFILES,
    REPOSITORIES,
    RUNNABLE,
    SHELLS,
    WORDS,
    CompletionContext,
    CompletionOption,
    Expected,
    completion,
)
from forge.output.handlers import HANDLERS

if TYPE_CHECKING:
    from collections.abc import Iterator

_METAVARS = {
    "PKG": PACKAGES,
    "DIR": FOLDERS,
    "PATH": FILES,
    "FILE": FILES,
    "SOURCE_DIR": FOLDERS,
    "REPOSITORY": REPOSITORIES,
    "TYPE": INTERFACES,
    "TYPE|SOURCE_DIR": INTERFACES,
}
_CMAKE_BUILD_TYPES = ("Debug", "Release", "RelWithDebInfo", "MinSizeRel")


@frozen
class Options:
    shell: str = option("shell to print the script for", positional=True, choices=SHELLS)


def run(options: Options) -> int:
    helper_command = (sys.executable, "-S", "-E", str(Path(main.__file__).with_name("completion_words.py")))
    print(completion(options.shell, list(_contexts()), helper_command), end="")
    return 0


def _contexts() -> Iterator[CompletionContext]:
    """Yield the completions for each command and verb, derived from the parsers."""
    for word in main.COMMANDS:
        if word in OWN[PLUGINS] and not is_installed(PLUGINS, word):
            continue
        whole = main.parser_of([word])
        commands = _verbs(whole)
        if word == next(iter(main.COMMANDS)):
            yield _context((), whole)
        command = commands.choices[word] if commands else whole
        yield _context((word,), command)
        verbs = _verbs(command)
        for verb, parser in verbs.choices.items() if verbs else ():
            yield _context((word, verb), parser)
        for verb in _first_words(command):
            yield replace(_context((word, verb), command), words=())


def _context(path: tuple[str, ...], parser: argparse.ArgumentParser) -> CompletionContext:
    actions = [action for action in parser._actions if action.help != argparse.SUPPRESS]
    verbs = _verbs(parser)
    options = tuple(_option(action, path) for action in actions if action.option_strings)
    positionals = [action for action in actions if not action.option_strings and action is not verbs]
    words = tuple((a.dest, a.help or "") for a in verbs._choices_actions) if verbs else ()
    first = _first_words(parser)
    if first:
        words = tuple((word, "") for word in first)
        # Package names follow only the choice 'packages', as in `clean packages a b`.
        positionals = positionals[1:] if path[-1] == PACKAGES else []
    ends_list = COLCON_OPTIONS.get(" ".join(path), frozenset())
    return CompletionContext(path, words, options, _positional(path, positionals), ends_list)


def _first_words(parser: argparse.ArgumentParser) -> tuple[str, ...]:
    """Return the choices of the first positional argument if others follow it; they act like verbs."""
    positionals = [action for action in parser._actions if not action.option_strings]
    return tuple(positionals[0].choices or ()) if len(positionals) > 1 else ()


def _positional(path: tuple[str, ...], actions: list[argparse.Action]) -> Expected | None:
    if path == ("run",):
        return Expected(RUNNABLE)
    if path == ("help",):
        return Expected(WORDS, words=tuple(main.COMMANDS))
    if path[:1] == ("pkg",) and actions and actions[0].dest == "package":
        return Expected(INSTALLED)
    if path in {("interface", "package"), ("interface", "docs")}:
        return Expected(INTERFACE_PACKAGES)
    return _expected(actions[0], path) if actions else None


def _option(action: argparse.Action, path: tuple[str, ...]) -> CompletionOption:
    summary = re.sub(r"%%", "%", action.help or "")
    return CompletionOption(
        tuple(action.option_strings), summary, None if action.nargs == 0 else _expected(action, path)
    )


def _expected(action: argparse.Action, path: tuple[str, ...]) -> Expected:
    several = action.nargs in {"*", "+"}
    if action.dest == "mixin":
        return Expected(MIXINS, several, path[:1])
    if action.dest == "profile":
        return Expected(PROFILES, several)
    if not PASSED_ON.isdisjoint(action.option_strings):
        words = [f"-DCMAKE_BUILD_TYPE={word}" for word in _CMAKE_BUILD_TYPES]
        words = words if action.dest == "cmake_args" else []
        return Expected(WORDS if words else ANYTHING, several, tuple(words), passed_on=True)
    if action.dest == "event_handlers":
        opposite = (f"{name}{'-' if on else '+'}" for name, on in HANDLERS.items())
        return Expected(WORDS, several, tuple(opposite))
    if action.choices:
        return Expected(WORDS, several, tuple(map(str, action.choices)))
    folders = action.dest in {"base_paths", "paths"}
    return Expected(FOLDERS if folders else _METAVARS.get(str(action.metavar), ANYTHING), several)


def _verbs(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser] | None:
    return next((a for a in parser._actions if isinstance(a, argparse._SubParsersAction)), None)
