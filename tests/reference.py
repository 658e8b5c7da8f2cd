"""The parts of the reference that the code itself can tell: tables of options, made from the parsers.

In a page, a table stands between two comments; what is around them is written by hand:

    <!-- from the code: build -->            the options of `forge build`, without groups told elsewhere
    <!-- from the code: build / build options -->     one group of them
    <!-- end -->

`pytest tests/test_reference.py --accept` writes the tables anew.
"""

import argparse
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from forge.cli.main import COMMANDS, parser_of

SHARED = {
    "package discovery": "build",
    "package selection": "build",
    "options from files": "build",
    "output folders": "build",
    "parallelism": "build",
}
"""Groups of options that several commands have in common, and the command whose page's part tells of them."""

_REGION = re.compile(r"(<!-- from the code: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)
_QUOTED = re.compile(r"(?<![\w`])'([^']+)'(?!\w)")
_NAMED = re.compile(r"(?<![\w`/-])(--[a-z][a-z-]+(?:=\w+)?)(?![\w`])")


@dataclass(frozen=True, slots=True)
class Option:
    """An option of a command: the verb it belongs to, its group, and the two cells that tell of it."""

    verb: str
    group: str
    spelling: str
    meaning: str


def updated(page: str) -> str:
    """Return a page with each table as the code has it now."""
    return _REGION.sub(lambda region: f"{region[1]}{table(region[2])}{region[3]}", page)


def regions(page: str) -> list[str]:
    """Return what the tables of a page are about."""
    return [region[2] for region in _REGION.finditer(page)]


def table(subject: str) -> str:
    """Return the table that a comment asks for: `build`, `build / build options`, or `before the command`."""
    command, _, group = subject.partition(" / ")
    found = list(options("" if command == "before the command" else command))
    chosen = [each for each in found if (each.group == group if group else each.group not in SHARED)]
    if not chosen:
        raise ValueError(f"there is nothing to tell about '{subject}'")
    if any(each.verb for each in chosen):
        return _rows(("option", "of", "meaning"), _of_verbs(chosen))
    return _rows(("option", "meaning"), ((each.spelling, each.meaning) for each in chosen))


def options(command: str) -> Iterator[Option]:
    """Yield the options of a command, and of its verbs; without a name those that stand before it."""
    for verb, parser in parsers(command):
        for group in parser._action_groups:
            for action in group._group_actions:
                if action.option_strings and action.help != argparse.SUPPRESS and action.dest != "help":
                    meaning = _meaning(parser, action)
                    yield Option(verb, group.title or "", _spelling(action), meaning)


def parsers(command: str) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield the parser of a command and those of its verbs, by the verb or ''."""
    whole = parser_of([command] if command else [])
    if not command:
        yield "", whole
        return
    parser = _subparsers(whole)[command]
    yield "", parser
    yield from _subparsers(parser).items()


def all_parsers() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield every parser there is, by the words that lead to it."""
    yield from parsers("")
    for command in COMMANDS:
        for verb, parser in parsers(command):
            yield f"{command} {verb}".strip(), parser


def _subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _spelling(action: argparse.Action) -> str:
    """Return all spellings of an option with what follows; those with '_' are old ones."""
    flags = [flag for flag in action.option_strings if "_" not in flag]
    value = _value(action)
    return ", ".join(f"`{flag} {value}`" if value else f"`{flag}`" for flag in flags)


def _value(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    if isinstance(action.metavar, tuple):
        words = " ".join(action.metavar)
    else:
        choices = "\\|".join(map(str, action.choices or ()))
        words = action.metavar or choices or action.dest.upper()
    return f"{words} ..." if action.nargs in {"*", "+"} else words


def _meaning(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Return the help of an option with code marked as such."""
    text = parser._get_formatter()._expand_help(action) if action.help else ""
    parts = re.split(r"(`[^`]*`)", _QUOTED.sub(r"`\1`", text).replace("|", "\\|"))
    return "".join(part if part.startswith("`") else _NAMED.sub(r"`\1`", part) for part in parts)


def _of_verbs(chosen: Iterable[Option]) -> Iterator[tuple[str, str, str]]:
    """Yield a row for each option that several verbs have in common, in the order of the first."""
    rows: dict[tuple[str, str], list[str]] = {}
    for each in chosen:
        rows.setdefault((each.spelling, each.meaning), []).append(f"`{each.verb}`")
    for (spelling, meaning), verbs in rows.items():
        yield spelling, ", ".join(verbs), meaning


def _rows(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [" | ".join(heads), "|".join("---" for _ in heads), *(" | ".join(row) for row in rows)]
    return "".join(f"| {line} |\n" if "---|" not in line else f"|{line}|\n" for line in lines)
