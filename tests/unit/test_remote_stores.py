"""Stores on a server: the same laws for nginx, for folders and for memory."""

from __future__ import annotations

import hashlib
import os
import uuid
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from forge.caching.faults import BlobFault
from forge.caching.model import ActionResult, Digest, OutputFile
from forge.caching.remote import Remote, open_remote
from tests.nginx import serving

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.nginx import Nginx

KEY = "ab" * 32
BYTES = os.urandom(300_000)
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))
RESULT = ActionResult(
    (OutputFile("files.tar", DIGEST), OutputFile("run me", DIGEST, executable=True)), b"note"
)


@pytest.fixture(scope="module")
def nginx(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nginx]:
    """Run one server for all tests here; they use folders of their own... which are keys of their own."""
    with serving(tmp_path_factory.mktemp("nginx")) as running:
        yield running


@pytest.fixture(params=[pytest.param("nginx", marks=pytest.mark.needs("/usr/sbin/nginx")), "file", "memory"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Give the URL of an empty store."""
    if request.param == "nginx":
        running = request.getfixturevalue("nginx")
        for path in running.files.glob("*/*"):
            path.unlink()
        return str(running.url)
    return f"file://{tmp_path}/a store" if request.param == "file" else f"memory://{uuid.uuid4().hex}"


def opened(url: str, *, seconds: float = 10, writable: bool = True, **variables: str) -> Remote:
    """Open a store of which no fault is expected."""
    return open_remote(url, seconds=seconds, writable=writable, variables=variables, report=pytest.fail)


def test_what_was_put_is_there_and_nothing_else(url: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(url)
    assert store.result(KEY) is None
    assert not store.fetch(DIGEST, tmp_path / "target")
    assert not (tmp_path / "target").exists()
    for _ in range(2):
        store.put(DIGEST, source)
        store.put_result(KEY, RESULT)
    store.close()
    other = opened(url)
    assert other.result(KEY) == RESULT
    assert other.result("cd" * 32) is None
    assert other.fetch(DIGEST, tmp_path / "target")
    assert (tmp_path / "target").read_bytes() == BYTES
    other.close()


def test_the_name_of_another_blob_does_not_get_these_bytes(url: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(url)
    wrong = Digest(hashlib.sha256(b"other").hexdigest(), len(BYTES))
    store.put(wrong, source)
    with pytest.raises(BlobFault, match="another SHA-256"):
        store.fetch(wrong, tmp_path / "target")
    for size in (len(BYTES) - 1, len(BYTES) + 1, 0):
        with pytest.raises(BlobFault, match="should have"):
            store.fetch(replace(wrong, size=size), tmp_path / "target")
    assert list(tmp_path.glob("target*")) == []
    store.close()
