"""Which cache a build has, by its options and the environment, from its opening to its end."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from forge.caching.folder_store import FolderStore
from forge.caching.package_cache import PackageCache
from forge.caching.pruning import DEFAULT_SIZE, prune
from forge.caching.tallying import Counts, count
from forge.errors import Problem
from forge.options import remote_cache
from forge.settings import cache_home
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping

    from forge.caching.package_cache import Circle
    from forge.records import Records


def folder_of(said: str | None, variables: Mapping[str, str]) -> Path:
    """Return the folder that an option names, else that of the environment, else the user's own."""
    return Path(said).expanduser().absolute() if said else cache_home(variables) / "packages"


@contextmanager
def open_cache(
    options: argparse.Namespace, circle: Circle, records: Records, variables: Mapping[str, str]
) -> Iterator[PackageCache]:
    """Yield the cache of a build; at the end what is left to do for it is done.

    Raises ForgeError for a URL that is none.
    """
    local = FolderStore(folder_of(options.cache, variables))
    remote = uploads = None
    if url := remote_cache(options, variables):
        from forge.caching.remote import open_remote  # noqa: PLC0415  (most builds have none)
        from forge.caching.uploads import Uploads  # noqa: PLC0415

        remote = open_remote(
            url,
            seconds=options.cache_timeout,
            writable=not options.cache_read_only,
            variables=variables,
            report=lambda said: warn([Problem(f"the remote cache: {said}")]),
        )
        uploads = None if options.cache_read_only else Uploads(remote)
    cache = PackageCache(circle, local, remote, uploads, lambda problem: warn([problem]))
    try:
        yield cache
        if uploads and (unsent := uploads.finish(options.cache_timeout)):
            warn([Problem(f"{unsent} result{'s' if unsent > 1 else ''} did not get into the remote cache")])
    finally:
        records.learn_trees(cache.looked)
        if remote:
            remote.close()
        _tidy(cache, local, options.cache_size)


def _tidy(cache: PackageCache, local: FolderStore, size: int | None) -> None:
    """Count what came of it, and keep the folder within its size if it has grown."""
    try:
        count(local.folder, Counts(len(cache.restored), len(cache.missed)), local.rights)
        if cache.grown:
            prune(local, DEFAULT_SIZE if size is None else size)
    except OSError as error:
        place = os.fspath(error.filename or local.folder)
        warn([Problem(f"the cache: {place}: {error.strerror}")])
