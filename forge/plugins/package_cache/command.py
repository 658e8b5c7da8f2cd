"""`forge cache`: inspect, prune and verify the package cache, and data cached by plugins."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from forge.base.errors import HostError, Problem, SelectionError, raise_if_any
from forge.base.extensions import CACHES, call, entry_points, find, installed
from forge.base.frozen import frozen
from forge.base.options import option, options_of
from forge.base.text import counted
from forge.cache.model import CacheEntry
from forge.cache.options import byte_count
from forge.cli.main import Parser
from forge.cli.options import NoOptions, add_verb
from forge.plugins.package_cache.folder_store import DRAFT, FolderStore, decode_result, sha256_of
from forge.plugins.package_cache.maintenance import (
    DEFAULT_SIZE,
    YOUNG_SECONDS,
    prune,
    read_counts,
    scan_store,
)
from forge.plugins.package_cache.opening import cache_folder, foreign_store

_DAY = 86400.0


@frozen
class _Options:
    cache: str | None = option("cache folder (default: ~/.cache/forge/packages)", metavar="DIR")


def _days(text: str) -> int:
    if not text.isdigit():
        raise ValueError(f"'{text}' is not a number of days")
    return int(text)


@frozen
class _PruneOptions:
    folder: _Options = options_of(_Options)
    size: int = option(
        "target size; 0 empties the cache (default: 20G)",
        default=DEFAULT_SIZE,
        parse=byte_count,
        metavar="SIZE",
    )
    unused_for: int | None = option(
        "also remove entries not used for this many days", parse=_days, metavar="DAYS"
    )


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "stats", "print the size of the cache and its hit rate", _Options, _stats)
    add_verb(verbs, "list", "list cached data of forge other than packages", NoOptions, _list)
    add_verb(verbs, "prune", "remove the least recently used entries", _PruneOptions, _prune)
    summary = "verify the checksums of all entries and remove corrupt ones"
    add_verb(verbs, "verify", summary, _Options, _verify)


@contextmanager
def _opened(options: _Options) -> Iterator[FolderStore]:
    """Yield the store; raises ForgeError if the folder is not a cache or cannot be accessed."""
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
    for name, plugin in _plugins(options.cache):
        if entries := _entries(name, plugin):
            kinds = Counter(entry.kind for entry in entries)
            words = ", ".join(counted(count, kind) for kind, count in kinds.items())
            print(f"{name + ':':<10} {_shown(sum(entry.size for entry in entries))} in {words}")
    return 0


def _list(_: NoOptions) -> int:
    """Print a line for each entry of plugins: kind, name, size, days since its last use, and path."""
    rows = [
        (entry.kind, entry.name, _shown(entry.size), _age(entry.used), os.fspath(entry.path))
        for name, plugin in _plugins()
        for entry in _entries(name, plugin)
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    return 0


def _prune(options: _PruneOptions) -> int:
    since = 0.0 if options.unused_for is None else time.time() - options.unused_for * _DAY
    with _opened(options.folder) as store:
        files, size = prune(store, options.size, since)
        left = scan_store(store).size
    print(f"removed {_shown(size)} in {counted(files, 'file')}; {_shown(left)} left")
    for name, plugin in _plugins(options.folder.cache):
        if not (entries := _entries(name, plugin)):
            continue
        removed = call(f"the cache '{name}'", prune_entries, entries, plugin.remove, options.size, since)
        for entry in removed:
            print(f"removed {entry.kind} {entry.name}")
        size = sum(entry.size for entry in removed)
        left = sum(entry.size for entry in entries) - size
        print(f"{name}: removed {_shown(size)} in {len(removed)} of {len(entries)}; {_shown(left)} left")
    return 0


def _verify(options: _Options) -> int:
    """Print the corrupt entries, and the faults of those of plugins; return 1 if there are any.

    Corrupt entries of the package cache are already removed.
    """
    with _opened(options) as store:
        result = verify(store)
    for path, why in result.corrupt:
        print(f"removed {path.relative_to(store.folder)}: {why}")
    print(f"read {_shown(result.size)} in {result.files} files; {len(result.corrupt)} corrupt")
    corrupt = bool(result.corrupt)
    for name, plugin in _plugins(options.cache):
        faults = list(call(f"the cache '{name}'", plugin.verify, os.environ))
        for path, why in faults:
            print(f"{path}: {why}")
        if count := len(_entries(name, plugin)):
            print(f"{name}: {len(faults)} of {count} entries have faults")
        corrupt = corrupt or bool(faults)
    return int(corrupt)


def _plugins(folder: str | None = None) -> Iterator[tuple[str, Any]]:
    """Yield the caches of plugins, unless a folder of packages is named."""
    if folder is None:
        for name in sorted({*installed(CACHES), *entry_points(CACHES)}):
            yield name, find(CACHES, name, "cache", ("entries", "remove", "verify"))


def _entries(name: str, plugin: Any) -> list[CacheEntry]:
    return list(call(f"the cache '{name}'", plugin.entries, os.environ))


def prune_entries(
    entries: Iterable[CacheEntry], remove: Callable[[CacheEntry], bool], size: int, since: float = 0.0
) -> list[CacheEntry]:
    """Remove the least recently used entries until they take at most `size` bytes, and return them.

    Entries that were not used `since` then are removed as well. Entries used in the last hour are kept, since
    a build may use them; `remove` returns whether it could remove an entry.
    """
    ordered = sorted(entries, key=lambda entry: entry.used)
    left, young = sum(entry.size for entry in ordered), time.time() - YOUNG_SECONDS
    removed = []
    for entry in ordered:
        if (left > size or entry.used < since) and entry.used < young and remove(entry):
            left -= entry.size
            removed.append(entry)
    return removed


@frozen
class VerifyResult:
    """The number and size of the files read, and the removed files with reasons."""

    files: int
    size: int
    corrupt: tuple[tuple[Path, str], ...]


def verify(store: FolderStore) -> VerifyResult:
    """Read every file of a store; remove corrupt blobs, unreadable results and results with missing blobs."""
    contents = scan_store(store)
    corrupt: list[tuple[Path, str]] = []
    for name, file in contents.blobs.items():
        # Drafts belong to a running or killed build; pruning removes them by age.
        with suppress(FileNotFoundError), file.path.open("rb") as stream:
            if not DRAFT.fullmatch(name) and sha256_of(stream.fileno()) != name:
                corrupt.append((file.path, "its content does not match its SHA-256"))
    blobs = contents.blobs.keys() - {path.name for path, _ in corrupt}
    for path in (file.path for file in contents.results):
        with suppress(FileNotFoundError):
            try:
                if not {file.digest.hash for file in decode_result(path.read_bytes()).files} <= blobs:
                    corrupt.append((path, "one of its blobs is missing"))
            except ValueError as error:
                corrupt.append((path, f"it cannot be read: {error}"))
    for path, _ in corrupt:
        path.unlink(missing_ok=True)
    return VerifyResult(len(contents.results) + len(contents.blobs), contents.size, tuple(corrupt))


def _age(used: float) -> str:
    days = int((time.time() - used) / _DAY)
    return f"{counted(days, 'day')} ago" if days > 0 else "today"


def _shown(size: int) -> str:
    for unit, shift in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >> shift:
            return f"{size / (1 << shift):.1f} {unit}"
    return f"{size} bytes"
