"""`forge info`: what is known about packages."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge.commands.list import type_word
from forge.errors import Problem, SelectionError, raise_if_any
from forge.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Person
from forge.names import did_you_mean
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from forge.cli import Parser
    from forge.model import Package

_CATEGORIES = (("build", BUILD_KINDS), ("run", RUN_KINDS), ("test", TEST_KINDS))


def register(parser: Parser) -> None:
    """Add the options of `forge info`."""
    shared.add_discovery(parser)
    shared.add_selection(parser)
    parser.add_argument("names", nargs="*", metavar="PKG", help="which packages (default: all)")
    parser.add_argument("--embedded", action="store_true", help="with the packages that forge brings along")


def run(options: argparse.Namespace) -> int:
    """Print a paragraph for each package, sorted by name."""
    loaded = load_workspace(Path.cwd(), options, os.environ, embedded=options.embedded)
    names = options.names or loaded.selection.names
    raise_if_any(
        (
            Problem(f"package '{name}' is not in the workspace", hint=did_you_mean(name, loaded.packages))
            for name in names
            if name not in loaded.packages
        ),
        SelectionError,
    )
    for name in sorted(names):
        print(*_paragraph(loaded.packages[name], options), sep="\n")
    return 0


def _paragraph(package: Package, options: argparse.Namespace) -> Iterator[str]:
    manifest = package.manifest
    yield f"path: {shared.spelled(package.path, options)}"
    yield f"  type: {type_word(package)}"
    yield f"  name: {package.name}"
    categories = {word: sorted(set(manifest.names(kinds))) for word, kinds in _CATEGORIES}
    if any(categories.values()):
        yield "  dependencies:"
        yield from (f"    {word}: {' '.join(names)}".rstrip() for word, names in categories.items())
    yield "  metadata:"
    yield f"    maintainers: {[_said(person) for person in manifest.maintainers]}"
    yield f"    version: {manifest.version}"


def _said(person: Person) -> str:
    return f"{person.name} <{person.email}>" if person.email else person.name
