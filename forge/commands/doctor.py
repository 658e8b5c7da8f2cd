"""`forge doctor`: what is wrong with this machine, this shell and this workspace, and what to do about it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge import package_options
from forge.errors import ForgeError
from forge.examining import machine, naming, packages, programs, surroundings
from forge.examining.checkup import Checkup
from forge.examining.showing import lines, plain
from forge.examining.subject import Subject, files_of
from forge.prefixes import find_underlays
from forge.preparation import build_variables, without_own
from forge.provision import missing_problems
from forge.workspace import look_at_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from forge.cli import Parser
    from forge.layout import Layout
    from forge.workspace import Loaded

_ANYWHERE = (
    *(programs.compiler, programs.cmake, programs.builder, programs.python, programs.shells),
    *(surroundings.underlays, surroundings.environment),
    *(machine.disk, machine.clock, machine.limits, machine.capacity),
)
_IN_WORKSPACE = (surroundings.results, machine.owners, naming.names, packages.declarations, packages.shadows)

EXIT_USER = 2


def register(parser: Parser) -> None:
    """Add the options of `forge doctor`."""
    package_options.add(parser)
    shared.add_layout(parser)
    parser.add_argument("--python", metavar="PATH", help="the interpreter to build with, as for forge build")
    parser.add_argument(
        "--all",
        action="store_true",
        help="show also notes: what is declared and never mentioned, what another dependency brings along, "
        "which package hides which",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object: errors, warnings and notes as numbers, checked, findings",
    )


def run(options: argparse.Namespace) -> int:
    """Print what was found; returns 0, or 2 when something stops a build."""
    root = Path.cwd()
    layout = shared.layout_of(options, root)
    workspace, subject = _look(root, layout, options)
    checks = (*_ANYWHERE, *(_IN_WORKSPACE if subject.packages else ()))
    checkups = (workspace, *(check(subject) for check in checks))
    if options.json:
        import json  # noqa: PLC0415  (most people read)

        print(json.dumps(plain(checkups), indent=2))
    else:
        print(*lines(checkups, everything=options.all), sep="\n")
    return EXIT_USER if any(checkup.errors for checkup in checkups) else 0


def _look(root: Path, layout: Layout, options: argparse.Namespace) -> tuple[Checkup, Subject]:
    """Return what is to be said of the workspace as a whole, and what else there is to examine."""
    outside = without_own(os.environ, layout.install)
    try:
        variables: Mapping[str, str] = build_variables(layout, os.environ)
    except ForgeError:
        variables = outside  # the record of an earlier build cannot be read: the results tell
    python = options.python
    bare = Subject(root, layout, variables, outside, python, find_underlays(variables, layout.install))
    if root in {Path.home(), Path(root.anchor)} and "base_paths" not in options.given and not options.paths:
        return Checkup("workspace", "none: nobody looks for packages in a whole home or disk"), bare
    try:
        loaded = look_at_workspace(root, options, variables, embedded=True, install=layout.install)
    except ForgeError as error:
        return Checkup("workspace", "cannot be built", errors=error.problems), bare
    return _workspace(loaded), _subject(bare, loaded)


def _workspace(loaded: Loaded) -> Checkup:
    errors, warnings = missing_problems(loaded.provision, loaded.selection.names)
    count = len(loaded.selection.names)
    said = f"{count} package{'' if count == 1 else 's'}" if count else "there is no package here"
    faults = (*loaded.workspace.problems, *errors)
    return Checkup("workspace", said, errors=faults, warnings=(*loaded.doubts, *warnings))


def _subject(bare: Subject, loaded: Loaded) -> Subject:
    everything = loaded.workspace.packages
    return Subject(
        bare.root,
        bare.layout,
        bare.variables,
        bare.surroundings,
        bare.python,
        bare.underlays,
        {name: everything[name] for name in loaded.selection.names if name in everything},
        loaded.provision,
        {name: files_of(bare.root, package) for name, package in everything.items()},
    )
