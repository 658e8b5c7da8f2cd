"""Remote stores over HTTP: disabled after the first fault; results are uploaded during the build."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import pytest

from forge.cache.model import ActionResult, Digest, OutputFile
from forge.cache.remote import open_remote
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


def test_read_only_stores_send_no_upload_requests(source: Path) -> None:
    with rude(Shelf()) as server:
        remote = open_remote(server.url, seconds=5, writable=False, variables={}, report=pytest.fail)
        remote.put(DIGEST, source)
        remote.put_result(KEY, RESULT)
        assert server.requests == []
        assert remote.result(KEY) is None
        remote.close()


def test_waiting_requests_end_when_the_store_fails(tmp_path: Path) -> None:
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


def test_an_interrupt_is_not_reported_as_a_server_error(tmp_path: Path) -> None:
    """After an interrupt no timeout is reported."""
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


@pytest.mark.parametrize(
    ("scheme", "module", "words"),
    [
        ("s3", "s3fs", "pip install s3fs"),
        ("gs", "gcsfs", "pip install gcsfs"),
        ("ssh", "paramiko", "pip install sshfs"),
        ("s3", "fsspec", "pip install 'fsspec"),
    ],
)
def test_a_library_that_is_missing_is_named(scheme: str, module: str, words: str) -> None:
    script = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from forge.cache.remote import open_remote\n"
        f"open_remote('{scheme}://bucket/x', seconds=1, writable=True, variables={{}}, report=print)\n"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert "forge.base.errors.HostError" in ran.stderr
    assert re.search(words, ran.stderr)


def test_ssh_without_host_key_verification_is_rejected(tmp_path: Path) -> None:
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


def test_the_number_of_parallel_requests_is_limited(source: Path) -> None:
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


def test_results_not_uploaded_to_a_dead_server_are_counted(source: Path) -> None:
    with rude(lambda _: (60.0,)) as server:
        begun = time.monotonic()
        assert sent(server.url, 20, source, seconds=0.4) == 20
        assert time.monotonic() - begun < 3


def test_a_missing_blob_invalidates_one_result(source: Path) -> None:
    shelf = Shelf()
    with rude(shelf) as server:
        remote = open_remote(server.url, seconds=5, writable=True, variables={}, report=pytest.fail)
        uploads = Uploads(remote)
        uploads.add("0" * 64, RESULT, {DIGEST: source.with_name("gone")})
        uploads.add("1" * 64, ActionResult(stdout=b"note"), {})
        assert uploads.finish(5) == 1
        remote.close()
    assert list(shelf.files) == [f"/ac/{'1' * 64}"]


def test_an_infinite_timeout_is_accepted(source: Path) -> None:
    """The system's clocks know no more."""
    with rude(Shelf()) as server:
        assert sent(server.url, 2, source, seconds=1e30) == 0


@pytest.mark.parametrize("wait", ["uploads.finish(60)", "remote.result('b' * 64)"])
def test_an_interrupt_cancels_uploads_immediately(wait: str, tmp_path: Path) -> None:
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
