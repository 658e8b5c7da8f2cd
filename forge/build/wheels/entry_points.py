"""Detect entry points of scripts that are not NAME = MODULE:FUNCTION, and where they are written."""

from __future__ import annotations

import ast
import configparser
import re
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem
from forge.base.files import text_or_nothing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

ENTRY_POINTS = "entry_points.txt"
"""The file of a wheel's metadata that lists them."""

_SECTIONS = ("console_scripts", "gui_scripts")
_VALID = re.compile(r"[^=]*[^\s=]\s*=\s*[\w.]+\s*:\s*[\w.]+\s*(?:\[.*\]\s*)?")
"""What installers accept; a backend may accept more."""
_MEANT = re.compile(r"([^\s=:]+)[\s=]+([\w./]+?)(?:\s*:\s*([\w.]+)(?:\(\))?)?\s*")
_OF_SCRIPTS = re.compile(r"_scripts|^\[project\.(?:gui-)?scripts\]", re.MULTILINE)
_FILES = ("setup.py", "pyproject.toml", "setup.cfg")


def scripts(text: str) -> Iterator[tuple[str, str]]:
    """Yield name and target of each script of an entry_points.txt; nothing if it is malformed."""
    parser = configparser.RawConfigParser(delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment, method-assign]  # (names have upper case, too)
    try:
        parser.read_string(text)
    except configparser.Error:
        return
    for section in _SECTIONS:
        yield from parser[section].items() if parser.has_section(section) else ()


def invalid_scripts(text: str, source: Path) -> Iterator[Problem]:
    """Yield a problem for each invalid script of an entry_points.txt, at its place in the source folder."""
    for name, target in scripts(text):
        point = f"{name} = {target}"
        if not _VALID.fullmatch(point):
            yield _problem(point, _place(source, name, target))


def without_invalid_scripts(text: str) -> str:
    """Return an entry_points.txt with only the valid scripts."""
    valid = (f"{name} = {target}" for name, target in scripts(text))
    return "\n".join(("[console_scripts]", *filter(_VALID.fullmatch, valid), ""))


def invalid_scripts_of_setup(setup: Path) -> Iterator[Problem]:
    """Yield a problem for each invalid script that a setup.py without syntax errors spells out."""
    text = text_or_nothing(setup)
    lines = text.splitlines()
    for node in _literals(ast.parse(text)):
        point = node.value.strip() if isinstance(node.value, str) else ""
        if not point or "\n" in point or point.startswith("#"):
            continue
        place = Location(setup, node.lineno, node.col_offset + 1, lines[node.lineno - 1])
        if not _VALID.fullmatch(point):
            yield _problem(point, place)
        elif re.search(r"[/\\]", point.partition("=")[0]):
            yield Problem(f"the name of the script '{point}' contains a path separator", place)


def defining_file(source: Path) -> Path:
    """Return the file that defines the entry points of scripts."""
    paths = [source / name for name in _FILES]
    return next((path for path in paths if _OF_SCRIPTS.search(text_or_nothing(path))), paths[0])


def _literals(tree: ast.Module) -> Iterator[ast.Constant]:
    for node in ast.walk(tree):
        for key, value in zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ():
            if isinstance(key, ast.Constant) and key.value in _SECTIONS:
                elements = value.elts if isinstance(value, ast.List | ast.Tuple) else []
                yield from (element for element in elements if isinstance(element, ast.Constant))


def _problem(point: str, place: Location) -> Problem:
    name, equals, target = (part.strip() for part in point.partition("="))
    meant = _MEANT.fullmatch(point)
    if not equals:
        message = f"the entry point '{point}' lacks '='"
    elif name and re.fullmatch(r"[\w.]+", target):
        message = f"the entry point '{point}' lacks ':FUNCTION'"
    else:
        message = f"the entry point '{point}' is not of the form 'NAME = MODULE:FUNCTION'"
    hint = meant and f"write '{meant[1]} = {meant[2].replace('/', '.')}:{meant[3] or 'main'}'"
    return Problem(message, place, hint)


def _place(source: Path, name: str, target: str) -> Location:
    """Return the line that names a script and its target, or the file if there is none."""
    path = defining_file(source)
    written = re.compile(rf"(?<![\w-]){re.escape(name)}\b.*=.*{re.escape(target)}")
    for number, line in enumerate(text_or_nothing(path).splitlines(), 1):
        if written.search(line):
            return Location(path, number, source=line)
    return Location(path)
