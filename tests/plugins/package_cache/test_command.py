"""Which entries of plugins pruning removes, and in which order."""

import time
from pathlib import Path

from forge.cache.model import CacheEntry
from forge.plugins.package_cache.command import prune_entries

HOUR = 3600.0


def entry(name: str, hours: float, size: int = 10) -> CacheEntry:
    return CacheEntry("source", name, Path(name), size, time.time() - hours * HOUR)


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
