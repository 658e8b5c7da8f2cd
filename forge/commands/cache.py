"""`forge cache`: look after the folder in which builds keep what packages install."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge import options as shared
from forge.caching.folder_store import FolderStore
from forge.caching.opening import folder_of
from forge.caching.pruning import DEFAULT_SIZE, look, prune
from forge.caching.tallying import counted
from forge.caching.verifying import verify
from forge.errors import EnvironmentFault, Problem

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the verbs of `forge cache`."""
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    _verb(verbs, "stats", "say what is in the cache, and how often it helped", _stats)
    pruning = _verb(verbs, "prune", "remove what was used least of late", _prune)
    pruning.add_argument(
        "--size",
        type=shared.byte_count,
        default=DEFAULT_SIZE,
        metavar="SIZE",
        help="until it takes no more than this; 0 empties it (default: 20G)",
    )
    _verb(verbs, "verify", "read all of it, and remove what is not what its name says", _verify)


def run(options: argparse.Namespace) -> int:
    """Do what the verb says; returns 0, or 1 when something was spoilt."""
    store = FolderStore(folder_of(options.cache, os.environ))
    try:
        code: int = options.verb(store, options)
    except OSError as error:
        place = os.fspath(error.filename or store.folder)
        raise EnvironmentFault(Problem(f"the cache cannot be used: {place}: {error.strerror}")) from error
    return code


def _verb(
    verbs: argparse._SubParsersAction[Parser],
    word: str,
    summary: str,
    verb: Callable[[FolderStore, argparse.Namespace], int],
) -> argparse.ArgumentParser:
    parser = verbs.add_parser(word, help=summary, description=summary)
    parser.add_argument("--cache", metavar="DIR", help="the folder (default: the user's own)")
    parser.set_defaults(verb=verb)
    return parser


def _stats(store: FolderStore, _: argparse.Namespace) -> int:
    shelf, counts = look(store), counted(store.folder)
    asked = counts.restored + counts.missed
    share = f" ({100 * counts.restored / asked:.0f} %)" if asked else ""
    print(f"folder:    {store.folder}")
    print(f"size:      {_shown(shelf.size)} in {len(shelf.blobs)} blobs")
    print(f"restored:  {counts.restored} of {asked} packages that builds looked for{share}")
    return 0


def _prune(store: FolderStore, options: argparse.Namespace) -> int:
    files, size = prune(store, options.size)
    what = f"{_shown(size)} in {files} file{'' if files == 1 else 's'}"
    print(f"removed {what}; {_shown(look(store).size)} are left")
    return 0


def _verify(store: FolderStore, _: argparse.Namespace) -> int:
    """Say what was spoilt: it is gone already, so that nobody meets it again."""
    found = verify(store)
    for path, why in found.spoilt:
        print(f"removed {path.relative_to(store.folder)}: {why}")
    print(f"read {_shown(found.size)} in {found.files} files; {len(found.spoilt)} spoilt")
    return int(bool(found.spoilt))


def _shown(size: int) -> str:
    """Return bytes as people say them."""
    for unit, shift in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >> shift:
            return f"{size / (1 << shift):.1f} {unit}"
    return f"{size} bytes"
