"""Stores that fsspec opens: faults of libraries, folders, buckets and ssh."""

import hashlib
import os
import threading
import time
import uuid
from pathlib import Path

import fsspec
import pytest
from fsspec.registry import _registry

from forge.cache.model import BlobError, Digest
from forge.plugins.remote_cache.fsspec_backend import FsspecBackend
from forge.plugins.remote_cache.store import Store
from tests.plugins.remote_cache.opening import opened

KEY = "ab" * 32
BYTES = os.urandom(300_000)
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))


def opened_store(url: str) -> Store:
    """Open a store without uploads in the background."""
    return Store(FsspecBackend(url), url, seconds=10)


def test_files_of_a_folder_store_appear_atomically(tmp_path: Path) -> None:
    """Files are written under another name first, and nothing is left of a failed upload."""
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened_store(f"file://{tmp_path}/store")
    source.write_bytes(BYTES[:-1])
    with pytest.raises(BlobError, match="truncated during the upload"):
        store.put(DIGEST, source)
    assert [path for path in (tmp_path / "store").rglob("*") if path.is_file()] == []
    store.close()


@pytest.mark.parametrize("scheme", ["file", "memory"])
def test_a_hanging_library_is_abandoned(scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    over = threading.Event()
    monkeypatch.setattr(fsspec.get_filesystem_class(scheme), "open", lambda *_, **__: over.wait(60))
    said: list[str] = []
    url = f"{scheme}://me:secret@{tmp_path}"
    store = opened(url, said, seconds=0.3)
    begun = time.monotonic()
    assert store.result(KEY) is None
    assert time.monotonic() - begun < 2
    assert said == [f"{scheme}://{tmp_path}: timed out after 0.3 s; disabled for this build"]
    over.set()


def test_library_errors_are_reported_without_passwords(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("cannot reach sftp://me:sec@ret@host/x\nand more")

    monkeypatch.setattr(fsspec.get_filesystem_class("memory"), "open", fail)
    said: list[str] = []
    url = "memory://me:sec@ret@host/x"
    store = opened(url, said)
    assert not store.fetch(DIGEST, tmp_path / "target")
    assert said == ["memory://host/x: RuntimeError: cannot reach sftp://host/x; disabled for this build"]


def test_objects_in_buckets_are_not_renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Objects appear atomically, there are no folders, and moving would copy."""
    monkeypatch.setattr("forge.plugins.remote_cache.fsspec_backend._BUCKETS", frozenset({"memory"}))
    kind = fsspec.get_filesystem_class("memory")
    for name in ("mv", "makedirs"):
        monkeypatch.setattr(kind, name, lambda *_, **__: pytest.fail("moved"))
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened_store(f"memory://{uuid.uuid4().hex}")
    store.put(DIGEST, source)
    assert store.fetch(DIGEST, tmp_path / "target")
    store.close()


def test_ssh_host_keys_are_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    """By default sshfs accepts every server; an empty tuple makes it read ~/.ssh/known_hosts."""
    given = {}

    class Shell(fsspec.get_filesystem_class("memory")):  # type: ignore[misc]
        def __init__(self, **words: object) -> None:
            given.update(words)
            super().__init__()

    monkeypatch.setitem(_registry, "ssh", Shell)
    store = opened("ssh://host/x")
    assert store.result(KEY) is None
    assert given["known_hosts"] == ()
    store.close()
