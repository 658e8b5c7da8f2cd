"""Remote stores behave alike: nginx, folders and memory."""

import hashlib
import os
import subprocess
import threading
import uuid
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import urllib3

from forge.cache.model import ActionResult, BlobError, Digest, OutputFile, StoreError
from forge.plugins.remote_cache.fsspec_backend import FsspecBackend
from forge.plugins.remote_cache.http_backend import HttpBackend
from forge.plugins.remote_cache.store import Store, WritingRefused
from tests.nginx import Nginx, documented, serving

KEY = "ab" * 32
BYTES = os.urandom(300_000)
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))
RESULT = ActionResult((OutputFile("files.tar", DIGEST), OutputFile("run me", DIGEST)), b"note")


@pytest.fixture(scope="module")
def nginx(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nginx]:
    with serving(tmp_path_factory.mktemp("nginx")) as running:
        yield running


@pytest.fixture(params=[pytest.param("nginx", marks=pytest.mark.needs("/usr/sbin/nginx")), "file", "memory"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "nginx":
        running = request.getfixturevalue("nginx")
        for path in running.files.glob("*/*"):
            path.unlink()
        return str(running.url)
    return f"file://{tmp_path}/a store" if request.param == "file" else f"memory://{uuid.uuid4().hex}"


def opened(url: str) -> Store:
    """Open a store whose exceptions are raised."""
    backend = HttpBackend(url, 10, {}) if url.startswith("http") else FsspecBackend(url)
    return Store(backend, url, seconds=10)


def test_stores_return_exactly_what_was_stored(url: str, tmp_path: Path) -> None:
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


def test_blobs_are_not_stored_under_a_wrong_digest(url: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(url)
    wrong = Digest(hashlib.sha256(b"other").hexdigest(), len(BYTES))
    store.put(wrong, source)
    with pytest.raises(BlobError, match="does not match its SHA-256"):
        store.fetch(wrong, tmp_path / "target")
    for size in (len(BYTES) - 1, len(BYTES) + 1, 0):
        with pytest.raises(BlobError, match=" bytes"):
            store.fetch(replace(wrong, size=size), tmp_path / "target")
    assert list(tmp_path.glob("target*")) == []
    store.close()


@pytest.mark.needs("/usr/sbin/nginx")
def test_nginx_serves_only_the_cache(nginx: Nginx) -> None:
    """Files beside the cache are not served, and keys cannot be paths."""
    (nginx.files / "secret").write_text("secret", encoding="utf-8")
    pool = urllib3.PoolManager()
    for method in ("GET", "PUT"):
        for path in ("secret", "ac/..%2fsecret", "ac/short", f"cas/{KEY}x", f"other/{KEY}", "incoming/", ""):
            assert pool.request(method, f"{nginx.url}/{path}", body=b"x").status in {400, 404}
    assert pool.request("DELETE", f"{nginx.url}/cas/{KEY}").status == 405
    pool.clear()


@pytest.mark.needs("/usr/sbin/nginx")
def test_concurrent_writes_of_one_blob_are_safe(nginx: Nginx, tmp_path: Path) -> None:
    """Concurrent readers get all of it or nothing."""
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
    """Run nginx with TLS and passwords for writers, as configured on the documentation page."""
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
def test_read_and_write_permissions_are_separate(
    guarded: Nginx, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    stranger = opened(guarded.url)
    with pytest.raises(StoreError) as fault:
        stranger.result(KEY)
    assert str(fault.value) == f"{guarded.url}: TLS error: self-signed certificate"
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "etc/ssl/certs/cache.pem"))
    writer = opened(guarded.url.replace("//", "//ci:se%3Acret@"))
    writer.put(DIGEST, source)
    writer.put_result(KEY, RESULT)
    reader = opened(guarded.url)
    other = Digest(hashlib.sha256(b"other").hexdigest(), 5)
    with pytest.raises(WritingRefused, match="401: set a password"):
        reader.put(other, source)
    assert reader.result(KEY) == RESULT
    assert reader.fetch(DIGEST, tmp_path / "target")
    for store in (stranger, writer, reader):
        store.close()


def test_an_unwritable_target_is_reported(url: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_bytes(BYTES)
    store = opened(url)
    store.put(DIGEST, source)
    for target, words in (
        (tmp_path / "none" / "blob", "No such file"),
        (source, "File exists"),
        (source / "blob", "Not a directory"),
    ):
        with pytest.raises(BlobError, match=f"cannot write .*{words}"):
            store.fetch(DIGEST, target)
    assert source.read_bytes() == BYTES
    store.close()


def test_names_that_are_not_utf8_cannot_be_stored(url: str) -> None:
    store = opened(url)
    with pytest.raises(BlobError, match="cannot encode a file name"):
        store.put_result(KEY, ActionResult((OutputFile(os.fsdecode(b"\xff"), DIGEST),)))
    assert store.result(KEY) is None
    store.close()
