"""A local server with scripted responses, valid or not."""

import contextlib
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from io import BufferedReader

Moves = Iterable[bytes | float | None]
"""Bytes are sent, seconds waited for; after None comes another request, at the end it closes."""


@dataclass
class Request:
    """What somebody asked."""

    method: str
    path: str
    headers: dict[str, str]
    body: bytes


@dataclass
class Rude:
    """A server that runs until its test ends."""

    answer: Callable[[Request], Moves]
    url: str = ""
    requests: list[Request] = field(default_factory=list)
    reads_bodies: bool = True
    over: threading.Event = field(default_factory=threading.Event)
    sockets: list[socket.socket] = field(default_factory=list)
    threads: list[threading.Thread] = field(default_factory=list)

    def listen(self, listening: socket.socket) -> None:
        """Serve each connection by a thread of its own."""
        while not self.over.is_set():
            with contextlib.suppress(OSError):
                connection, _ = listening.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.sockets.append(connection)
                self.threads.append(threading.Thread(target=self.serve, args=(connection,)))
                self.threads[-1].start()

    def serve(self, connection: socket.socket) -> None:
        """Answer the requests of one connection."""
        with contextlib.suppress(OSError), connection, connection.makefile("rb") as stream:
            while request := self.read(stream):
                self.requests.append(request)
                move: bytes | float | None = 0.0
                for move in self.answer(request):
                    if isinstance(move, bytes):
                        connection.sendall(move)
                    elif move and self.over.wait(move):
                        return
                if move is not None:
                    return

    def read(self, stream: BufferedReader) -> Request | None:
        """Read a request, None where the other side has gone before its end."""
        lines = list(iter(lambda: stream.readline().strip().decode(), ""))
        if not lines:
            return None
        method, path, _ = lines[0].split()
        headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines[1:])}
        length = int(headers.get("content-length", 0)) if self.reads_bodies else 0
        body = stream.read(length)
        return Request(method, path, headers, body) if len(body) == length else None


@contextlib.contextmanager
def rude(answer: Callable[[Request], Moves], *, reads_bodies: bool = True) -> Iterator[Rude]:
    """Run a server."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        server = Rude(answer, f"http://127.0.0.1:{listening.getsockname()[1]}", reads_bodies=reads_bodies)
        thread = threading.Thread(target=server.listen, args=(listening,))
        thread.start()
        try:
            yield server
        finally:
            server.over.set()
            for each in (listening, *server.sockets):
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)
            for each_thread in (thread, *server.threads):
                each_thread.join()


def reply(status: int, body: bytes = b"", *headers: str, length: str | None = None) -> Iterator[bytes | None]:
    """Make the moves of a good answer; `length` says another one than the body has."""
    announced = f"Content-Length: {len(body) if length is None else length}"
    head = "\r\n".join((f"HTTP/1.1 {status} Said", announced, *headers, "", ""))
    yield head.encode() + body
    yield None


@dataclass
class Shelf:
    """Answers as a good server does that keeps what is put."""

    files: dict[str, bytes] = field(default_factory=dict)

    def __call__(self, request: Request) -> Moves:
        """Keep a file, or give it."""
        if request.method == "PUT":
            self.files[request.path] = request.body
            return reply(201)
        body = self.files.get(request.path)
        if body is None:
            return reply(404)
        return reply(200, length=str(len(body))) if request.method == "HEAD" else reply(200, body)
