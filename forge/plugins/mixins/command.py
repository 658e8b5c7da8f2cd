"""`forge mixin`: named sets of options, used with `--mixin NAME`, and their repositories."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from forge.base.env_vars import home, without_passwords
from forge.base.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.names import did_you_mean
from forge.cli.mixins import mixin_folders, read_mixins
from forge.plugins.mixins.repositories import MixinRepositories

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable
    from pathlib import Path

    from forge.cli.main import Parser
    from forge.cli.mixins import Mixin
    from forge.plugins.mixins.repositories import Change

_OF_REPOSITORIES = (
    ("add", "add a repository of mixins"),
    ("update", "fetch the mixins of repositories"),
    ("remove", "remove a repository and its mixins"),
)
_SIGNS = "+ new, * changed, . unchanged, - renamed to *.obsolete"


def register(parser: Parser) -> None:
    """Add the verbs of `forge mixin`."""
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    adding, updating, removing = (
        verbs.add_parser(word, help=summary, description=summary) for word, summary in _OF_REPOSITORIES
    )
    adding.add_argument("name", metavar="NAME", help="name for the repository")
    adding.add_argument("url", metavar="URL", help="URL or path of its index, such as '.../index.yaml'")
    adding.set_defaults(verb=_add)
    updating.description = f"fetch the mixins of repositories: {_SIGNS}"
    updating.add_argument("name", nargs="?", metavar="REPOSITORY", help="only this repository (default: all)")
    updating.set_defaults(verb=_update)
    removing.add_argument("name", metavar="REPOSITORY", help="name of the repository")
    removing.set_defaults(verb=_remove)
    summary = "list repositories, mixin files, and the names of all mixins"
    listing = verbs.add_parser("list", help=summary, description=summary)
    listing.add_argument("name", nargs="?", metavar="REPOSITORY", help="only this repository (default: all)")
    listing.set_defaults(verb=_list)
    summary = "print the options of mixins"
    showing = verbs.add_parser("show", help=summary, description=summary)
    showing.add_argument("of", nargs="?", metavar="COMMAND", help="only mixins of this command, or so named")
    showing.add_argument("name", nargs="?", metavar="MIXIN", help="only this mixin")
    showing.set_defaults(verb=_show)
    for verb in (listing, showing):
        verb.add_argument(
            "--mixin-files", nargs="*", default=[], metavar="FILE", help="additional mixin files"
        )


def run(options: argparse.Namespace) -> int:
    """Run the verb; raises ForgeError for problems the user can fix."""
    options.verb(options)
    return 0


def _add(options: argparse.Namespace) -> None:
    MixinRepositories(home(os.environ)).add(options.name, options.url)
    if sys.stderr.isatty():
        print(f"hint: 'forge mixin update {options.name}' fetches its mixins", file=sys.stderr)


def _update(options: argparse.Namespace) -> None:
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


def _remove(options: argparse.Namespace) -> None:
    for change in MixinRepositories(home(os.environ)).remove(options.name):
        _print_change(change)


def _print_change(change: Change) -> None:
    print(f"  {change.sign} {change.path}{' -> *.obsolete' if change.sign == '-' else ''}", flush=True)


def _list(options: argparse.Namespace) -> None:
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


def _show(options: argparse.Namespace) -> None:
    mixins = _all_mixins(options)
    chosen = [mixin for mixin in mixins if _matches(mixin, options)]
    # A single word is a command, else a mixin of any command.
    chosen = chosen or [mixin for mixin in mixins if options.name is None and mixin.name == options.of]
    if not chosen:
        wanted = f"'{options.name}' for '{options.of}'" if options.name else f"'{options.of}'"
        verbs = () if options.name else (mixin.verb for mixin in mixins)
        known = (*verbs, *(mixin.name for mixin in mixins))
        raise SelectionError(
            Problem(f"unknown mixin {wanted}", hint=did_you_mean(options.name or options.of, known))
        )
    verb = None
    for mixin in chosen:
        if mixin.verb != verb:
            print(f"{mixin.verb}:")
        verb = mixin.verb
        print(f"- {mixin.name}")
        for key, value in sorted(mixin.options.items()):
            print(f"  {key}: {value}")


def _all_mixins(options: argparse.Namespace) -> list[Mixin]:
    mixins = read_mixins(mixin_folders(os.environ), options.mixin_files)
    return [mixins[key] for key in sorted(mixins)]


def _matches(mixin: Mixin, options: argparse.Namespace) -> bool:
    return options.of in {None, mixin.verb} and options.name in {None, mixin.name}
