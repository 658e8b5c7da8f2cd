"""`forge cache`: inspect, prune and verify the package cache."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from forge.base.errors import HostError, Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.options import option, options_of
from forge.base.text import counted
from forge.cache.folder_store import FolderStore
from forge.cache.maintenance import DEFAULT_SIZE, prune, read_counts, scan_store, verify
from forge.cache.opening import byte_count, cache_folder, foreign_store
from forge.cli.main import Parser
from forge.cli.options import add_verb


@frozen
class _Options:
    cache: str | None = option("cache folder (default: ~/.cache/forge/packages)", metavar="DIR")


@frozen
class _PruneOptions:
    folder: _Options = options_of(_Options)
    size: int = option(
        "target size; 0 empties the cache (default: 20G)",
        default=DEFAULT_SIZE,
        parse=byte_count,
        metavar="SIZE",
    )


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "stats", "print the size of the cache and its hit rate", _Options, _stats)
    add_verb(verbs, "prune", "remove the least recently used entries", _PruneOptions, _prune)
    summary = "verify the checksums of all entries and remove corrupt ones"
    add_verb(verbs, "verify", summary, _Options, _verify)


@contextmanager
def _opened(options: _Options) -> Iterator[FolderStore]:
    """Yield the store; raises ForgeError if the folder is no cache or cannot be accessed."""
    store = FolderStore(cache_folder(options.cache, os.environ))
    raise_if_any(foreign_store(store.folder), SelectionError)
    try:
        yield store
    except OSError as error:
        path = os.fspath(error.filename or store.folder)
        raise HostError(Problem(f"cannot access the cache: {path}: {error.strerror}")) from error


def _stats(options: _Options) -> int:
    with _opened(options) as store:
        shelf, counts = scan_store(store), read_counts(store.folder)
    lookups = counts.restored + counts.missed
    share = f" ({100 * counts.restored / lookups:.0f} %)" if lookups else ""
    print(f"folder:    {store.folder}")
    print(f"size:      {_shown(shelf.size)} in {len(shelf.blobs)} blobs")
    print(f"hits:      {counts.restored} of {lookups} lookups{share}")
    return 0


def _prune(options: _PruneOptions) -> int:
    with _opened(options.folder) as store:
        files, size = prune(store, options.size)
        left = scan_store(store).size
    print(f"removed {_shown(size)} in {counted(files, 'file')}; {_shown(left)} left")
    return 0


def _verify(options: _Options) -> int:
    """Print the corrupt entries, which are already removed; return 1 if there are any."""
    with _opened(options) as store:
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
