"""Debian's nginx as the cache of a team, configured as the page on it says."""

import contextlib
import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROGRAM = "/usr/sbin/nginx"
PAGE = Path(__file__).parents[1] / "docs/how-to/team-cache.md"

_ROOM = """
{user}
daemon off;
worker_processes 1;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
    access_log {folder}/access.log;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
{server}
}}
"""


@dataclass
class Nginx:
    """A server that runs."""

    url: str
    files: Path
    folder: Path
    process: subprocess.Popen[bytes]

    def requests(self) -> list[str]:
        """Return what was asked, as 'GET /ac/... 200'; a request is written down when it has ended."""
        lines = (self.folder / "access.log").read_text(encoding="utf-8").splitlines()
        found = [re.search(r'"(\S+ \S+) \S+" (\d+) ', line) for line in lines]
        return [f"{match[1]} {match[2]}" for match in found if match]

    def stop(self) -> None:
        """End it at once."""
        self.process.terminate()
        try:
            self.process.wait(10)
        finally:
            self.process.kill()
            self.process.wait()


def documented(number: int = 0) -> str:
    """Return a configuration that the page gives; what it has in /etc is below the server's folder then."""
    blocks = re.findall(r"^```text\n(server \{\n.*?)^```$", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    block: str = blocks[number]
    return block


def prepare(files: Path) -> None:
    """Create the folder of the cache with the command on the page, for the user of the tests."""
    command = re.search(
        r"^\$ sudo (install -d) -o www-data (/srv/forge-cache)$", PAGE.read_text("utf-8"), re.MULTILINE
    )
    assert command is not None
    subprocess.run([*command[1].split(), str(files)], check=True)


@contextlib.contextmanager
def serving(folder: Path, server: str | None = None, scheme: str = "http") -> Iterator[Nginx]:
    """Run nginx below a folder, which need not be there; on a port of the system's choice."""
    try:
        running = _started(folder, server or documented(), scheme)
    except ConnectionError:  # somebody else was quicker to take the port
        running = _started(folder, server or documented(), scheme)
    try:
        yield running
    finally:
        running.stop()


def _started(folder: Path, server: str, scheme: str) -> Nginx:
    files = folder / "files"
    prepare(files)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    server = re.sub(r"listen \d+", f"listen 127.0.0.1:{port}", server)
    server = server.replace("/srv/forge-cache", str(files)).replace("/etc/", f"{folder}/etc/")
    text = _ROOM.format(user="user root;" if os.geteuid() == 0 else "", folder=folder, server=server)
    (folder / "nginx.conf").write_text(text, encoding="utf-8")
    argv = [PROGRAM, "-p", str(folder), "-c", str(folder / "nginx.conf")]
    with (folder / "said").open("wb") as said:  # among others that it may not write to the system's log
        process = subprocess.Popen(argv, stdin=subprocess.DEVNULL, stderr=said)
    running = Nginx(f"{scheme}://127.0.0.1:{port}", files, folder, process)
    if not _answers(process, port):
        running.stop()
        raise ConnectionError((folder / "said").read_text("utf-8"))
    return running


def _answers(process: subprocess.Popen[bytes], port: int) -> bool:
    """Wait until somebody listens, and tell if that is this process."""
    end = time.monotonic() + 10
    while process.poll() is None and time.monotonic() < end:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return process.poll() is None
        time.sleep(0.01)
    return False
