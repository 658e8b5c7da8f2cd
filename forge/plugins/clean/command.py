"""`forge clean`: remove build, install and log files, but only those that forge or colcon created."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path

from forge.base.errors import Problem, SelectionError, WorkspaceError, print_warnings, raise_if_any
from forge.base.extensions import OPTIONS, find, is_installed
from forge.base.frozen import frozen
from forge.base.layout import Layout, forge_command
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.base.text import counted, listed
from forge.build.cleaning import Removable, package_removables, remove, restore_backups
from forge.build.folder_marks import (
    bases_of,
    is_own_build_base,
    is_own_install_base,
    is_removed_package,
    recorded_layout,
)
from forge.build.installation import finish_workspace
from forge.build.journal import Journal, open_journal
from forge.cli import options as shared
from forge.cli.options import FolderOptions, OptionSources
from forge.cli.preparation import build_variables, check_bases
from forge.environment.install_state import recorded_state
from forge.execution.lock import lock_build_dir, lock_install_dir
from forge.plugins.clean.finding import (
    BASES,
    built_packages,
    is_of_workspace,
    packages_of_others,
    remaining_entries,
    remaining_in_prefix,
    workspace_removables,
)
from forge.workspace.forge_toml import folder_of_profile
from forge.workspace.load import LoadedWorkspace, load_workspace
from forge.workspace.selection import Query

_MOST = 20
"""The number of remaining entries that are listed."""


@frozen
class Options:
    what: str | None = option(
        "what to clean: the whole workspace, the given packages, or packages that are no longer in the "
        "workspace (default: print what can be removed, and remove nothing)",
        nargs="?",
        positional=True,
        choices=("workspace", "packages", "stale"),
    )
    names: tuple[str, ...] = option(
        "packages whose build and install files to remove, for 'packages'",
        default=(),
        positional=True,
        metavar="PKG",
    )
    yes: bool = flag("do not ask for confirmation", short="-y")
    base_select: tuple[str, ...] = option(
        "folders to remove, for 'workspace' (default: all)",
        default=BASES,
        nargs="+",
        choices=BASES,
    )
    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    folders: FolderOptions = options_of(FolderOptions)
    origin: str = os.curdir


def run(options: Options) -> int:
    """Show the items to remove, ask for confirmation, and remove them; returns 0 even if declined."""
    root = Path.cwd()
    layout = options.folders.layout(root)
    word = recorded_layout(layout.install)
    layout = layout if word is None else replace(layout, merged=word == "merged")
    check_bases(root, options.query.search, bases_of(layout))
    # Folders that forge did not create have no lock.
    wait = not options.folders.no_wait
    with (
        lock_build_dir(layout.build, wait=wait) if is_own_build_base(layout.build) else nullcontext(),
        lock_install_dir(layout.install, wait=wait) if is_own_install_base(layout.install) else nullcontext(),
        closing(open_journal(layout.build)) as journal,
    ):
        names = _names(options, root, layout, journal)
        removables = _removables(options, root, layout, journal, names)
        if not removables:
            print("nothing to remove")
            return 0
        if options.what is None:
            _preview(options, removables, names)
            return 0
        for removable in removables:
            print(f"- {_shown(removable, options)}")
        if not (options.yes or shared.confirmed(f"Remove these {len(removables)} items? [y/N] ")):
            print("nothing was removed")
            return 0
        restore_backups(layout, names or built_packages(layout, journal.records))
        removables = _removables(options, root, layout, journal, names)
        for name in names:
            journal.forget(name)
        journal.close()
        remove(removables)
    if options.what == "workspace" and not names:
        _report_rest(remaining_entries(layout, options.base_select), options)
    else:
        remaining = (
            entry
            for removable in removables
            if removable.prefix
            for entry in remaining_in_prefix(removable.prefix)
        )
        _report_rest(remaining, options)
        # forge's setup scripts name the packages; colcon's search the folder.
        if python := recorded_state(layout.install).python:
            finish_workspace(layout, (), Path(python))
        if is_own_build_base(layout.build) and is_installed(OPTIONS, "compile_commands"):
            find(OPTIONS, "compile_commands", "option").merge_compile_commands(layout.build, force=True)
    return 0


def _removables(
    options: Options, root: Path, layout: Layout, journal: Journal, names: Sequence[str]
) -> list[Removable]:
    if options.what in {None, "workspace"}:
        return list(workspace_removables(root, layout, journal.records, options.base_select))
    return [each for name in names for each in package_removables(name, layout, journal.records)]


def _preview(options: Options, removables: Sequence[Removable], stale: Sequence[str]) -> None:
    for base, count in Counter(removable.base for removable in removables).items():
        print(f"- {counted(count, 'item')} in {_displayed(base, options)}")
    profile = options.folders.profile
    rows = {
        forge_command("clean workspace", profile): "all of the above",
        forge_command("clean packages PKG ...", profile): "the results of these packages",
        forge_command("clean stale", profile): "the results of packages that left the workspace: "
        f"{listed(stale) or 'none'}",
    }
    width = max(map(len, rows))
    print("Nothing was removed. These commands list what they remove and ask first:")
    print(*(f"  {command:{width}}  {result}" for command, result in rows.items()), sep="\n")
    install = Path(options.folders.install_base)
    others = () if profile else install.parent.glob(folder_of_profile(install.name, "*"))
    profiles = sorted(state.profile for other in others if (state := recorded_state(other)).profile)
    if profiles:
        print("Profiles have folders of their own:")
        print(*(f"  {forge_command('clean workspace', name)}" for name in profiles), sep="\n")


def _names(options: Options, root: Path, layout: Layout, journal: Journal) -> tuple[str, ...]:
    """Return the packages to remove, none for a whole workspace that shares its folders with no other.

    Raises SelectionError for invalid combinations of arguments.
    """
    built_names = built_packages(layout, journal.records)
    query = options.query
    unlimited = Query(search=query.search, build_base=query.build_base, since=query.since)
    chosen = query != replace(unlimited, no_test_dependencies=query.no_test_dependencies, origin=query.origin)
    if options.what != "packages" and (options.names or chosen):
        hint = "forge clean packages PKG ..."
        command = f"clean {options.what or ''}".rstrip()
        raise SelectionError(Problem(f"'{command}' does not accept package names", hint=hint))
    if options.what == "workspace":
        others = sorted(packages_of_others(root, layout, journal.records))
        _report_others(others)
        return tuple(sorted(built_names.difference(others))) if others else ()
    if options.what != "packages":
        packages = _load(options, root, layout).packages
        absent = sorted(built_names - packages.keys())
        stale = [name for name in absent if is_of_workspace(name, root, layout, journal.records)]
        _report_others([name for name in absent if name not in stale])
        taken = {str(root / package.path) for package in packages.values()}
        sources = {name: record.source for name, record in journal.records.items()}
        # A package that these options do not discover, but that still exists, is not stale.
        there = {
            name
            for name in stale
            if (source := sources.get(name, "")).startswith(f"{root}/")
            and source not in taken
            and not is_removed_package(Path(source))
        }
        return tuple(name for name in stale if name not in there)
    if not (options.names or chosen):
        raise SelectionError(
            Problem("'clean packages' needs package names", hint="forge clean packages PKG ...")
        )
    raise_if_any(
        (
            Problem(f"package '{name}' was never built here", hint=did_you_mean(name, built_names))
            for name in options.names
            if name not in built_names
        ),
        SelectionError,
    )
    selected = _load(options, root, layout).selection.names if chosen else ()
    return tuple(dict.fromkeys([*options.names, *selected]))


def _report_others(names: Sequence[str]) -> None:
    if names:
        print(f"not removed, because another workspace built it: {listed(names)}", file=sys.stderr)


def _load(options: Options, root: Path, layout: Layout) -> LoadedWorkspace:
    """Return the workspace; raises WorkspaceError for invalid manifests, whose packages are not stale."""
    variables = build_variables(layout, os.environ)
    loaded = load_workspace(root, options.query, variables, embedded=True, install=layout.install)
    print_warnings(loaded.warnings)
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    return loaded


def _shown(removable: Removable, options: Options) -> str:
    if removable.prefix is not None:
        return f"{_displayed(removable.prefix, options)} ({removable.label})"
    if len(removable.paths) > 1:
        return f"{removable.label} in {_displayed(removable.base, options)}"
    return f"{_displayed(removable.paths[0], options)} ({removable.label})"


def _displayed(path: Path, options: Options) -> str:
    return shared.displayed(
        os.path.relpath(path) if path.is_relative_to(Path.cwd()) else path, options.origin
    )


def _report_rest(entries: Iterable[tuple[Path, str]], options: Options) -> None:
    remaining = list(entries)
    for path, reason in remaining[:_MOST]:
        print(f"not removed, because {reason}: {_displayed(path, options)}", file=sys.stderr)
    if len(remaining) > _MOST:
        print(f"not removed: {len(remaining) - _MOST} more", file=sys.stderr)
