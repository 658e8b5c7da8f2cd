"""Stores on a server: the same laws for nginx, for folders and for memory."""

from __future__ import annotations

import hashlib
import os
import subprocess
import threading
import time
import uuid
from dataclasses import replace
from typing import TYPE_CHECKING

import fsspec
import pytest
import urllib3
from fsspec.registry import _registry

from forge.cache import action_result
from forge.cache.model import ActionResult, BlobFault, Digest, OutputFile, WritingRefused
from forge.cache.remote import Remote, open_remote
from tests.nginx import documented, serving

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
    """Run one server for all tests here."""
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
    with pytest.raises(BlobFault, match="does not match its SHA-256"):
        store.fetch(wrong, tmp_path / "target")
    for size in (len(BYTES) - 1, len(BYTES) + 1, 0):
        with pytest.raises(BlobFault, match=" bytes"):
            store.fetch(replace(wrong, size=size), tmp_path / "target")
    assert list(tmp_path.glob("target*")) == []
    store.close()


@pytest.mark.needs("/usr/sbin/nginx")
def test_nginx_gives_nothing_else(nginx: Nginx) -> None:
    """What lies beside the cache is nobody's business, and keys are nothing but keys."""
    (nginx.files / "secret").write_text("secret", encoding="utf-8")
    pool = urllib3.PoolManager()
    for method in ("GET", "PUT"):
        for path in ("secret", "ac/..%2fsecret", "ac/short", f"cas/{KEY}x", f"other/{KEY}", "incoming/", ""):
            assert pool.request(method, f"{nginx.url}/{path}", body=b"x").status in {400, 404}
    assert pool.request("DELETE", f"{nginx.url}/cas/{KEY}").status == 405
    pool.clear()


@pytest.mark.needs("/usr/sbin/nginx")
def test_many_may_write_one_blob_at_the_same_time(nginx: Nginx, tmp_path: Path) -> None:
    """Whoever reads meanwhile gets all of it or nothing."""
    source = tmp_path / "source"
    source.write_bytes(BYTES * 10)
    digest = Digest(hashlib.sha256(BYTES * 10).hexdigest(), len(BYTES) * 10)
    stores = [opened(nginx.url) for _ in range(4)]
    found = []

    def exchange(number: int) -> None:
        for _ in range(10):
            stores[number].put(digest, source)
            target = tmp_path / f"{number}"
            found.append(stores[-1 - number].fetch(digest, target))
            target.unlink()

    threads = [threading.Thread(target=exchange, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [True] * 40
    for store in stores:
        store.close()


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Nginx]:
    """Run nginx as the page has it for teams of which not everybody may write: with TLS and passwords."""
    etc = tmp_path / "etc"
    for folder in ("nginx", "ssl/certs", "ssl/private"):
        (etc / folder).mkdir(parents=True)
    argv = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=cache"]
    argv += ["-addext", "subjectAltName=IP:127.0.0.1"]
    argv += ["-keyout", str(etc / "ssl/private/cache.key"), "-out", str(etc / "ssl/certs/cache.pem")]
    subprocess.run(argv, check=True, capture_output=True)
    password = subprocess.run(
        ["openssl", "passwd", "-apr1", "se:cret"], check=True, capture_output=True, text=True
    ).stdout
    (etc / "nginx/forge-cache.passwords").write_text(f"ci:{password}", encoding="utf-8")
    with serving(tmp_path, documented(1), "https") as running:
        yield running


@pytest.mark.needs("/usr/sbin/nginx", "openssl")
def test_everybody_reads_and_some_write(
    guarded: Nginx, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    said: list[str] = []
    stranger = open_remote(guarded.url, seconds=10, writable=True, variables={}, report=said.append)
    assert stranger.result(KEY) is None
    assert said == [f"{guarded.url}: TLS error: self-signed certificate; disabled for this build"]
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "etc/ssl/certs/cache.pem"))
    writer = opened(guarded.url.replace("//", "//ci:se%3Acret@"))
    writer.put(DIGEST, source)
    writer.put_result(KEY, RESULT)
    reader = open_remote(guarded.url, seconds=10, writable=True, variables={}, report=said.append)
    other = Digest(hashlib.sha256(b"other").hexdigest(), 5)
    with pytest.raises(WritingRefused, match="401: set a password"):
        reader.put(other, source)
    assert reader.result(KEY) == RESULT
    assert reader.fetch(DIGEST, tmp_path / "target")
    assert len(said) == 2
    for store in (stranger, writer, reader):
        store.close()


def test_nobody_sees_half_a_file_of_a_folder(tmp_path: Path) -> None:
    """What is written lies under another name until it is whole, and nothing is left of what failed."""
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(f"file://{tmp_path}/store")
    source.write_bytes(BYTES[:-1])
    with pytest.raises(BlobFault, match="truncated during the upload"):
        store.put(DIGEST, source)
    assert [path for path in (tmp_path / "store").rglob("*") if path.is_file()] == []
    store.close()


@pytest.mark.parametrize("scheme", ["file", "memory"])
def test_a_library_that_hangs_is_left_behind(
    scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    over = threading.Event()
    monkeypatch.setattr(fsspec.get_filesystem_class(scheme), "open", lambda *_, **__: over.wait(60))
    said: list[str] = []
    url = f"{scheme}://me:secret@{tmp_path}"
    store = open_remote(url, seconds=0.3, writable=True, variables={}, report=said.append)
    begun = time.monotonic()
    assert store.result(KEY) is None
    assert time.monotonic() - begun < 2
    assert said == [f"{scheme}://{tmp_path}: timed out after 0.3 s; disabled for this build"]
    over.set()


def test_what_a_library_raises_is_told_without_passwords(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("cannot reach sftp://me:sec@ret@host/x\nand more")

    monkeypatch.setattr(fsspec.get_filesystem_class("memory"), "open", fail)
    said: list[str] = []
    url = "memory://me:sec@ret@host/x"
    store = open_remote(url, seconds=5, writable=True, variables={}, report=said.append)
    assert not store.fetch(DIGEST, tmp_path / "target")
    assert said == ["memory://host/x: RuntimeError: cannot reach sftp://host/x; disabled for this build"]


def test_a_place_that_cannot_be_written_is_told(url: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(url)
    store.put(DIGEST, source)
    for target, words in (
        (tmp_path / "none" / "blob", "No such file"),
        (source, "File exists"),
        (source / "blob", "Not a directory"),
    ):
        with pytest.raises(BlobFault, match=f"cannot write .*{words}"):
            store.fetch(DIGEST, target)
    assert source.read_bytes() == BYTES
    store.close()


def test_a_name_that_is_no_text_cannot_be_sent(url: str) -> None:
    store = opened(url)
    with pytest.raises(BlobFault, match="cannot encode a file name"):
        store.put_result(KEY, ActionResult((OutputFile(os.fsdecode(b"\xff"), DIGEST),)))
    assert store.result(KEY) is None
    store.close()


@pytest.mark.parametrize(
    ("data", "words"), [(b"<html>", "is not a valid result"), (b"x" * 2000, "too large for a result")]
)
def test_what_is_no_result_is_told(
    data: bytes, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(action_result, "MAX_SIZE", 1000)
    (tmp_path / "ac").mkdir()
    (tmp_path / "ac" / KEY).write_bytes(data)
    store = opened(f"file://{tmp_path}")
    with pytest.raises(BlobFault, match=words):
        store.result(KEY)
    store.close()


def test_in_a_bucket_nothing_is_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files appear whole there, folders are none, and moving would be copying."""
    monkeypatch.setattr("forge.cache.fsspec_store._BUCKETS", frozenset({"memory"}))
    kind = fsspec.get_filesystem_class("memory")
    for name in ("mv", "makedirs"):
        monkeypatch.setattr(kind, name, lambda *_, **__: pytest.fail("moved"))
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(f"memory://{uuid.uuid4().hex}")
    store.put(DIGEST, source)
    assert store.fetch(DIGEST, tmp_path / "target")
    store.close()


def test_ssh_is_told_to_know_its_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Left to itself sshfs believes every server; this is how it is told to ask ~/.ssh/known_hosts."""
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
