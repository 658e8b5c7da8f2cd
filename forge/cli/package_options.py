"""Options for package discovery and selection, shared by all commands."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.options import option
from forge.cli.options import add_options, read_options
from forge.workspace.selection import Query

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser


@frozen
class OptionSources:
    """Where options come from besides the command line: forge.cli.config reads them."""

    GROUP = "options from files"

    profile: str | None = option("use the options of this profile in forge.toml", metavar="NAME")
    mixin: tuple[str, ...] | None = option(
        "use the options of these mixins; 'forge mixin show' shows them", nargs="*", metavar="NAME"
    )
    mixin_files: tuple[str, ...] | None = option("additional mixin files", nargs="*", metavar="FILE")


@frozen
class ListingOptions:
    """The options of commands that show packages and build none."""

    build_base: str = option(
        "build folder, for results of earlier builds (default: build)", default="build", metavar="DIR"
    )
    embedded: bool = option("include the packages embedded in forge", default=False)
    json: bool = option("print the output as JSON", default=False)


def add(parser: Parser) -> None:
    """Add the options for package discovery and selection."""
    add_options(parser, Query)
    add_options(parser, OptionSources)


def add_listing(parser: Parser) -> None:
    """Add the options of commands that show packages and build none."""
    add(parser)
    add_options(parser, ListingOptions)


def query_of(options: argparse.Namespace) -> Query:
    """Return the package options as given; raises SelectionError for an invalid depth."""
    return read_options(Query, options)


def has_selection(options: argparse.Namespace) -> bool:
    """Tell whether any option selects packages."""
    query = query_of(options)
    unlimited = Query(search=query.search, build_base=query.build_base, since=query.since)
    return query != replace(unlimited, no_test_dependencies=query.no_test_dependencies)
