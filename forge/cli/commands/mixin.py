"""`forge mixin`: list and show named sets of options, which `--mixin NAME` adds to a command line."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.env_vars import home
from forge.base.errors import Problem, SelectionError
from forge.base.names import did_you_mean
from forge.cli.mixins import read_mixins

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser
    from forge.cli.mixins import Mixin, Mixins


def register(parser: Parser) -> None:
    """Add the verbs of `forge mixin`."""
    verbs = parser.add_subparsers(dest="mixin_verb", metavar="VERB", required=True)
    summary = "list all mixins with their command, name and origin"
    listing = verbs.add_parser("list", help=summary, description=summary)
    summary = "print the options of mixins"
    showing = verbs.add_parser("show", help=summary, description=summary)
    showing.add_argument("of", nargs="?", metavar="COMMAND", help="only mixins of this command")
    showing.add_argument("name", nargs="?", metavar="MIXIN", help="only this mixin")
    for verb in (listing, showing):
        verb.add_argument(
            "--mixin-files",
            nargs="*",
            default=[],
            metavar="FILE",
            help="additional mixin files",
        )


def run(options: argparse.Namespace) -> int:
    """Print the names or the options of mixins."""
    mixins = read_mixins(home(os.environ), options.mixin_files)
    if options.mixin_verb == "list":
        for mixin in _sorted(mixins):
            print(f"{mixin.verb}\t{mixin.name}\t({mixin.place or 'forge'})")
        return 0
    chosen = [mixin for mixin in _sorted(mixins) if _matches(mixin, options)]
    if not chosen:
        wanted = f"'{options.name}' for '{options.of}'" if options.name else f"for '{options.of}'"
        known = (
            [name for verb, name in mixins if verb == options.of] if options.name else [v for v, _ in mixins]
        )
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
    return 0


def _sorted(mixins: Mixins) -> list[Mixin]:
    return [mixins[key] for key in sorted(mixins)]


def _matches(mixin: Mixin, options: argparse.Namespace) -> bool:
    return options.of in {None, mixin.verb} and options.name in {None, mixin.name}
