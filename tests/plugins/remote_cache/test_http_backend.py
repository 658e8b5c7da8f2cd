"""HTTP servers that are slow, broken or hostile: one message in time, no file, and no second request."""

import hashlib
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from forge.base.errors import ForgeError
from forge.cache.model import ActionResult, BlobError, Digest, OutputFile, StoreError
from forge.plugins.remote_cache import deadline
from forge.plugins.remote_cache import store as stores
from forge.plugins.remote_cache.action_result import encode
from forge.plugins.remote_cache.http_backend import HttpBackend
from forge.plugins.remote_cache.store import Store, WritingRefused
from tests.plugins.remote_cache.opening import opened
from tests.rude import Moves, Request, Shelf, reply, rude

SECONDS = 0.3
"""The time limit in tests of slow servers."""
AMPLE = 30.0
"""The time limit in all other tests, so that a busy machine does not decide what they see."""
SLACK = 1.2
"""How late an answer may be on a busy machine."""

KEY = "ab" * 32
BYTES = os.urandom(200_000)
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))
RESULT = ActionResult((OutputFile("pack", DIGEST),))


@contextmanager
def in_time(seconds: float = SECONDS) -> Iterator[None]:
    """Check that a block ends in time, even with an exception."""
    begun = time.monotonic()
    try:
        yield
    finally:
        assert time.monotonic() - begun < seconds + SLACK


def raw(*moves: bytes | float | None) -> Callable[[Request], Moves]:
    """Answer all requests with the same moves."""
    return lambda _: moves


def endless(head: bytes, drop: bytes, pause: float) -> Callable[[Request], Moves]:
    """Answer with `head`, then with `drop` again and again."""
    return lambda _: itertools.chain([head], itertools.cycle([drop, pause] if pause else [drop]))


HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(BYTES)
CHUNKED = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
LATE = "timed out after 0.3 s|timed out|too slow"

SLOW = {
    "says nothing": (raw(60.0), LATE),
    "drips the first line": (endless(b"HTTP/1.1 200 ", b"O", 0.05), LATE),
    "drips headers": (endless(b"HTTP/1.1 200 OK\r\n", b"A: b\r\n", 0.05), LATE),
    "says 'continue' for ever": (endless(b"", b"HTTP/1.1 100 Continue\r\n\r\n", 0.05), LATE),
    "hangs in the middle": (raw(HEAD + BYTES[:1000], 60.0), LATE),
    "drips the body": (endless(HEAD, b"x", 0.05), LATE),
    "drips chunks": (endless(CHUNKED, b"1\r\nx\r\n", 0.05), LATE),
    "drips a body of any length": (endless(b"HTTP/1.1 200 OK\r\n\r\n", b"x", 0.05), LATE),
}
BROKEN = {
    "goes away": (raw(), "closed the connection"),
    "goes away in the first line": (raw(b"HTTP/1.1 2"), "."),
    "goes away in the middle": (raw(HEAD + BYTES[:1000]), "closed the connection"),
    "goes away in a chunk": (raw(CHUNKED + b"ff\r\nabc"), "closed the connection"),
    "speaks another language": (raw(b"SSH-2.0-OpenSSH_9.2\r\n"), "."),
    "sends a chunk of no size": (raw(CHUNKED + b"zz\r\nabc\r\n"), "."),
    "sends headers for ever": (endless(b"HTTP/1.1 200 OK\r\n", b"A: b\r\n", 0), "."),
    "sends a header for ever": (endless(b"HTTP/1.1 200 OK\r\nA: ", b"b" * 1000, 0), "."),
    "announces two lengths": (
        raw(b"HTTP/1.1 200 OK\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab"),
        ".",
    ),
    "500": (lambda _: reply(500, b"<html>"), "HTTP status 500"),
    "503 and closes": (raw(b"HTTP/1.1 503 Busy\r\n\r\n"), "HTTP status 503: Busy"),
    "401": (lambda _: reply(401), "401: set a password in the URL"),
    "403": (lambda _: reply(403), "403: permission denied"),
    "206": (lambda _: reply(206, BYTES), "HTTP status 206"),
    "304": (lambda _: reply(304), "HTTP status 304"),
    "an error page for ever": (endless(b"HTTP/1.1 500 Oh\r\n\r\n", b"x" * 1000, 0), "HTTP status 500"),
}
SPOILT = {
    "other bytes": (lambda _: reply(200, bytes(len(BYTES))), "corrupt: its content does not match"),
    "too few": (lambda _: reply(200, BYTES[:-1]), "has 199999 bytes instead of 200000"),
    "none": (lambda _: reply(200), "has 0 bytes instead"),
    "too many": (lambda _: reply(200, BYTES + b"x"), "has more than 200000 bytes"),
    "an announcement of far too many": (
        raw(b"HTTP/1.1 200 OK\r\nContent-Length: 1%s\r\n\r\n" % (b"0" * 15) + BYTES * 2, 60.0),
        "has more than 200000 bytes",
    ),
    "too few in chunks": (raw(CHUNKED + b"3\r\nabc\r\n0\r\n\r\n"), "has 3 bytes instead"),
    "bytes for ever": (endless(b"HTTP/1.1 200 OK\r\n\r\n", b"x" * 1000, 0), "has more than 200000"),
    "chunks for ever": (endless(CHUNKED, b"3e8\r\n" + b"x" * 1000 + b"\r\n", 0), "has more than 200000"),
    "compressed ones": (lambda _: reply(200, b"\x1f\x8b" * 100_000, "Content-Encoding: gzip"), "corrupt"),
}


@pytest.fixture
def target(tmp_path: Path) -> Iterator[Path]:
    """Yield a path for a blob; nothing may be left there at the end."""
    yield tmp_path / "new" / "blob"
    assert list(tmp_path.rglob("*")) in ([], [tmp_path / "new"])


@contextmanager
def asking(url: str, seconds: float = AMPLE, variables: Mapping[str, str] | None = None) -> Iterator[Store]:
    backend = HttpBackend(url, seconds, {"HOME": "/nowhere", **(variables or {})})
    with closing(Store(backend, url, seconds)) as store:
        yield store


@pytest.fixture(autouse=True)
def threads_end() -> Iterator[None]:
    """Check that no thread is left once stores and servers are closed."""
    before = set(threading.enumerate())
    yield
    left = [thread for thread in set(threading.enumerate()) - before if thread.name.startswith("forge")]
    for thread in left:
        thread.join(5)
    assert not [thread for thread in left if thread.is_alive()]


@pytest.mark.parametrize(
    ("answer", "words", "seconds"),
    [
        *((*case, SECONDS) for case in SLOW.values()),
        *((*case, AMPLE) for case in BROKEN.values()),
    ],
    ids=SLOW | BROKEN,
)
def test_a_faulty_server_gives_one_error_within_the_timeout(
    answer: Callable[[Request], Moves], words: str, seconds: float, target: Path
) -> None:
    target.parent.mkdir()
    with rude(answer) as server, asking(f"{server.url}/folder", seconds) as store, in_time():
        with pytest.raises(StoreError, match=words) as fault:
            store.fetch(DIGEST, target)
        assert str(fault.value).startswith(f"{server.url}/folder: ")
        assert len(str(fault.value)) < 200
        assert not isinstance(fault.value, BlobError)
        with in_time(), pytest.raises(StoreError):
            store.result(KEY)


def test_a_wrong_password_is_distinguished_from_a_missing_one(tmp_path: Path) -> None:
    token = {"FORGE_CACHE_TOKEN": "secret"}
    with rude(lambda _: reply(401)) as server, asking(server.url, variables=token) as store:
        with pytest.raises(
            StoreError, match="401: the server does not accept the user and password"
        ) as fault:
            store.fetch(DIGEST, tmp_path / "blob")
        assert "secret" not in str(fault.value)


@pytest.mark.parametrize(("answer", "words"), SPOILT.values(), ids=SPOILT)
def test_a_corrupt_blob_is_reported_and_leaves_no_file(
    answer: Callable[[Request], Moves], words: str, target: Path
) -> None:
    target.parent.mkdir()
    with (
        rude(answer) as server,
        asking(server.url) as store,
        in_time(),
        pytest.raises(BlobError, match=words),
    ):
        store.fetch(DIGEST, target)


@pytest.mark.parametrize(
    "answer",
    [
        lambda _: reply(200, BYTES),
        raw(CHUNKED + b"%x\r\n" % len(BYTES) + BYTES + b"\r\n0\r\n\r\n"),
        raw(b"HTTP/1.0 200 OK\r\n\r\n" + BYTES),
        raw(b"HTTP/1.1 100 Continue\r\n\r\n" + HEAD, 0.1, BYTES[:5000], 0.1, BYTES[5000:]),
    ],
    ids=["length", "chunks", "until the end", "in parts"],
)
def test_any_valid_transfer_encoding_is_accepted(answer: Callable[[Request], Moves], tmp_path: Path) -> None:
    with rude(answer) as server, asking(server.url) as store:
        assert store.fetch(DIGEST, tmp_path / "blob")
    assert (tmp_path / "blob").read_bytes() == BYTES


def test_large_blobs_have_a_longer_timeout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 80 kB per second, 200 kB may take 2.5 s more than the 1.5 s of a request; they take 2 s."""
    monkeypatch.setattr(deadline, "RATE", 80_000)
    parts = [BYTES[at : at + 10_000] for at in range(0, len(BYTES), 10_000)]
    answer = raw(HEAD, *(move for part in parts for move in (part, 0.1)))
    with rude(answer) as server, asking(server.url, 1.5) as store:
        assert store.fetch(DIGEST, tmp_path / "blob")


@pytest.mark.parametrize("data", [b"<html>", b"\x12\x00", b"\x2a\x05a"])
def test_an_invalid_result_is_reported_separately(data: bytes) -> None:
    with (
        rude(lambda _: reply(200, data)) as server,
        asking(server.url) as store,
        pytest.raises(BlobError, match=r"ac/abab.* is not a valid result: "),
    ):
        store.result(KEY)


def test_the_size_of_results_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "MAX_SIZE", 100_000)
    with (
        rude(endless(b"HTTP/1.1 200 OK\r\n\r\n", b"x" * 1000, 0)) as server,
        asking(server.url) as store,
        in_time(),
        pytest.raises(BlobError, match="too large for a result"),
    ):
        store.result(KEY)


def test_redirects_are_not_followed(target: Path) -> None:
    with rude(Shelf()) as elsewhere:
        there = f"{elsewhere.url}/\x1b[2J"
        with rude(lambda _: reply(302, b"", f"Location: {there}")) as server, asking(server.url) as store:
            target.parent.mkdir()
            for ask in (lambda: store.fetch(DIGEST, target), lambda: store.result(KEY)):
                with pytest.raises(StoreError, match="redirects to 'http") as fault:
                    ask()
                assert str(fault.value).isprintable()
            with pytest.raises(StoreError, match="302"):
                store.put_result(KEY, RESULT)
        assert elsewhere.requests == []


def test_unknown_hosts_and_closed_ports_are_reported() -> None:
    with rude(raw()) as server:
        pass
    for url, words in ((server.url, "cannot connect: Connection refused"), ("http://x.invalid", "resolve")):
        with asking(url) as store, in_time(10), pytest.raises(StoreError, match=words):
            store.result(KEY)


def test_closed_keep_alive_connections_are_reopened() -> None:
    """Servers close idle connections, and may do so while the next request is on its way."""
    answer = raw(*(move for move in reply(404) if move is not None))
    with rude(answer) as server, asking(server.url) as store:
        for _ in range(5):
            assert store.result(KEY) is None
    assert len(server.requests) == 5


def test_connections_are_reused() -> None:
    with rude(Shelf()) as server, asking(server.url) as store:
        for _ in range(5):
            assert store.result(KEY) is None
        assert len(server.sockets) == 1


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "source"
    path.write_bytes(BYTES)
    return path


@pytest.mark.parametrize(
    ("status", "fault"),
    [
        *((status, WritingRefused) for status in (401, 403, 404, 405, 409, 501, 507)),
        *((status, BlobError) for status in (400, 413)),
        *((status, StoreError) for status in (302, 500, 502, 503)),
    ],
)
def test_the_http_status_decides_whether_only_uploads_are_disabled(
    status: int, fault: type[StoreError], source: Path
) -> None:
    answer = lambda request: reply(404 if request.method == "HEAD" else status)  # noqa: E731
    with rude(answer) as server, asking(server.url) as store:
        with pytest.raises(StoreError, match=f"HTTP status {status}") as raised:
            store.put(DIGEST, source)
        assert type(raised.value) is fault
        with pytest.raises(fault, match=f"HTTP status {status}"):
            store.put_result(KEY, RESULT)


def test_a_server_may_reject_an_upload_early(tmp_path: Path) -> None:
    (tmp_path / "large").write_bytes(bytes(20_000_000))
    digest = Digest("0" * 64, 20_000_000)

    def answer(request: Request) -> Moves:
        return reply(404) if request.method == "HEAD" else raw(b"HTTP/1.1 413 No\r\n\r\n")(request)

    with (
        rude(answer, reads_bodies=False) as server,
        asking(server.url) as store,
        in_time(),
        pytest.raises(StoreError, match=r"413|closed the connection"),
    ):
        store.put(digest, tmp_path / "large")


@pytest.mark.parametrize("rate", [1 << 20, 1 << 30], ids=["socket timeout first", "deadline first"])
def test_an_unresponsive_upload_is_abandoned(
    rate: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bytes in socket buffers count as transferred: at a low rate, they extend the deadline by seconds."""
    monkeypatch.setattr(deadline, "RATE", rate)
    (tmp_path / "large").write_bytes(bytes(20_000_000))

    def answer(request: Request) -> Moves:
        return reply(404) if request.method == "HEAD" else (60.0,)

    with (
        rude(answer, reads_bodies=False) as server,
        asking(server.url, SECONDS) as store,
        in_time(),
        pytest.raises(StoreError, match=LATE),
    ):
        store.put(Digest("0" * 64, 20_000_000), tmp_path / "large")


def test_existing_blobs_are_not_uploaded_again_unless_corrupt(source: Path, tmp_path: Path) -> None:
    shelf = Shelf()
    with rude(shelf) as server, asking(server.url) as store:
        store.put(DIGEST, source)
        store.put(DIGEST, source)
        assert [request.method for request in server.requests] == ["HEAD", "PUT", "HEAD"]
        path = f"/cas/{DIGEST.hash}"
        shelf.files[path] = BYTES[:-1]
        store.put(DIGEST, source)
        assert shelf.files[path] == BYTES
        shelf.files[path] = bytes(len(BYTES))
        with pytest.raises(BlobError):
            store.fetch(DIGEST, tmp_path / "blob")
        store.put(DIGEST, source)
        assert shelf.files[path] == BYTES


def test_servers_without_head_requests_are_supported(source: Path) -> None:
    shelf = Shelf()

    def answer(request: Request) -> Moves:
        return reply(405) if request.method == "HEAD" else shelf(request)

    with rude(answer) as server, asking(server.url) as store:
        store.put(DIGEST, source)
    assert shelf.files == {f"/cas/{DIGEST.hash}": BYTES}


def test_files_that_change_during_the_upload_are_not_stored(source: Path) -> None:
    shelf = Shelf()
    with rude(shelf) as server, asking(server.url) as store:
        source.write_bytes(BYTES[:1000])
        with pytest.raises(BlobError, match="truncated during the upload"):
            store.put(DIGEST, source)
        with pytest.raises(BlobError, match="No such file"):
            store.put(DIGEST, source.with_name("none"))
        assert shelf.files == {}
        source.write_bytes(BYTES + b"more")
        store.put(DIGEST, source)
        assert shelf.files == {f"/cas/{DIGEST.hash}": BYTES}


def test_credentials_come_from_the_url_then_the_token_then_netrc(tmp_path: Path) -> None:
    (tmp_path / ".netrc").write_text("machine 127.0.0.1 login net password rc\n", encoding="utf-8")
    (tmp_path / ".netrc").chmod(0o600)
    home = {"HOME": str(tmp_path)}
    token = {"FORGE_CACHE_TOKEN": "abc.def"}
    with rude(Shelf()) as server:
        named = server.url.replace("//", "//me%40home:p%3Aw@")
        for url, variables in (
            (named, home | token),
            (server.url, home | token),
            (server.url, home),
            (server.url, {}),
        ):
            with asking(url, variables=variables) as store:
                assert store.name == server.url
                store.result(KEY)
        sent = [request.headers.get("authorization") for request in server.requests]
    assert sent == ["Basic bWVAaG9tZTpwOnc=", "Bearer abc.def", "Basic bmV0OnJj", None]


def test_messages_contain_no_passwords() -> None:
    with rude(raw()) as server:
        pass
    said: list[str] = []
    url = server.url.replace("//", "//me:secret@")
    store = opened(url, said, seconds=1)
    assert store.result(KEY) is None
    assert [("secret" in line, "me:" in line) for line in (*said, store.name)] == [(False, False)] * 2
    store.close()


def test_requests_follow_the_protocol_of_bazel_remote(source: Path) -> None:
    """It rejects bodies without a length, compresses for clients that accept it, and normalizes paths."""
    shelf = Shelf()
    with rude(shelf) as server, asking(f"{server.url}//a//b/") as store:
        store.put(DIGEST, source)
        store.put_result(KEY, RESULT)
        store.result(KEY)
    assert shelf.files == {f"/a/b/cas/{DIGEST.hash}": BYTES, f"/a/b/ac/{KEY}": encode(RESULT)}
    for request in server.requests:
        assert request.headers["accept-encoding"] == "identity"
        assert "transfer-encoding" not in request.headers
        assert "content-encoding" not in request.headers
        if request.method == "PUT":
            assert int(request.headers["content-length"]) == len(request.body)
            assert request.headers["content-type"] == "application/octet-stream"


@pytest.mark.parametrize("token", ["a b", "a\r\nX-Evil: 1", "\N{SNOWMAN}"])
def test_a_token_contains_no_whitespace(token: str) -> None:
    with pytest.raises(ForgeError, match="FORGE_CACHE_TOKEN contains a blank"):
        HttpBackend("http://127.0.0.1", 1, {"FORGE_CACHE_TOKEN": token})
