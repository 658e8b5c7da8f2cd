"""`forge cache`: inspect, prune and verify the package cache."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem, SelectionError, raise_if_any
from forge.base.text import counted
from forge.cache.folder_store import FolderStore
from forge.cache.maintenance import DEFAULT_SIZE, prune, read_counts, scan_store, verify
from forge.cache.opening import byte_count, cache_folder, foreign_store
from forge.cli.options import argument_type

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from forge.cli.main import Parser


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    _verb(verbs, "stats", "print the size of the cache and its hit rate", _stats)
    pruning = _verb(verbs, "prune", "remove the least recently used entries", _prune)
    pruning.add_argument(
        "--size",
        type=argument_type(byte_count),
        default=DEFAULT_SIZE,
        metavar="SIZE",
        help="target size; 0 empties the cache (default: 20G)",
    )
    _verb(verbs, "verify", "verify the checksums of all entries and remove corrupt ones", _verify)


def run(options: argparse.Namespace) -> int:
    """Run the verb; returns 0, or 1 if the cache contained corrupt entries."""
    store = FolderStore(cache_folder(options.cache, os.environ))
    raise_if_any(foreign_store(store.folder), SelectionError)
    try:
        code: int = options.verb(store, options)
    except OSError as error:
        path = os.fspath(error.filename or store.folder)
        raise HostError(Problem(f"cannot access the cache: {path}: {error.strerror}")) from error
    return code


def _verb(
    verbs: argparse._SubParsersAction[Parser],
    word: str,
    summary: str,
    verb: Callable[[FolderStore, argparse.Namespace], int],
) -> argparse.ArgumentParser:
    parser = verbs.add_parser(word, help=summary, description=summary)
    parser.add_argument("--cache", metavar="DIR", help="cache folder (default: ~/.cache/forge/packages)")
    parser.set_defaults(verb=verb)
    return parser


def _stats(store: FolderStore, _: argparse.Namespace) -> int:
    shelf, counts = scan_store(store), read_counts(store.folder)
    lookups = counts.restored + counts.missed
    share = f" ({100 * counts.restored / lookups:.0f} %)" if lookups else ""
    print(f"folder:    {store.folder}")
    print(f"size:      {_shown(shelf.size)} in {len(shelf.blobs)} blobs")
    print(f"hits:      {counts.restored} of {lookups} lookups{share}")
    return 0


def _prune(store: FolderStore, options: argparse.Namespace) -> int:
    files, size = prune(store, options.size)
    what = f"{_shown(size)} in {counted(files, 'file')}"
    print(f"removed {what}; {_shown(scan_store(store).size)} left")
    return 0


def _verify(store: FolderStore, _: argparse.Namespace) -> int:
    """Print the corrupt entries, which are already removed."""
    found = verify(store)
    for path, why in found.corrupt:
        print(f"removed {path.relative_to(store.folder)}: {why}")
    print(f"read {_shown(found.size)} in {found.files} files; {len(found.corrupt)} corrupt")
    return int(bool(found.corrupt))


def _shown(size: int) -> str:
    for unit, shift in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >> shift:
            return f"{size / (1 << shift):.1f} {unit}"
    return f"{size} bytes"
