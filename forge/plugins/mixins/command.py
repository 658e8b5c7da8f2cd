"""`forge mixin`: named sets of options, used with `--mixin NAME`, and their repositories."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

from forge.base.env_vars import home, without_passwords
from forge.base.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import option
from forge.cli.mixins import mixin_folders, read_mixins
from forge.cli.options import add_verb
from forge.plugins.mixins.repositories import MixinRepositories

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable
    from pathlib import Path

    from forge.cli.mixins import Mixin
    from forge.plugins.mixins.repositories import Change

_SIGNS = "+ new, * changed, . unchanged, - renamed to *.obsolete"


def _files() -> Any:
    return option("additional mixin files", default=(), metavar="FILE")


@frozen
class _AddOptions:
    name: str = option("name for the repository", positional=True, metavar="NAME")
    url: str = option("URL or path of its index, such as '.../index.yaml'", positional=True, metavar="URL")


@frozen
class _UpdateOptions:
    name: str | None = option(
        "only this repository (default: all)", positional=True, nargs="?", metavar="REPOSITORY"
    )


@frozen
class _RemoveOptions:
    name: str = option("name of the repository", positional=True, metavar="REPOSITORY")


@frozen
class _ListOptions(_UpdateOptions):
    mixin_files: tuple[str, ...] = _files()


@frozen
class _ShowOptions:
    of: str | None = option(
        "only mixins of this command, or so named", positional=True, nargs="?", metavar="COMMAND"
    )
    name: str | None = option("only this mixin", positional=True, nargs="?", metavar="MIXIN")
    mixin_files: tuple[str, ...] = _files()


def register(parser: argparse.ArgumentParser) -> None:
    """Add the verbs of `forge mixin`."""
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "add", "add a repository of mixins", _AddOptions, _add)
    summary = "fetch the mixins of repositories"
    add_verb(verbs, "update", summary, _UpdateOptions, _update, description=f"{summary}: {_SIGNS}")
    add_verb(verbs, "remove", "remove a repository and its mixins", _RemoveOptions, _remove)
    summary = "list repositories, mixin files, and the names of all mixins"
    add_verb(verbs, "list", summary, _ListOptions, _list)
    add_verb(verbs, "show", "print the options of mixins", _ShowOptions, _show)


def _add(options: _AddOptions) -> None:
    MixinRepositories(home(os.environ)).add(options.name, options.url)
    if sys.stderr.isatty():
        print(f"hint: 'forge mixin update {options.name}' fetches its mixins", file=sys.stderr)


def _update(options: _UpdateOptions) -> None:
    """Fetch all repositories in spite of problems, then raise these."""
    repositories = MixinRepositories(home(os.environ))
    problems: list[Problem] = []
    for name in repositories.selected(options.name):
        print(f"fetching {name}: {without_passwords(repositories.urls[name])} ...", flush=True)
        try:
            for change in repositories.update(name):
                if isinstance(change, Problem):
                    problems.append(change)
                else:
                    _print_change(change)
        except (SelectionError, WorkspaceError) as error:
            problems += error.problems
    raise_if_any(problems, SelectionError)


def _remove(options: _RemoveOptions) -> None:
    for change in MixinRepositories(home(os.environ)).remove(options.name):
        _print_change(change)


def _print_change(change: Change) -> None:
    print(f"  {change.sign} {change.path}{' -> *.obsolete' if change.sign == '-' else ''}", flush=True)


def _list(options: _ListOptions) -> None:
    """Print colcon's lines, and below each file the names of its mixins."""
    repositories = MixinRepositories(home(os.environ))
    mixins = _all_mixins(options)
    for name in repositories.selected(options.name):
        print(f"{name}: {without_passwords(repositories.urls[name])}")
        _print_files(repositories.files(name), mixins)
    if options.name is not None:
        return
    fetched = {path for name in repositories.urls for path in repositories.files(name)}
    others = dict.fromkeys(mixin.place for mixin in mixins if mixin.place and mixin.place not in fetched)
    if others:
        print("mixin files not associated with a repository")
        _print_files(others, mixins)
    print("built into forge")
    _print_names(mixin for mixin in mixins if mixin.place is None)


def _print_files(paths: Iterable[Path], mixins: Iterable[Mixin]) -> None:
    for path in paths:
        print(f"- {path}")
        _print_names(mixin for mixin in mixins if mixin.place == path)


def _print_names(mixins: Iterable[Mixin]) -> None:
    names: dict[str, list[str]] = {}
    for mixin in mixins:
        names.setdefault(mixin.verb, []).append(mixin.name)
    for verb, own in names.items():
        print(f"    {verb}: {', '.join(own)}")


def _show(options: _ShowOptions) -> None:
    mixins = _all_mixins(options)
    chosen = [
        mixin for mixin in mixins if options.of in {None, mixin.verb} and options.name in {None, mixin.name}
    ]
    # A single word is a command, else a mixin of any command.
    chosen = chosen or [mixin for mixin in mixins if options.name is None and mixin.name == options.of]
    if not chosen:
        wanted = f"'{options.name}' for '{options.of}'" if options.name else f"'{options.of}'"
        verbs = () if options.name else (mixin.verb for mixin in mixins)
        known = (*verbs, *(mixin.name for mixin in mixins))
        raise SelectionError(
            Problem(f"unknown mixin {wanted}", hint=did_you_mean(options.name or options.of or "", known))
        )
    verb = None
    for mixin in chosen:
        if mixin.verb != verb:
            print(f"{mixin.verb}:")
        verb = mixin.verb
        print(f"- {mixin.name}")
        for key, value in sorted(mixin.options.items()):
            print(f"  {key}: {value}")


def _all_mixins(options: _ListOptions | _ShowOptions) -> list[Mixin]:
    mixins = read_mixins(mixin_folders(os.environ), options.mixin_files)
    return [mixins[key] for key in sorted(mixins)]
