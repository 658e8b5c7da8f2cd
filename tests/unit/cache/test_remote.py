"""A remote store is disabled after its first fault, which is reported once; uploads run during the build."""

from __future__ import annotations

import hashlib
import re
import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import ForgeError
from forge.cache.model import ActionResult, BlobError, Digest, OutputFile, StoreError, WritingRefused
from forge.cache.remote import Remote, open_remote
from forge.cache.uploads import Uploads

if TYPE_CHECKING:
    from pathlib import Path


KEY = "ab" * 32
BYTES = b"bytes"
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))
RESULT = ActionResult((OutputFile("pack", DIGEST),))


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Give the file of the blob."""
    path = tmp_path / "source"
    path.write_bytes(BYTES)
    return path


@dataclass
class Fake:
    """A store that does what a test says: raises a fault, or takes its time, or both."""

    fault: StoreError | None = None
    seconds: float = 0
    name: str = "fake"
    asked: list[str] = field(default_factory=list)
    closed: threading.Event = field(default_factory=threading.Event)

    def _do(self, what: str) -> None:
        self.asked.append(what)
        self.closed.wait(self.seconds)
        if self.fault is not None:
            raise self.fault

    def result(self, key: str) -> ActionResult | None:
        """Return the one result."""
        self._do(f"result {key[:2]}")
        return RESULT

    def put_result(self, key: str, result: ActionResult) -> None:
        """Note that."""
        self._do(f"put_result {key[:2]} {len(result.files)}")

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Note that."""
        self._do(f"fetch {digest.size} {target.name}")
        return True

    def put(self, digest: Digest, source: Path) -> None:
        """Note that."""
        self._do(f"put {digest.size} {source.name}")

    def close(self) -> None:
        """Note that."""
        self.closed.set()


def test_a_failing_store_is_tried_and_reported_once(source: Path) -> None:
    store, said = Fake(StoreError("fake: no connection")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for _ in range(3):
        assert remote.result(KEY) is None
        assert not remote.fetch(DIGEST, source)
    for _ in range(2):
        with pytest.raises(StoreError, match="disabled for this build"):
            remote.put(DIGEST, source)
    assert store.asked == ["result ab"]
    assert said == ["fake: no connection; disabled for this build"]
    assert store.closed.is_set()


def test_a_corrupt_blob_does_not_disable_the_store(source: Path) -> None:
    store, said = Fake(BlobError("spoilt")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for ask in (lambda: remote.fetch(DIGEST, source), lambda: remote.put(DIGEST, source)) * 2:
        with pytest.raises(BlobError, match="spoilt"):
            ask()
    assert len(store.asked) == 4
    assert said == []


def test_a_rejected_upload_does_not_stop_downloads(source: Path) -> None:
    store, said = Fake(WritingRefused("fake: 403")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for _ in range(3):
        with pytest.raises(StoreError):
            remote.put(DIGEST, source)
    assert said == ["fake: 403; uploads are disabled for this build"]
    store.fault = None
    assert remote.result(KEY) == RESULT
    assert store.asked == ["put 5 source", "result ab"]


def test_many_slow_responses_disable_the_store(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forge.cache.remote._TOLERATED_SECONDS", 0.05)
    store, said = Fake(seconds=0.25), list[str]()
    remote = Remote(store, 0.5, said.append, writable=True)
    answers = [remote.result(KEY) for _ in range(6)]
    assert answers[0] == RESULT
    assert answers[-1] is None
    assert len(said) == 1
    assert re.fullmatch(
        r"fake: too slow, this build has waited 0\.\d s for it; disabled for this build", said[0]
    )


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("", "not a valid URL"),
        ("host:8080", "characters|valid URL|unsupported URL scheme 'host'"),
        ("/srv/cache", "not a valid URL"),
        ("http:///x", "not a valid URL"),
        ("http://h:99999/", "not a valid URL"),
        ("http://h:x/", "not a valid URL"),
        ("http://[::1/", "not a valid URL"),
        ("http://h/a b", "invalid characters"),
        ("http://h/\r\nX: y", "invalid characters"),
        ("http://h/\N{SNOWMAN}", "invalid characters"),
        ("memory://a\nb", "invalid characters"),
        ("http://me:secret@h/?a=b", "'[?]' or '#'"),
        ("https://h/#a", "'[?]' or '#'"),
        ("htp://h/", "unsupported URL scheme 'htp'"),
    ],
)
def test_an_invalid_url_is_a_user_error(url: str, words: str) -> None:
    with pytest.raises(ForgeError, match=words) as raised:
        open_remote(url, seconds=1, writable=True, variables={}, report=pytest.fail)
    assert "secret" not in str(raised.value)


def test_uploads_can_be_added_after_a_pause(source: Path) -> None:
    store = Fake()
    uploads = Uploads(store, limit=1)
    for number in range(3):
        uploads.add(str(number) * 64, RESULT, {DIGEST: source})
        assert uploads.finish(5) == 0
    assert store.asked == ["put 5 source", "put_result 00 1", "put_result 11 1", "put_result 22 1"]


def test_waiting_for_uploads_ends_without_progress() -> None:
    store = Fake(seconds=0.2)
    uploads = Uploads(store, limit=1)
    for number in range(4):
        uploads.add(str(number) * 64, RESULT, {})
    assert uploads.finish(0.5) == 0
    stuck = Fake(seconds=60)
    uploads = Uploads(stuck, limit=1)
    for number in range(4):
        uploads.add(str(number) * 64, RESULT, {})
    begun = time.monotonic()
    assert uploads.finish(0.3) == 4
    assert time.monotonic() - begun < 2
    stuck.close()


def test_exceptions_in_upload_threads_are_raised() -> None:
    store = Fake()
    store.put_result = None  # type: ignore[assignment,method-assign]
    uploads = Uploads(store)
    uploads.add(KEY, RESULT, {})
    with pytest.raises(TypeError):
        uploads.finish(5)
