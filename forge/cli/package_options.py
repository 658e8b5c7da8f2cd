"""Options for package discovery and selection, shared by all commands."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import print_warnings
from forge.base.frozen import frozen
from forge.base.options import option, options_of
from forge.workspace.load import load_workspace
from forge.workspace.selection import Query

if TYPE_CHECKING:
    from forge.workspace.load import LoadedWorkspace


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

    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    build_base: str = option(
        "build folder, for results of earlier builds (default: build)", default="build", metavar="DIR"
    )
    embedded: bool = option("include the packages embedded in forge", default=False)
    json: bool = option("print the output as JSON", default=False)

    def load(self) -> LoadedWorkspace:
        """Return the workspace in the current folder; print its warnings."""
        loaded = load_workspace(Path.cwd(), self.query, os.environ, embedded=self.embedded)
        print_warnings(loaded.warnings)
        return loaded


def has_selection(query: Query) -> bool:
    """Tell whether any option selects packages."""
    unlimited = Query(search=query.search, build_base=query.build_base, since=query.since)
    return query != replace(unlimited, no_test_dependencies=query.no_test_dependencies)
