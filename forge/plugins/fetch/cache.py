"""Cached data of `forge fetch` and of builds with its locks, for `forge cache`.

An entry carries forge's mark: a source its record, a clone its description, an underlay its settings. Nothing
else is listed or removed.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from forge.base.errors import ForgeError
from forge.base.files import delete_tree, text_or_nothing
from forge.base.layout import LOCK_FILE
from forge.cache.model import CacheEntry
from forge.plugins.fetch import git
from forge.plugins.fetch.lock import cache_folder
from forge.plugins.fetch.records import changed_files, has_record, record_path
from forge.plugins.fetch.underlay import BUILT, SETTINGS, linked_sources, lock_path

_SOURCE, _CLONE, _UNDERLAY = "source", "clone", "underlay"


def entries(variables: Mapping[str, str]) -> Iterator[CacheEntry]:
    """Yield underlays, then sources and clones: of entries of the same age, the first is removed first."""
    cache = _cache(variables)
    last_uses: dict[Path, float] = {}
    for folder in _underlays(cache):
        last_use = _time_of(folder / BUILT) or _time_of(folder)
        for source in linked_sources(folder).values():
            last_uses[source] = max(last_use, last_uses.get(source, 0.0))
        yield CacheEntry(_UNDERLAY, folder.name, folder, _size(folder), last_use)
    for folder in _sources(cache):
        last_use = max(_time_of(folder), last_uses.get(folder, 0.0))
        name = f"{folder.parent.name} {folder.name.rpartition('-')[0]}"
        yield CacheEntry(_SOURCE, name, folder, _size(folder), last_use)
    for folder in _clones(cache):
        url = text_or_nothing(folder / "description").removeprefix(git.MARK).strip()
        yield CacheEntry(_CLONE, f"{url} {folder.stem[:12]}", folder, _size(folder), _time_of(folder))


def remove(entry: CacheEntry) -> bool:
    """Remove an entry, except an underlay that is being built and sources of an underlay."""
    if entry.kind == _UNDERLAY:
        locks = [lock_path(entry.path), entry.path / "build" / LOCK_FILE]
        with ExitStack() as stack:
            files = [stack.enter_context(path.open("a")) for path in locks if path.parent.is_dir()]
            try:
                for file in files:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return False
            # A build that looks for it now finds no entry instead of an incomplete one.
            (entry.path / BUILT).unlink(missing_ok=True)
            delete_tree(entry.path)
        return True
    if entry.kind == _SOURCE:
        underlays = (entry.path.parents[2] / "underlays").glob("*")
        if any(entry.path in linked_sources(path).values() for path in underlays):
            return False
    delete_tree(entry.path)
    if entry.kind == _SOURCE:
        record_path(entry.path).unlink(missing_ok=True)
    return True


def verify(variables: Mapping[str, str]) -> Iterator[tuple[Path, str]]:
    """Yield entries that differ from the download, with reasons; they are kept, since they may be edits."""
    cache = _cache(variables)
    for folder in _sources(cache):
        if changed := changed_files(folder):
            more = f" and {len(changed) - 1} more" if changed[1:] else ""
            yield (
                folder,
                f"'{changed[0]}'{more} changed after the download; remove the folder to get it again",
            )
    for folder in _clones(cache):
        if fault := git.fault(folder, folder.stem):
            yield folder, f"{fault}; remove the folder to get it again"
    for folder in _underlays(cache):
        if missing := [name for name, path in linked_sources(folder).items() if not path.is_dir()]:
            names = ", ".join(f"'{name}'" for name in missing)
            yield folder, f"the sources of {names} no longer exist; built packages stay usable"


def _cache(variables: Mapping[str, str]) -> Path:
    try:
        return cache_folder(variables)
    except ForgeError:
        return Path(os.devnull)  # without a private cache, there are no entries


def _underlays(cache: Path) -> list[Path]:
    mark = SETTINGS.splitlines()[0]
    return [
        path
        for path in sorted((cache / "underlays").glob("*-*"))
        if not path.is_symlink() and text_or_nothing(path / "forge.toml").startswith(mark)
    ]


def _sources(cache: Path) -> list[Path]:
    folders = sorted((cache / "sources").glob("*/*-*/"))
    return [path for path in folders if has_record(path) and not path.is_symlink()]


def _clones(cache: Path) -> list[Path]:
    folders = sorted((cache / "clones").glob("*.git"))
    return [path for path in folders if text_or_nothing(path / "description").startswith(git.MARK)]


def _time_of(path: Path) -> float:
    """Return the modification time, 0 if another process has removed the path meanwhile."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _size(folder: Path) -> int:
    """Return the size of the files in a folder, without following links."""
    size = 0
    for place, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):  # removed meanwhile
                size += os.lstat(os.path.join(place, name)).st_size  # noqa: PTH118  (each file of an underlay)
    return size
