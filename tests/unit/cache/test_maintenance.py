"""What pruning removes, and in which order."""

import os
import time
from pathlib import Path

from forge.cache.folder_store import FolderStore
from forge.cache.maintenance import prune, prune_entries
from forge.cache.model import ActionResult, CacheEntry

HOUR = 3600.0


def entry(name: str, hours: float, size: int = 10) -> CacheEntry:
    return CacheEntry("source", name, Path(name), size, time.time() - hours * HOUR)


def test_results_unused_since_a_date_are_removed(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    for key, used in (("ab" * 32, 100.0), ("cd" * 32, 300.0)):
        store.put_result(key, ActionResult())
        os.utime(store.result_path(key), (used, used))
    assert prune(store, 1 << 30, since=50.0) == (0, 0)
    assert prune(store, 1 << 30, since=200.0)[0] == 1
    assert [store.result_path(key).exists() for key in ("ab" * 32, "cd" * 32)] == [False, True]


def test_least_recently_used_entries_are_removed_until_the_size_is_reached() -> None:
    entries = [entry("young", 0.5), entry("old", 30), entry("middle", 20), entry("new", 10)]
    removed = prune_entries(entries, lambda _: True, 25)
    assert [each.name for each in removed] == ["old", "middle"]
    assert [each.name for each in prune_entries(entries, lambda _: True, 0)] == ["old", "middle", "new"]


def test_entries_that_cannot_be_removed_are_counted() -> None:
    entries = [entry("old", 30), entry("middle", 20), entry("new", 10)]
    removed = prune_entries(entries, lambda each: each.name != "old", 20)
    assert [each.name for each in removed] == ["middle"]


def test_entries_unused_since_a_date_are_removed() -> None:
    entries = [entry("old", 30), entry("new", 10)]
    removed = prune_entries(entries, lambda _: True, 1 << 30, time.time() - 20 * HOUR)
    assert [each.name for each in removed] == ["old"]
