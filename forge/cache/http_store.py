"""An HTTP store: GET, HEAD and PUT of /ac/KEY and /cas/SHA256, as for bazel-remote and WebDAV servers."""

from __future__ import annotations

import contextlib
import re
from base64 import b64encode
from http import HTTPStatus
from netrc import NetrcParseError, netrc
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import unquote, urlsplit

from forge import __version__
from forge.base.errors import ForgeError, Problem
from forge.base.frozen import frozen
from forge.cache import action_result
from forge.cache.checking import decode_result, encode_result, open_source, read_blocks, receiving
from forge.cache.deadline import Deadline, DeadlineExceeded, TimeoutExecutor
from forge.cache.model import BlobError, StoreError, WritingRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from typing import TypeVar
    from urllib.parse import SplitResult

    from urllib3 import BaseHTTPResponse
    from urllib3.exceptions import HTTPError

    from forge.cache.checking import BlobDownload
    from forge.cache.model import ActionResult, Digest

    _Answer = TypeVar("_Answer")

_BLOCK: Final = 1 << 16
"""Bytes to read or send at a time."""

_DIGITS: Final = 19
"""The limit of digits in Content-Length; Python rejects integers of thousands of digits."""

_CONNECTIONS: Final = 8
"""The size of the connection pool."""

_WRITTEN: Final = frozenset({HTTPStatus.OK, HTTPStatus.CREATED, HTTPStatus.ACCEPTED, HTTPStatus.NO_CONTENT})
_ABSENT: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
_TOO_MUCH: Final = frozenset({HTTPStatus.BAD_REQUEST, HTTPStatus.REQUEST_ENTITY_TOO_LARGE})
_UNWRITABLE: Final = frozenset(
    {
        *(HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT),
        *(HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED, HTTPStatus.INSUFFICIENT_STORAGE),
    }
)
"""Responses to a PUT after which the store may still be read."""

_MEANINGS: Final[dict[int, str]] = {
    HTTPStatus.UNAUTHORIZED: "set a password in the URL or in ~/.netrc, or a token in FORGE_CACHE_TOKEN",
    HTTPStatus.FORBIDDEN: "permission denied",
    HTTPStatus.METHOD_NOT_ALLOWED: "the server is read-only",
    HTTPStatus.NOT_IMPLEMENTED: "the server is read-only",
    HTTPStatus.CONFLICT: "the server does not create folders",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "the file is too large for the server",
    HTTPStatus.INSUFFICIENT_STORAGE: "the server's storage is full",
}


@frozen
class _Call:
    """A request; `body` is called for each attempt to send it."""

    method: str
    path: str
    deadline: Deadline
    size: int = 0
    body: Callable[[], Iterable[bytes]] | None = None


class HttpStore:
    """A store on one server; redirects are not followed."""

    def __init__(self, url: str, seconds: float, variables: Mapping[str, str]) -> None:
        """Set up a connection pool for a valid URL without connecting; each request may take `seconds`."""
        from urllib3 import Timeout, connection_from_url

        parts = urlsplit(url)
        host = parts.netloc.rpartition("@")[2]
        self._path = "".join(f"/{part}" for part in parts.path.split("/") if part)
        self.name = f"{parts.scheme}://{host}{self._path}"
        self._seconds = seconds
        self._executor = TimeoutExecutor()
        self._rewrite_blobs = False
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

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""
        data = self._with_deadline(lambda deadline: self._read(f"ac/{key}", deadline))
        return decode_result(self.name, key, data)

    def put_result(self, key: str, result: ActionResult) -> None:
        """Store a result, whose blobs must be stored already."""
        data = encode_result(result)

        def send(deadline: Deadline) -> None:
            self._write(_Call("PUT", f"ac/{key}", deadline, len(data), lambda: (data,)))

        self._with_deadline(send)

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to the new file `target`; return False if the store does not have it."""
        with receiving(self.name, digest, target) as download:
            try:
                found = self._with_deadline(lambda deadline: self._receive(download, deadline))
                return found and download.finish()
            except BlobError:
                self._rewrite_blobs = True
                raise

    def put(self, digest: Digest, source: Path) -> None:
        """Store a blob unless it exists; after a corrupt download, existing blobs are overwritten."""
        path = f"cas/{digest.hash}"
        if not self._rewrite_blobs and self._with_deadline(
            lambda deadline: self._has(path, deadline, digest.size)
        ):
            return
        with open_source(source) as stream:

            def body(deadline: Deadline) -> Iterable[bytes]:
                return deadline.metered(read_blocks(source, stream, digest, _BLOCK))

            self._with_deadline(
                lambda deadline: self._write(
                    _Call("PUT", path, deadline, digest.size, lambda: body(deadline))
                )
            )

    def close(self) -> None:
        """Close idle connections and stop waiting for pending requests."""
        self._executor.close()
        self._pool.close()

    def _with_deadline(self, job: Callable[[Deadline], _Answer]) -> _Answer:
        """Run `job` until its deadline."""
        deadline = Deadline(self._seconds)
        try:
            return self._executor.run(deadline, lambda: job(deadline))
        except DeadlineExceeded:
            raise StoreError(f"{self.name}: timed out after {self._seconds:g} s") from None

    def _read(self, path: str, deadline: Deadline) -> bytes | None:
        """Return the bytes of a result, or None if it does not exist."""
        with self._response(_Call("GET", path, deadline)) as response:
            if not self._is_there(response):
                return None
            data = bytearray()
            for block in deadline.metered(response.stream(_BLOCK, decode_content=False)):
                data += block
                if len(data) > action_result.MAX_SIZE:
                    raise BlobError(f"{self.name}: {path[:15]} is too large for a result")
            return bytes(data)

    def _receive(self, download: BlobDownload, deadline: Deadline) -> bool:
        """Download a blob; return False if it does not exist."""
        with self._response(_Call("GET", f"cas/{download.digest.hash}", deadline)) as response:
            if not self._is_there(response):
                return False
            download.expect(_length(response))
            for block in deadline.metered(response.stream(_BLOCK, decode_content=False)):
                download.write(block)
        return True

    def _has(self, path: str, deadline: Deadline, size: int) -> bool:
        """Return True if the server has a file of this size; False if it does not support HEAD."""
        with self._response(_Call("HEAD", path, deadline)) as response:
            if response.status in {HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED}:
                return False
            return self._is_there(response) and _length(response) in {None, size}

    def _write(self, call: _Call) -> None:
        with self._response(call) as response:
            if response.status in _WRITTEN:
                return
            fault = self._refusal(response)
            if response.status in _TOO_MUCH:
                raise BlobError(fault)
            raise (WritingRefused if response.status in _UNWRITABLE else StoreError)(fault)

    def _is_there(self, response: BaseHTTPResponse) -> bool:
        if response.status not in _ABSENT and response.status != HTTPStatus.OK:
            raise StoreError(self._refusal(response))
        return response.status == HTTPStatus.OK

    def _refusal(self, response: BaseHTTPResponse) -> str:
        """Return a message for an unexpected response."""
        meaning = _MEANINGS.get(response.status, (response.reason or "")[:100])
        if response.status == HTTPStatus.UNAUTHORIZED and "Authorization" in self._pool.headers:
            meaning = "the server does not accept the user and password, or the token"
        if location := response.headers.get("Location"):
            meaning = f"redirects to {location[:200]!r} are not followed"
        return f"{self.name}: HTTP status {response.status}: {meaning}"

    @contextlib.contextmanager
    def _response(self, call: _Call) -> Iterator[BaseHTTPResponse]:
        """Send a request and yield the response."""
        from urllib3.exceptions import HTTPError

        try:
            response = self._send_with_retry(call)
            with contextlib.closing(response):
                yield response
                if (_length(response) or 0) <= _BLOCK:
                    response.read(_BLOCK)  # the connection can be reused only after reading to the end
        except HTTPError as error:
            raise StoreError(f"{self.name}: {_reason(error)}") from None

    def _send_with_retry(self, call: _Call) -> BaseHTTPResponse:
        """Send a request; retry once if the server has closed a pooled connection, not after a timeout."""
        from urllib3.exceptions import ProtocolError

        try:
            return self._send(call)
        except ProtocolError as error:
            if call.deadline.remaining() <= 0 or _timed_out(error):
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


def _length(response: BaseHTTPResponse) -> int | None:
    """Return the Content-Length of a response, or None."""
    announced = response.headers.get("Content-Length", "")
    return (
        int(announced) if announced.isascii() and announced.isdigit() and len(announced) < _DIGITS else None
    )


def _timed_out(error: HTTPError) -> bool:
    """Return True if the server did not take the request in time, which urllib3 reports as aborted."""
    return any(isinstance(cause, TimeoutError) for cause in error.args)


def _reason(error: HTTPError) -> str:
    """Return a short reason for a failed request; urllib3's messages contain Python object names."""
    from urllib3 import exceptions

    match error:
        case exceptions.NameResolutionError():
            return "cannot resolve host name"
        case exceptions.NewConnectionError(__cause__=OSError(strerror=str(text))):
            return f"cannot connect: {text}"
        case exceptions.TimeoutError():
            return "timed out"
        case exceptions.SSLError(args=(Exception() as cause, *_)):
            return f"TLS error: {getattr(cause, 'verify_message', '') or cause}"
        case exceptions.ProtocolError():
            return "timed out" if _timed_out(error) else "the server closed the connection"
        case _:
            return f"request failed ({type(error).__name__})"


def _authorization(parts: SplitResult, variables: Mapping[str, str]) -> dict[str, str]:
    """Return the credentials of the URL, else of FORGE_CACHE_TOKEN, else of ~/.netrc, else none."""
    if parts.username is not None:
        return _basic(unquote(parts.username), unquote(parts.password or ""))
    if token := variables.get("FORGE_CACHE_TOKEN"):
        if not re.fullmatch(r"[!-~]+", token):
            raise ForgeError(Problem("FORGE_CACHE_TOKEN contains a blank or another invalid character"))
        return {"Authorization": f"Bearer {token}"}
    with contextlib.suppress(OSError, NetrcParseError):
        file = variables.get("NETRC") or Path(variables.get("HOME", "~"), ".netrc").expanduser()
        known = netrc(str(file)).authenticators(parts.hostname or "")
        return _basic(known[0], known[2] or "") if known else {}
    return {}


def _basic(user: str, password: str) -> dict[str, str]:
    return {"Authorization": f"Basic {b64encode(f'{user}:{password}'.encode()).decode()}"}
