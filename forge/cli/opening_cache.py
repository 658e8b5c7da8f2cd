"""Opens the package cache of a build according to its options and environment."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import cache_home
from forge.base.errors import Problem
from forge.cache.folder_store import FolderStore
from forge.cache.package_cache import PackageCache
from forge.cache.pruning import DEFAULT_SIZE, prune
from forge.cache.tallying import Counts, add_counts
from forge.cli.options import remote_cache
from forge.workspace.load import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping

    from forge.build.state import Records
    from forge.cache.package_cache import CacheContext


def folder_of(option: str | None, variables: Mapping[str, str]) -> Path:
    """Return the cache folder: the option's value, else $FORGE_CACHE_DIR/packages, else the user's cache."""
    return Path(option).expanduser().absolute() if option else cache_home(variables) / "packages"


@contextmanager
def open_cache(
    options: argparse.Namespace, context: CacheContext, records: Records, variables: Mapping[str, str]
) -> Iterator[PackageCache]:
    """Yield the cache of a build; on exit finish uploads, store statistics and prune.

    Raises ForgeError for an invalid URL.
    """
    local = FolderStore(folder_of(options.cache, variables))
    remote = uploads = None
    if url := remote_cache(options, variables):
        from forge.cache.remote import open_remote  # noqa: PLC0415  (most builds have none)
        from forge.cache.uploads import Uploads  # noqa: PLC0415

        remote = open_remote(
            url,
            seconds=options.cache_timeout,
            writable=not options.cache_read_only,
            variables=variables,
            report=lambda message: warn([Problem(f"remote cache: {message}")]),
        )
        uploads = None if options.cache_read_only else Uploads(remote)
    cache = PackageCache(context, local, remote, uploads, lambda problem: warn([problem]))
    try:
        yield cache
        if uploads and (unsent := uploads.finish(options.cache_timeout)):
            results = "results were" if unsent > 1 else "result was"
            warn([Problem(f"{unsent} {results} not uploaded to the remote cache")])
    finally:
        records.record_trees(cache.computed_trees)
        if remote:
            remote.close()
        _tidy(cache, local, options.cache_size)


def _tidy(cache: PackageCache, local: FolderStore, size: int | None) -> None:
    """Update the cache statistics, and prune the folder if it has grown."""
    try:
        add_counts(local.folder, Counts(len(cache.restored), len(cache.missed)), local.rights)
        if cache.has_grown:
            prune(local, DEFAULT_SIZE if size is None else size)
    except OSError as error:
        path = os.fspath(error.filename or local.folder)
        warn([Problem(f"package cache: {path}: {error.strerror}")])
