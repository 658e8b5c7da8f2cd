"""`forge clean`: remove what was built, and nothing that forge and colcon did not make."""

from __future__ import annotations

import os
import sys
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge import package_options
from forge.cleaning import BASES, left_over, litter_of_package, litter_of_workspace, made_packages, remove
from forge.compile_commands import merge_compile_commands
from forge.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.installation import finish_workspace
from forge.journal import open_journal
from forge.names import did_you_mean
from forge.occupancy import occupied
from forge.prefixes import LAYOUT_MARKER
from forge.preparation import build_variables
from forge.results import STATE, recorded_python
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable
    from contextlib import AbstractContextManager

    from forge.cleaning import Litter
    from forge.cli import Parser
    from forge.journal import Journal
    from forge.layout import Layout
    from forge.workspace import Loaded


def register(parser: Parser) -> None:
    """Add the options of `forge clean`."""
    parser.add_argument(
        "what",
        choices=["workspace", "packages", "stale"],
        help="everything; the named packages; packages that are no longer in the workspace",
    )
    parser.add_argument("names", nargs="*", metavar="PKG", help="for 'packages': which")
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask")
    parser.add_argument(
        "--base-select",
        nargs="+",
        choices=BASES,
        default=list(BASES),
        help="of the workspace, only these (default: all)",
    )
    package_options.add(parser)
    shared.add_layout(parser)


def run(options: argparse.Namespace) -> int:
    """Show what would go, ask, and remove it; returns 0, also when the answer is no."""
    root = Path.cwd()
    layout = _as_installed(shared.layout_of(options, root))
    with _held(layout, wait=not options.no_wait), closing(open_journal(layout.build)) as journal:
        names = _names(options, root, layout, journal)
        if options.what == "workspace":
            litters = list(litter_of_workspace(layout, journal.records, options.base_select))
        else:
            litters = [found for name in names for found in litter_of_package(name, layout, journal.records)]
        if not litters:
            print("nothing to remove")
            return 0
        for litter in litters:
            print(f"- {_shown(litter, options)}")
        if not (options.yes or _agreed(f"Remove these {len(litters)}? [y/N] ")):
            print("nothing was removed")
            return 0
        for name in names:
            journal.forget(name)
        journal.close()
        remove(litters)
    if options.what == "workspace":
        _tell_rest(left_over(layout, options.base_select), options)
    else:
        _write_scripts(layout)
        merge_compile_commands(layout.build, anew=True)
    return 0


def _names(options: argparse.Namespace, root: Path, layout: Layout, journal: Journal) -> tuple[str, ...]:
    """Return the packages to remove; raises SelectionError for words that make no sense."""
    made = made_packages(layout, journal.records)
    chosen = package_options.chooses(options)
    if options.what != "packages" and (options.names or chosen):
        hint = "forge clean packages PKG ..."
        raise SelectionError(Problem(f"'clean {options.what}' takes no packages", hint=hint))
    if options.what == "workspace":
        return ()
    if options.what == "stale":
        return tuple(sorted(made - _load(options, root, layout).packages.keys()))
    if not (options.names or chosen):
        raise SelectionError(Problem("'clean packages' needs names", hint="forge clean packages PKG ..."))
    raise_if_any(
        (
            Problem(f"nothing was built of a package '{name}'", hint=did_you_mean(name, made))
            for name in options.names
            if name not in made
        ),
        SelectionError,
    )
    selected = _load(options, root, layout).selection.names if chosen else ()
    return tuple(dict.fromkeys([*options.names, *selected]))


def _load(options: argparse.Namespace, root: Path, layout: Layout) -> Loaded:
    """Return the workspace; raises WorkspaceError while a manifest is broken: its package is still there."""
    variables = build_variables(layout, os.environ)
    loaded = load_workspace(root, options, variables, embedded=True, install=layout.install)
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    return loaded


def _held(layout: Layout, *, wait: bool) -> AbstractContextManager[None]:
    """Return what keeps builds away meanwhile; a folder that is none of ours is not even written to."""
    return occupied(layout.build, wait=wait) if (layout.build / ".built_by").is_file() else nullcontext()


def _as_installed(layout: Layout) -> Layout:
    """Return the layout that the install folder has, whatever the options say."""
    marker = layout.install / LAYOUT_MARKER
    if not marker.is_file():
        return layout
    return replace(layout, merged=marker.read_text(encoding="utf-8").strip() == "merged")


def _shown(litter: Litter, options: argparse.Namespace) -> str:
    if len(litter.paths) > 1:
        return f"{litter.label} in {_spelled(litter.base, options)}"
    return f"{_spelled(litter.paths[0], options)} ({litter.label})"


def _spelled(path: Path, options: argparse.Namespace) -> str:
    return shared.spelled(os.path.relpath(path) if path.is_relative_to(Path.cwd()) else path, options)


def _agreed(question: str) -> bool:
    """Ask; an answer that does not come is a no."""
    print(question, end="", flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _tell_rest(paths: Iterable[Path], options: argparse.Namespace) -> None:
    for path in paths:
        print(f"left alone, since forge did not make it: {_spelled(path, options)}", file=sys.stderr)


def _write_scripts(layout: Layout) -> None:
    """Write the workspace's scripts without the packages that are gone; colcon's look for themselves."""
    if (layout.install / STATE).is_file():
        finish_workspace(layout, (), Path(recorded_python(layout.install) or sys.executable))
