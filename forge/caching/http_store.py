"""A store behind HTTP: GET, HEAD and PUT of /ac/KEY and /cas/SHA256, as bazel-remote and WebDAV have it."""

from __future__ import annotations

import contextlib
import re
import socket
from base64 import b64encode
from http import HTTPStatus
from netrc import NetrcParseError, netrc
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote, urlsplit
from weakref import ref

from forge import __version__
from forge.caching import action_result
from forge.caching.checking import arriving, decoded, departing, encoded, opened
from forge.caching.faults import BlobFault, WritingRefused
from forge.caching.model import StoreFault
from forge.caching.patience import Errands, Overdue, Patience
from forge.errors import ForgeError, Problem
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from typing import TypeVar
    from urllib.parse import SplitResult

    from urllib3 import BaseHTTPResponse
    from urllib3.connection import HTTPConnection
    from urllib3.exceptions import HTTPError

    from forge.caching.checking import Arrival
    from forge.caching.model import ActionResult, Digest

    _Answer = TypeVar("_Answer")

_BLOCK: Final = 1 << 16
"""Bytes that are read or sent at a time."""

_DIGITS: Final = 19
"""Sizes have fewer; Python refuses to read numbers of thousands."""

_CONNECTIONS: Final = 8
"""How many are kept for the next request."""

_WRITTEN: Final = frozenset({HTTPStatus.OK, HTTPStatus.CREATED, HTTPStatus.ACCEPTED, HTTPStatus.NO_CONTENT})
_ABSENT: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
_TOO_MUCH: Final = frozenset({HTTPStatus.BAD_REQUEST, HTTPStatus.REQUEST_ENTITY_TOO_LARGE})
_UNWRITABLE: Final = frozenset(
    {
        *(HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT),
        *(HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED, HTTPStatus.INSUFFICIENT_STORAGE),
    }
)
"""Answers to a PUT that say nothing of reading."""

_MEANINGS: Final[dict[int, str]] = {
    HTTPStatus.UNAUTHORIZED: "it wants a password in the URL or in ~/.netrc, or a token in FORGE_CACHE_TOKEN",
    HTTPStatus.FORBIDDEN: "who asks may not do this",
    HTTPStatus.METHOD_NOT_ALLOWED: "nothing can be written there",
    HTTPStatus.NOT_IMPLEMENTED: "nothing can be written there",
    HTTPStatus.CONFLICT: "it does not make folders by itself",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "it takes no files of this size",
    HTTPStatus.INSUFFICIENT_STORAGE: "it is full",
}


@frozen
class _Call:
    """What is asked of the server; a body is made anew each time it is sent."""

    method: str
    path: str
    patience: Patience
    size: int = 0
    body: Callable[[], Iterable[bytes]] | None = None


class HttpStore:
    """Asks one server, and no other: it follows no redirects."""

    def __init__(self, url: str, seconds: float, variables: Mapping[str, str]) -> None:
        """Take a good URL, without asking anybody yet; a server has so many seconds for each request."""
        from urllib3 import Timeout, connection_from_url  # noqa: PLC0415  (only who has a server needs it)

        parts = urlsplit(url)
        host = parts.netloc.rpartition("@")[2]
        self._path = "".join(f"/{part}" for part in parts.path.split("/") if part)
        self.name = f"{parts.scheme}://{host}{self._path}"
        self._seconds = seconds
        self._errands = Errands()
        self._doubtful = False
        self._sockets: list[ref[socket.socket]] = []
        self._pool = connection_from_url(
            f"{parts.scheme}://{host}",
            maxsize=_CONNECTIONS,
            timeout=Timeout(connect=seconds, read=seconds),
            headers={
                "User-Agent": f"ros-forge/{__version__}",
                "Accept-Encoding": "identity",
                **_authorization(parts, variables),
            },
        )
        self._pool.ConnectionCls = _noting(self._pool.ConnectionCls, self._sockets)

    def result(self, key: str) -> ActionResult | None:
        """Return what a key leads to, or None."""
        data = self._within(lambda patience: self._read(f"ac/{key}", patience))
        return decoded(self.name, key, data)

    def put_result(self, key: str, result: ActionResult) -> None:
        """Let a key lead to a result, whose blobs are there already."""
        data = encoded(result)

        def send(patience: Patience) -> None:
            self._write(_Call("PUT", f"ac/{key}", patience, len(data), lambda: (data,)))

        self._within(send)

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to `target`, a new file; tell if there is one."""
        with arriving(self.name, digest, target) as arrival:
            try:
                found = self._within(lambda patience: self._receive(arrival, patience))
                return found and arrival.whole()
            except BlobFault:
                self._doubtful = True
                raise

    def put(self, digest: Digest, source: Path) -> None:
        """Keep the bytes of a file, unless they are there; where one blob was spoilt, others may be."""
        path = f"cas/{digest.hash}"
        if not self._doubtful and self._within(lambda patience: self._has(path, patience, digest.size)):
            return
        with opened(source) as stream:

            def body(patience: Patience) -> Iterable[bytes]:
                return patience.counted(departing(source, stream, digest, _BLOCK))

            self._within(
                lambda patience: self._write(
                    _Call("PUT", path, patience, digest.size, lambda: body(patience))
                )
            )

    def close(self) -> None:
        """Let go of connections, also of those by which a thread that was left behind still talks."""
        self._errands.close()
        for connected in tuple(self._sockets):
            with contextlib.suppress(OSError, AttributeError):  # the latter where there is none any more
                connected().shutdown(socket.SHUT_RDWR)  # type: ignore[union-attr]
        self._pool.close()

    def _within(self, job: Callable[[Patience], _Answer]) -> _Answer:
        """Do what asks the server, and give up in time."""
        patience = Patience(self._seconds)
        try:
            return self._errands.run(patience, lambda: job(patience))
        except Overdue:
            raise StoreFault(f"{self.name}: it took longer than {self._seconds:g} s") from None

    def _read(self, path: str, patience: Patience) -> bytes | None:
        """Return the bytes of a result, which are few; None where there is none."""
        with self._asked(_Call("GET", path, patience)) as answer:
            if not self._is_there(answer):
                return None
            data = bytearray()
            for block in patience.counted(answer.stream(_BLOCK, decode_content=False)):
                data += block
                if len(data) > action_result.LARGEST:
                    raise BlobFault(f"{self.name}: {path[:15]} is too long for a result")
            return bytes(data)

    def _receive(self, arrival: Arrival, patience: Patience) -> bool:
        """Hand a blob over as it comes; tell if there is one."""
        with self._asked(_Call("GET", f"cas/{arrival.digest.hash}", patience)) as answer:
            if not self._is_there(answer):
                return False
            arrival.expect(_length(answer))
            for block in patience.counted(answer.stream(_BLOCK, decode_content=False)):
                arrival.write(block)
        return True

    def _has(self, path: str, patience: Patience, size: int) -> bool:
        """Tell if the server has a file of this size; one that answers no HEAD might have none."""
        with self._asked(_Call("HEAD", path, patience)) as answer:
            if answer.status in {HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED}:
                return False
            return self._is_there(answer) and _length(answer) in {None, size}

    def _write(self, call: _Call) -> None:
        with self._asked(call) as answer:
            if answer.status in _WRITTEN:
                return
            fault = self._refusal(answer)
            if answer.status in _TOO_MUCH:
                raise BlobFault(fault)
            raise (WritingRefused if answer.status in _UNWRITABLE else StoreFault)(fault)

    def _is_there(self, answer: BaseHTTPResponse) -> bool:
        if answer.status not in _ABSENT and answer.status != HTTPStatus.OK:
            raise StoreFault(self._refusal(answer))
        return answer.status == HTTPStatus.OK

    def _refusal(self, answer: BaseHTTPResponse) -> str:
        """Say what an answer means that is not the one hoped for."""
        meaning = _MEANINGS.get(answer.status, (answer.reason or "")[:100])
        if location := answer.headers.get("Location"):
            meaning = f"it sends on to {location[:200]!r}, where forge does not follow"
        return f"{self.name}: it answers {answer.status}: {meaning}"

    @contextlib.contextmanager
    def _asked(self, call: _Call) -> Iterator[BaseHTTPResponse]:
        """Give the server's answer, whose connection is kept when all of it is read."""
        from urllib3.exceptions import HTTPError  # noqa: PLC0415  (as above)

        try:
            answer = self._sent(call)
            with contextlib.closing(answer):
                yield answer
                if (_length(answer) or 0) <= _BLOCK:
                    answer.read(_BLOCK)  # the connection of what was read to its end is kept
        except HTTPError as error:
            raise StoreFault(f"{self.name}: {_reason(error)}") from None

    def _sent(self, call: _Call) -> BaseHTTPResponse:
        """Send a request; once more where the server has closed a kept connection just then."""
        from urllib3.exceptions import ProtocolError  # noqa: PLC0415  (as above)

        try:
            return self._send(call)
        except ProtocolError:
            if call.patience.left() <= 0:  # who was left behind ends
                raise
            return self._send(call)

    def _send(self, call: _Call) -> BaseHTTPResponse:
        headers = dict(self._pool.headers)
        if call.body is not None:
            headers |= {"Content-Length": str(call.size), "Content-Type": "application/octet-stream"}
        return self._pool.urlopen(
            call.method,
            f"{self._path}/{call.path}",
            body=call.body() if call.body else None,
            headers=headers,
            retries=False,
            redirect=False,
            preload_content=False,
            decode_content=False,
        )


def _noting(kind: Any, sockets: list[ref[socket.socket]]) -> Any:  # noqa: ANN401  (a class and its heir)
    """Return a class of connections that notes their sockets, which may outlive them."""

    def connect(self: HTTPConnection) -> None:
        kind.connect(self)
        sockets.append(ref(self.sock))

    return type("Connection", (kind,), {"connect": connect})


def _length(answer: BaseHTTPResponse) -> int | None:
    """Return how many bytes an answer announces, if it does."""
    announced = answer.headers.get("Content-Length", "")
    return (
        int(announced) if announced.isascii() and announced.isdigit() and len(announced) < _DIGITS else None
    )


def _reason(error: HTTPError) -> str:
    """Say in a few words why there is no answer; urllib3's own words name objects of Python."""
    from urllib3 import exceptions  # noqa: PLC0415  (as above)

    match error:
        case exceptions.NameResolutionError():
            return "nobody knows the address of this host"
        case exceptions.NewConnectionError(__cause__=OSError(strerror=str(text))):
            return f"no connection: {text}"
        case exceptions.TimeoutError():
            return "it took too long to answer"
        case exceptions.SSLError(args=(Exception() as cause, *_)):
            return f"no safe connection: {getattr(cause, 'verify_message', '') or cause}"
        case exceptions.ProtocolError():
            return "it closed the connection in the middle"
        case _:
            return f"no good answer ({type(error).__name__})"


def _authorization(parts: SplitResult, variables: Mapping[str, str]) -> dict[str, str]:
    """Return who asks: the URL says it, else FORGE_CACHE_TOKEN, else ~/.netrc, else nobody in particular."""
    if parts.username is not None:
        return _basic(unquote(parts.username), unquote(parts.password or ""))
    if token := variables.get("FORGE_CACHE_TOKEN"):
        if not re.fullmatch(r"[!-~]+", token):
            raise ForgeError(Problem("FORGE_CACHE_TOKEN has a blank or another sign that no token has"))
        return {"Authorization": f"Bearer {token}"}
    with contextlib.suppress(OSError, NetrcParseError):
        file = variables.get("NETRC") or Path(variables.get("HOME", "~"), ".netrc").expanduser()
        known = netrc(str(file)).authenticators(parts.hostname or "")
        return _basic(known[0], known[2] or "") if known else {}
    return {}


def _basic(user: str, password: str) -> dict[str, str]:
    return {"Authorization": f"Basic {b64encode(f'{user}:{password}'.encode()).decode()}"}
