"""What pruning removes, and in which order."""

import os
from pathlib import Path

from forge.cache.model import ActionResult
from forge.plugins.package_cache.folder_store import FolderStore
from forge.plugins.package_cache.maintenance import prune


def test_results_unused_since_a_date_are_removed(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    for key, used in (("ab" * 32, 100.0), ("cd" * 32, 300.0)):
        store.put_result(key, ActionResult())
        os.utime(store.result_path(key), (used, used))
    assert prune(store, 1 << 30, since=50.0) == (0, 0)
    assert prune(store, 1 << 30, since=200.0)[0] == 1
    assert [store.result_path(key).exists() for key in ("ab" * 32, "cd" * 32)] == [False, True]
