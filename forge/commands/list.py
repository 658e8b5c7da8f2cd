"""`forge list`: the packages of a workspace, as name, path and type."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser
    from forge.model import Package


def register(parser: Parser) -> None:
    """Add the options of `forge list`."""
    shared.add_discovery(parser)
    shared.add_selection(parser)
    parser.add_argument("-t", "--topological-order", action="store_true", help="in the order of building")
    only = parser.add_mutually_exclusive_group()
    only.add_argument("-n", "--names-only", action="store_true", help="names alone")
    only.add_argument("-p", "--paths-only", action="store_true", help="paths alone")
    parser.add_argument("--embedded", action="store_true", help="with the packages that forge brings along")


def run(options: argparse.Namespace) -> int:
    """Print a line for each selected package, sorted as text or in topological order."""
    loaded = load_workspace(Path.cwd(), options, os.environ, embedded=options.embedded)
    lines = [_line(loaded.packages[name], options) for name in loaded.selection.names]
    for line in lines if options.topological_order else sorted(lines):
        print(line)
    return 0


def _line(package: Package, options: argparse.Namespace) -> str:
    if options.names_only:
        return package.name
    if options.paths_only:
        return shared.spelled(package.path, options)
    return f"{package.name}\t{shared.spelled(package.path, options)}\t({type_word(package)})"


def type_word(package: Package) -> str:
    """Return colcon's word for a package's type."""
    return f"ros.{package.build_type}"
