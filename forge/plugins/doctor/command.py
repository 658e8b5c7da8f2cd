"""`forge doctor`: diagnose problems of the machine, the shell and the workspace."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from forge.base.colours import palette_of
from forge.base.errors import ForgeError
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.options import flag, option, options_of
from forge.base.text import counted
from forge.cli.config import configured_word
from forge.cli.options import FolderOptions, OptionSources
from forge.cli.preparation import build_variables, without_own
from forge.environment.prefixes import find_underlays
from forge.plugins.doctor import machine, naming, packages, programs, surroundings
from forge.plugins.doctor.model import CheckContext, CheckResult, files_of
from forge.plugins.doctor.report import lines, plain
from forge.workspace.load import load_workspace
from forge.workspace.selection import Query

_ANYWHERE = (
    *(programs.compiler, programs.cmake, programs.builder, programs.python, programs.shells),
    *(surroundings.underlays, surroundings.environment),
    *(machine.disk, machine.clock, machine.limits, machine.capacity),
)
_IN_WORKSPACE = (surroundings.results, machine.owners, naming.names, packages.declarations, packages.shadows)

EXIT_USER = 2


@frozen
class Options:
    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    folders: FolderOptions = options_of(FolderOptions)
    python: str | None = option("interpreter to check (default: as for 'forge build')", metavar="PATH")
    all: bool = flag("also show notes: unused and redundant dependencies, and packages that hide others")
    json: bool = flag("print one JSON object with the keys errors, warnings, notes, checked and findings")
    given: frozenset[str] = frozenset()
    """The options of the command line."""


def run(options: Options) -> int:
    """Print the findings; returns 0, or 2 if a finding prevents builds."""
    root = Path.cwd()
    layout = options.folders.layout(root)
    workspace, subject = _load(root, layout, options)
    checks = (*_ANYWHERE, *(_IN_WORKSPACE if subject.packages else ()))
    results = (workspace, *(check(subject) for check in checks))
    if options.json:
        import json

        print(json.dumps(plain(results), indent=2))
    else:
        print(*lines(results, everything=options.all, palette=palette_of(sys.stdout)), sep="\n")
    return EXIT_USER if any(result.errors for result in results) else 0


def _load(root: Path, layout: Layout, options: Options) -> tuple[CheckResult, CheckContext]:
    """Return the result for the workspace as a whole, and the subject of the other checks."""
    outside = without_own(os.environ, layout)
    try:
        variables: Mapping[str, str] = build_variables(layout, os.environ)
    except ForgeError:
        variables = outside  # the state of an earlier build is unreadable, which another check reports
    python = options.python or configured_word("python", root, os.environ)
    overlays = find_underlays(os.environ, layout.install).overlays
    underlays = replace(find_underlays(variables, layout.install), overlays=overlays)
    bare = CheckContext(root, layout, variables, outside, python, underlays)
    if (
        root in {Path.home(), Path(root.anchor)}
        and "base_paths" not in options.given
        and not options.query.search.paths
    ):
        return CheckResult(
            "workspace", "none: not searching for packages in a whole home folder or file system"
        ), bare
    try:
        loaded = load_workspace(root, options.query, variables, embedded=True, install=layout.install)
    except ForgeError as error:
        return CheckResult("workspace", "cannot be loaded", errors=error.problems), bare
    names = loaded.selection.names
    advice = own_plugin(OPTIONS, "missing-packages")
    missing = advice.missing_dependencies(loaded.resolution, names) if advice else ()
    own = sum(not loaded.resolution.packages[name].embedded for name in names)
    others = f", and {len(names) - own} embedded in forge" if own < len(names) else ""
    summary = f"{counted(own, 'package')}{others}" if own else "no packages found"
    warnings = (*loaded.warnings, *missing)
    everything = loaded.workspace.packages
    # The packages of the user come first in all findings.
    ordered = sorted(names, key=lambda name: loaded.resolution.packages[name].embedded)
    subject = replace(
        bare,
        packages={name: everything[name] for name in ordered if name in everything},
        resolution=loaded.resolution,
        files={name: files_of(root, package) for name, package in everything.items()},
    )
    return CheckResult("workspace", summary, errors=loaded.workspace.problems, warnings=warnings), subject
