"""A remote store is disabled after its first fault, which is reported once; uploads run during the build."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from forge.base.errors import ForgeError
from forge.cache.model import ActionResult, BlobError, Digest, OutputFile, RemoteOptions
from forge.plugins.remote_cache.action_result import encode
from forge.plugins.remote_cache.remote import Remote
from forge.plugins.remote_cache.store import WritingRefused
from tests.plugins.remote_cache.opening import opened
from tests.rude import Moves, Request, Shelf, reply, rude

KEY = "ab" * 32
BYTES = b"bytes"
DIGEST = Digest(hashlib.sha256(BYTES).hexdigest(), len(BYTES))
RESULT = ActionResult((OutputFile("pack", DIGEST),))


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "source"
    path.write_bytes(BYTES)
    return path


@dataclass
class Fake:
    """A backend with one result, which raises a fault or takes its time, or both."""

    fault: Exception | None = None
    seconds: float = 0
    asked: list[str] = field(default_factory=list)
    closed: threading.Event = field(default_factory=threading.Event)

    def _do(self, what: str) -> None:
        self.asked.append(what)
        self.closed.wait(self.seconds)
        if self.fault is not None:
            raise self.fault

    def read(self, path: str) -> Generator[bytes]:
        self._do(f"read {path[:5]}")
        yield encode(RESULT)

    def size(self, path: str) -> int | None:
        raise FileNotFoundError

    def write(self, path: str, size: int, blocks: Callable[[], Iterable[bytes]]) -> None:
        self._do(f"write {path[:5]} {len(b''.join(blocks()))}")

    def close(self) -> None:
        self.closed.set()


def remote_of(fake: Fake, warnings: list[str], *, seconds: float = 10, uploaders: int = 1) -> Remote:
    options = RemoteOptions(seconds, writable=True, variables={}, warn=warnings.append)
    return Remote(fake, "fake://me:secret@host/", options, uploaders=uploaders)


def test_a_failing_store_is_reported_once_and_disabled(source: Path, tmp_path: Path) -> None:
    fake, warnings = Fake(RuntimeError("no connection")), list[str]()
    remote = remote_of(fake, warnings)
    for _ in range(3):
        assert remote.result(KEY) is None
        assert not remote.fetch(DIGEST, tmp_path / "target")
    remote.upload(KEY, RESULT, {DIGEST: source})
    assert remote.finish() == 1
    assert fake.asked == ["read ac/ab"]
    assert warnings == ["fake://host: RuntimeError: no connection; disabled for this build"]
    assert fake.closed.is_set()


def test_a_corrupt_blob_does_not_disable_the_store(source: Path, tmp_path: Path) -> None:
    fake, warnings = Fake(BlobError("spoilt")), list[str]()
    remote = remote_of(fake, warnings)
    for count in (1, 2):
        with pytest.raises(BlobError, match="fake://host: spoilt"):
            remote.fetch(DIGEST, tmp_path / "target")
        remote.upload(KEY, RESULT, {DIGEST: source})
        assert remote.finish() == count
    assert len(fake.asked) == 4
    assert warnings == []


def test_a_rejected_upload_does_not_stop_downloads(source: Path) -> None:
    fake, warnings = Fake(WritingRefused("403")), list[str]()
    remote = remote_of(fake, warnings)
    for count in (1, 2, 3):
        remote.upload(KEY, RESULT, {DIGEST: source})
        assert remote.finish() == count
    assert warnings == ["fake://host: 403; uploads are disabled for this build"]
    fake.fault = None
    assert remote.result(KEY) == RESULT
    assert fake.asked == [f"write cas/{DIGEST.hash[:1]} 5", "read ac/ab"]


def test_many_slow_responses_disable_the_store(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forge.plugins.remote_cache.remote._TOLERATED_SECONDS", 0.05)
    warnings: list[str] = []
    remote = remote_of(Fake(seconds=0.25), warnings, seconds=0.5)
    answers = [remote.result(KEY) for _ in range(6)]
    assert answers[0] == RESULT
    assert answers[-1] is None
    assert len(warnings) == 1
    words = r"fake://host: too slow, this build has waited 0\.\d s for it; disabled for this build"
    assert re.fullmatch(words, warnings[0])


def test_many_threads_can_use_a_store_at_once() -> None:
    remote, answers = remote_of(Fake(seconds=0.05), []), list[ActionResult | None]()
    threads = [
        threading.Thread(target=lambda: answers.extend(remote.result(KEY) for _ in range(10)))
        for _ in range(16)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [RESULT] * 160


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
        opened(url)
    assert "secret" not in str(raised.value)


def test_uploads_can_be_added_after_a_pause(source: Path) -> None:
    fake = Fake()
    remote = remote_of(fake, [])
    for number in range(3):
        remote.upload(str(number) * 64, RESULT, {DIGEST: source})
        assert remote.finish() == 0
    size = len(encode(RESULT))
    blob = f"write cas/{DIGEST.hash[:1]} 5"
    assert fake.asked == [blob, *(f"write ac/{number}{number} {size}" for number in range(3))]


def test_waiting_for_uploads_stops_without_progress() -> None:
    warnings: list[str] = []
    remote = remote_of(Fake(seconds=0.2), warnings, seconds=0.5)
    for number in range(4):
        remote.upload(str(number) * 64, RESULT, {})
    assert remote.finish() == 0
    assert warnings == []
    remote = remote_of(Fake(seconds=60), warnings, seconds=0.3)
    for number in range(4):
        remote.upload(str(number) * 64, RESULT, {})
    begun = time.monotonic()
    assert remote.finish() == 4
    assert time.monotonic() - begun < 2
    assert warnings == ["fake://host: timed out after 0.3 s; disabled for this build"]


def test_results_are_counted_if_no_thread_can_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    remote = remote_of(Fake(), [])
    with monkeypatch.context() as patch:
        patch.setattr(threading, "Thread", Refused)
        remote.upload(KEY, RESULT, {})
        assert remote.finish() == 1
    remote.upload(KEY, RESULT, {})
    assert remote.finish() == 0


class Refused(threading.Thread):
    """A thread that the system does not start."""

    def start(self) -> None:
        raise RuntimeError("can't start new thread")


def test_exceptions_in_upload_threads_are_raised() -> None:
    remote = remote_of(Fake(), [])
    remote.upload(KEY, None, {})  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        remote.finish()


def test_read_only_stores_send_no_upload_requests(source: Path) -> None:
    with rude(Shelf()) as server:
        remote = opened(server.url, writable=False)
        remote.upload(KEY, RESULT, {DIGEST: source})
        assert remote.finish() == 0
        assert server.requests == []
        assert remote.result(KEY) is None
        remote.close()


def test_waiting_requests_end_when_the_store_fails(tmp_path: Path) -> None:
    """Four packages wait at once; the first fault disables the store for all of them."""

    def answer(request: Request) -> Moves:
        return (0.2, *reply(503)) if request.path.startswith("/ac") else (60.0,)

    said: list[str] = []
    with rude(answer) as server:
        remote = opened(server.url, said, seconds=20)
        begun = time.monotonic()
        waiting = [
            threading.Thread(target=remote.fetch, args=(DIGEST, tmp_path / str(number)))
            for number in range(4)
        ]
        for thread in waiting:
            thread.start()
        assert remote.result(KEY) is None
        for thread in waiting:
            thread.join()
        assert time.monotonic() - begun < 5
    assert said == [f"{server.url}: HTTP status 503: Said; disabled for this build"]
    assert not list(tmp_path.iterdir())


def test_an_interrupt_is_not_reported_as_a_server_error(tmp_path: Path) -> None:
    """After an interrupt no timeout is reported."""
    said: list[str] = []
    with rude(lambda _: (60.0,)) as server:
        remote = opened(server.url, said, seconds=20)
        waiting = threading.Thread(target=remote.fetch, args=(DIGEST, tmp_path / "blob"))
        waiting.start()
        while not server.requests:
            time.sleep(0.01)
        remote.close()
        waiting.join(5)
        assert not waiting.is_alive()
    assert said == []


@pytest.mark.parametrize(
    ("scheme", "module", "words"),
    [
        ("s3", "s3fs", "pip install s3fs"),
        ("gs", "gcsfs", "pip install gcsfs"),
        ("ssh", "paramiko", "pip install sshfs"),
        ("s3", "fsspec", "pip install 'fsspec"),
        ("http", "urllib3", "requires the Python package 'urllib3'"),
    ],
)
def test_a_missing_library_is_reported(scheme: str, module: str, words: str) -> None:
    script = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from tests.plugins.remote_cache.opening import opened\n"
        f"opened('{scheme}://bucket/x')\n"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert "forge.base.errors.HostError" in ran.stderr
    assert re.search(words, ran.stderr)


def test_ssh_without_host_key_verification_is_rejected(tmp_path: Path) -> None:
    """The SSH of fsspec itself takes any key that a server shows."""
    stand_in = "def __getattr__(name):\n    return type(name, (), {})\n"
    (tmp_path / "paramiko.py").write_text(stand_in, encoding="utf-8")
    script = "from tests.plugins.remote_cache.opening import opened\nopened('sftp://host/x')\n"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, env=env)
    assert "does not verify host keys" in ran.stderr
    assert "pip install sshfs" in ran.stderr


def sent(url: str, count: int, source: Path, seconds: float = 10) -> int:
    """Upload `count` results that share a blob; return how many failed."""
    remote = opened(url, [], seconds=seconds)
    for number in range(count):
        remote.upload(f"{number:064x}", RESULT, {DIGEST: source})
    unsent = remote.finish()
    remote.close()
    return unsent


def test_results_are_sent_after_their_blobs(source: Path) -> None:
    shelf, wrong = Shelf(), list[str]()

    def answer(request: Request) -> Moves:
        if request.method == "PUT" and request.path.startswith("/ac") and len(shelf.files) == 0:
            wrong.append(request.path)
        return shelf(request)

    with rude(answer) as server:
        assert sent(server.url, 50, source) == 0
    assert len(shelf.files) == 51
    assert wrong == []
    puts = [request.path for request in server.requests if request.method == "PUT"]
    assert puts.count(f"/cas/{DIGEST.hash}") <= 4


def test_the_number_of_parallel_requests_is_limited(source: Path) -> None:
    shelf, now, most = Shelf(), list[int](), [0]

    def answer(request: Request) -> Moves:
        now.append(1)
        most[0] = max(most[0], len(now))
        time.sleep(0.01)
        now.pop()
        return shelf(request)

    with rude(answer) as server:
        assert sent(server.url, 20, source) == 0
    assert 1 < most[0] <= 4


def test_a_missing_blob_invalidates_one_result(source: Path) -> None:
    shelf = Shelf()
    with rude(shelf) as server:
        remote = opened(server.url)
        remote.upload("0" * 64, RESULT, {DIGEST: source.with_name("gone")})
        remote.upload("1" * 64, ActionResult(stdout=b"note"), {})
        assert remote.finish() == 1
        remote.close()
    assert list(shelf.files) == [f"/ac/{'1' * 64}"]


@pytest.mark.parametrize("wait", ["remote.finish()", "remote.result('b' * 64)"])
def test_an_interrupt_cancels_uploads_immediately(wait: str, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\n"
        "from forge.cache.model import ActionResult\n"
        "from tests.plugins.remote_cache.opening import opened\n"
        "remote = opened(sys.argv[1], seconds=60)\n"
        "remote.upload('a' * 64, ActionResult(), {})\n"
        "print('waiting', flush=True)\n"
        f"{wait}\n",
        encoding="utf-8",
    )
    with rude(lambda _: (60.0,)) as server:
        argv = [sys.executable, str(script), server.url]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=env) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"waiting\n"
            while not server.requests:
                time.sleep(0.01)
            begun = time.monotonic()
            process.send_signal(signal.SIGINT)
            assert process.wait(20) != 0
            assert time.monotonic() - begun < 3
