"""`forge lsp`: answer an editor's questions about interface definitions and package.xml."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.distributions import distribution_option
from forge.base.errors import HostError, Problem
from forge.base.frozen import frozen
from forge.base.options import flag
from forge.base.own_environment import extra_command
from forge.cli.commands.interface.inputs import distribution_of
from forge.cli.options import profile_option
from forge.environment.installed import known_prefixes
from forge.interfaces.read.sources import Library
from forge.workspace.root import find_install, find_root

if TYPE_CHECKING:
    from forge.plugins.lsp.index import Index


@frozen
class Options:
    stdio: bool = flag("use standard input and output, which is the default; many editors pass this option")
    rosdistro: str | None = distribution_option()
    profile: str | None = profile_option()


def run(options: Options) -> int:
    """Answer requests until the editor ends the session."""
    try:
        from forge.plugins.lsp.server import serve
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in {"pygls", "lsprotocol"}:
            raise
        problem = Problem("'forge lsp' needs pygls 2", hint=f"run: {extra_command('lsp')}")
        raise HostError(problem) from None
    serve(lambda folder: _open(folder, options))
    return 0


def _open(folder: Path, options: Options) -> Index:
    """Return the index of the workspace around a folder."""
    from forge.plugins.lsp.index import Index

    root = find_root(folder, Path.home())
    install = find_install(root, Path.home(), options.profile)
    library = Library(
        prefixes=known_prefixes(os.environ, install), rosdistro=distribution_of(options.rosdistro, root)
    )
    index = Index(root, library, os.environ)
    index.scan()
    # The index is permanent: garbage collection between responses can skip it.
    gc.freeze()
    return index
