"""A remote store is given up after its first fault, told of once; results are sent while a build goes on."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import ForgeError
from forge.cache.model import ActionResult, BlobFault, Digest, OutputFile, StoreFault, WritingRefused
from forge.cache.remote import Remote, open_remote
from forge.cache.uploads import Uploads
from tests.rude import Shelf, reply, rude

if TYPE_CHECKING:
    from pathlib import Path

    from tests.rude import Moves, Request

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

    fault: StoreFault | None = None
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


def test_a_store_that_fails_is_asked_once_and_told_of_once(source: Path) -> None:
    store, said = Fake(StoreFault("fake: no connection")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for _ in range(3):
        assert remote.result(KEY) is None
        assert not remote.fetch(DIGEST, source)
    for _ in range(2):
        with pytest.raises(StoreFault, match="disabled for this build"):
            remote.put(DIGEST, source)
    assert store.asked == ["result ab"]
    assert said == ["fake: no connection; disabled for this build"]
    assert store.closed.is_set()


def test_a_spoilt_blob_is_no_reason_to_give_up(source: Path) -> None:
    store, said = Fake(BlobFault("spoilt")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for ask in (lambda: remote.fetch(DIGEST, source), lambda: remote.put(DIGEST, source)) * 2:
        with pytest.raises(BlobFault, match="spoilt"):
            ask()
    assert len(store.asked) == 4
    assert said == []


def test_who_may_not_write_may_still_read(source: Path) -> None:
    store, said = Fake(WritingRefused("fake: 403")), list[str]()
    remote = Remote(store, 10, said.append, writable=True)
    for _ in range(3):
        with pytest.raises(StoreFault):
            remote.put(DIGEST, source)
    assert said == ["fake: 403; uploads are disabled for this build"]
    store.fault = None
    assert remote.result(KEY) == RESULT
    assert store.asked == ["put 5 source", "result ab"]


def test_read_only_writes_nothing_and_asks_nothing_for_it(source: Path) -> None:
    with rude(Shelf()) as server:
        remote = open_remote(server.url, seconds=5, writable=False, variables={}, report=pytest.fail)
        remote.put(DIGEST, source)
        remote.put_result(KEY, RESULT)
        assert server.requests == []
        assert remote.result(KEY) is None
        remote.close()


def test_whoever_waits_when_it_fails_waits_no_longer(tmp_path: Path) -> None:
    """Four packages ask at once, and the first refusal is for all of them."""

    def answer(request: Request) -> Moves:
        return (0.2, *reply(503)) if request.path.startswith("/ac") else (60.0,)

    said: list[str] = []
    with rude(answer) as server:
        remote = open_remote(server.url, seconds=20, writable=True, variables={}, report=said.append)
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


def test_leaving_is_no_fault_of_the_server(tmp_path: Path) -> None:
    """After an interrupt nobody says that the server took too long."""
    said: list[str] = []
    with rude(lambda _: (60.0,)) as server:
        remote = open_remote(server.url, seconds=20, writable=True, variables={}, report=said.append)
        waiting = threading.Thread(target=remote.fetch, args=(DIGEST, tmp_path / "blob"))
        waiting.start()
        while not server.requests:
            time.sleep(0.01)
        remote.close()
        waiting.join(5)
        assert not waiting.is_alive()
    assert said == []


def test_many_slow_answers_are_a_fault_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_a_url_that_is_none_is_a_mistake_of_the_user(url: str, words: str) -> None:
    with pytest.raises(ForgeError, match=words) as raised:
        open_remote(url, seconds=1, writable=True, variables={}, report=pytest.fail)
    assert "secret" not in str(raised.value)


@pytest.mark.parametrize(
    ("scheme", "module", "words"),
    [
        ("s3", "s3fs", "pip install s3fs"),
        ("gs", "gcsfs", "pip install gcsfs"),
        ("ssh", "paramiko", "pip install sshfs"),
        ("s3", "fsspec", r"ros-forge\[remote\]"),
    ],
)
def test_a_library_that_is_missing_is_named(scheme: str, module: str, words: str) -> None:
    script = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from forge.cache.remote import open_remote\n"
        f"open_remote('{scheme}://bucket/x', seconds=1, writable=True, variables={{}}, report=print)\n"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert "forge.base.errors.EnvironmentFault" in ran.stderr
    assert re.search(words, ran.stderr)


def test_no_server_is_believed_to_be_the_right_one_unseen(tmp_path: Path) -> None:
    """The SSH of fsspec itself takes any key that a server shows."""
    stand_in = "def __getattr__(name):\n    return type(name, (), {})\n"
    (tmp_path / "paramiko.py").write_text(stand_in, encoding="utf-8")
    script = (
        "from forge.cache.remote import open_remote\n"
        "open_remote('sftp://host/x', seconds=1, writable=True, variables={}, report=print)\n"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, env=env)
    assert "does not verify host keys" in ran.stderr
    assert "pip install sshfs" in ran.stderr


def sent(url: str, count: int, source: Path, seconds: float = 10, most: int = 4) -> int:
    """Send so many results with one blob; return how many did not arrive."""
    remote = open_remote(url, seconds=seconds, writable=True, variables={}, report=lambda _: None)
    uploads = Uploads(remote, limit=most)
    for number in range(count):
        uploads.add(f"{number:064x}", RESULT, {DIGEST: source})
    unsent = uploads.finish(seconds)
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


def test_no_more_than_so_many_at_a_time(source: Path) -> None:
    shelf, now, most = Shelf(), list[int](), [0]

    def answer(request: Request) -> Moves:
        now.append(1)
        most[0] = max(most[0], len(now))
        time.sleep(0.01)
        now.pop()
        return shelf(request)

    with rude(answer) as server:
        assert sent(server.url, 20, source, most=3) == 0
    assert 1 < most[0] <= 3


def test_what_a_dead_server_did_not_get_is_counted(source: Path) -> None:
    with rude(lambda _: (60.0,)) as server:
        begun = time.monotonic()
        assert sent(server.url, 20, source, seconds=0.4) == 20
        assert time.monotonic() - begun < 3


def test_a_blob_that_is_gone_costs_one_result(source: Path) -> None:
    shelf = Shelf()
    with rude(shelf) as server:
        remote = open_remote(server.url, seconds=5, writable=True, variables={}, report=pytest.fail)
        uploads = Uploads(remote)
        uploads.add("0" * 64, RESULT, {DIGEST: source.with_name("gone")})
        uploads.add("1" * 64, ActionResult(stdout=b"note"), {})
        assert uploads.finish(5) == 1
        remote.close()
    assert list(shelf.files) == [f"/ac/{'1' * 64}"]


def test_more_may_be_added_after_a_pause(source: Path) -> None:
    store = Fake()
    uploads = Uploads(store, limit=1)
    for number in range(3):
        uploads.add(str(number) * 64, RESULT, {DIGEST: source})
        assert uploads.finish(5) == 0
    assert store.asked == ["put 5 source", "put_result 00 1", "put_result 11 1", "put_result 22 1"]


def test_waiting_ends_without_progress_and_goes_on_with_it() -> None:
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


def test_patience_without_end_is_patience_for_days(source: Path) -> None:
    """The system's clocks know no more."""
    with rude(Shelf()) as server:
        assert sent(server.url, 2, source, seconds=1e30) == 0


def test_a_bug_in_a_thread_is_not_lost() -> None:
    store = Fake()
    store.put_result = None  # type: ignore[assignment,method-assign]
    uploads = Uploads(store)
    uploads.add(KEY, RESULT, {})
    with pytest.raises(TypeError):
        uploads.finish(5)


@pytest.mark.parametrize("wait", ["uploads.finish(60)", "remote.result('b' * 64)"])
def test_an_interrupt_leaves_at_once(wait: str, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\n"
        "from forge.cache.model import ActionResult\n"
        "from forge.cache.remote import open_remote\n"
        "from forge.cache.uploads import Uploads\n"
        "remote = open_remote(sys.argv[1], seconds=60, writable=True, variables={}, report=print)\n"
        "uploads = Uploads(remote)\n"
        "uploads.add('a' * 64, ActionResult(), {})\n"
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
