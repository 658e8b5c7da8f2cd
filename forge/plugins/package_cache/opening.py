"""The package cache of a build, as its options describe it."""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.env_vars import cache_home, expand_home
from forge.base.errors import Problem
from forge.cache.model import RemoteOptions
from forge.cache.options import open_remote
from forge.engine.variables import relevant_environment
from forge.plugins.package_cache.folder_store import FolderStore

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from forge.build.state import BuildState
    from forge.cli.preparation import PreparedBuild
    from forge.plugins.package_cache.package_cache import PackageCache


def cache_folder(option: str | None, variables: Mapping[str, str]) -> Path:
    """Return the cache folder: the option's value, else $FORGE_CACHE_DIR/packages, else the user's cache."""
    return expand_home(option).absolute() if option else cache_home(variables) / "packages"


def foreign_store(folder: Path) -> Iterator[Problem]:
    """Yield a problem for a folder that is not a cache, but contains files at paths that a cache uses."""
    if entry := FolderStore(folder).foreign_entry():
        message = f"the folder '{folder}' is not a package cache of forge: it contains '{entry}'"
        yield Problem(message, hint="choose another folder with '--cache'")


@contextmanager
def open_cache(build: PreparedBuild, state: BuildState, *, observed: bool) -> Iterator[PackageCache]:
    """Yield the cache of a build; on exit finish uploads, store statistics and prune.

    Raises ForgeError for an invalid URL, and for a cache folder that other users can write to.
    """
    # Builds without changes only check the options.
    from forge.plugins.package_cache.maintenance import DEFAULT_SIZE, Counts, add_counts, prune
    from forge.plugins.package_cache.package_cache import CacheContext, PackageCache
    from forge.plugins.package_cache.relocation import Relocator

    options, variables, warn, loaded = build.options.cache, build.variables, build.mode.warn, build.loaded
    layout = build.context.layout
    local = FolderStore(cache_folder(options.cache, variables))
    local.check()
    remote = None
    if options.remote_cache:
        remote_options = RemoteOptions(
            options.cache_timeout,
            not options.cache_read_only,
            variables,
            lambda message: warn([Problem(f"remote cache: {message}")]),
        )
        remote = open_remote(options.remote_cache, remote_options)
    context = CacheContext(
        layout=layout,
        relocator=Relocator(loaded.workspace.root, layout),
        needs=loaded.resolution.needs,
        tools=build.context.tools,
        records=state.journal.records,
        table=state.table,
        forced=frozenset(loaded.selection.names if build.options.forced_by else ()),
        values=dict(relevant_environment(variables)),
        observed=observed,
    )
    cache = PackageCache(context, local, remote, lambda problem: warn([problem]))
    try:
        yield cache
        if remote and (unsent := remote.finish()):
            results = "results were" if unsent > 1 else "result was"
            warn([Problem(f"{unsent} {results} not uploaded to the remote cache")])
    finally:
        for name, tree in cache.computed_trees.items():
            if not (record := state.journal.records[name]).tree:
                state.journal.set_record(name, replace(record, tree=tree))
        if remote:
            remote.close()
        try:
            add_counts(local.folder, Counts(len(cache.restored), len(cache.missed)), local.rights)
            if cache.has_grown:
                prune(local, DEFAULT_SIZE if options.cache_size is None else options.cache_size)
        except OSError as error:
            path = os.fspath(error.filename or local.folder)
            warn([Problem(f"package cache: {path}: {error.strerror}")])
