"""Remote caches over HTTP: GET, HEAD and PUT of /ac/KEY and /cas/SHA256, as for bazel-remote and WebDAV."""

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
from forge.base.errors import ForgeError, HostError, Problem
from forge.base.own_environment import extra_command
from forge.cache.model import BlobError, StoreError
from forge.plugins.remote_cache.remote import Remote
from forge.plugins.remote_cache.store import WritingRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Mapping

    from urllib3 import BaseHTTPResponse
    from urllib3.exceptions import HTTPError

    from forge.cache.model import RemoteOptions

_BLOCK: Final = 1 << 16
"""Bytes to read at a time."""

_TOO_MUCH: Final = frozenset({HTTPStatus.BAD_REQUEST, HTTPStatus.REQUEST_ENTITY_TOO_LARGE})
_UNWRITABLE: Final = frozenset(
    {
        *(HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT),
        *(HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED, HTTPStatus.INSUFFICIENT_STORAGE),
    }
)
"""Responses to a PUT that do not prevent reading from the store."""

_MEANINGS: Final[dict[int, str]] = {
    HTTPStatus.UNAUTHORIZED: "set a password in the URL or in ~/.netrc, or a token in FORGE_CACHE_TOKEN",
    HTTPStatus.FORBIDDEN: "permission denied",
    HTTPStatus.METHOD_NOT_ALLOWED: "the server is read-only",
    HTTPStatus.NOT_IMPLEMENTED: "the server is read-only",
    HTTPStatus.CONFLICT: "the server does not create folders",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "the file is too large for the server",
    HTTPStatus.INSUFFICIENT_STORAGE: "the server's storage is full",
}


def connect(url: str, options: RemoteOptions) -> Remote:
    """Return the store for a URL without connecting to it; raises ForgeError for an invalid URL.

    Messages do not quote the URL, since it may contain a password.
    """
    parts = urlsplit(url)
    if not parts.hostname:
        hint = "for example: --remote-cache http://HOST:PORT/FOLDER"
        raise ForgeError(Problem("the remote cache is not a valid URL", hint=hint))
    if " " in url or not url.isascii():
        hint = "escape them, such as %20"
        raise ForgeError(Problem("the URL of the remote cache contains invalid characters", hint=hint))
    if parts.query or parts.fragment:
        message = "the URL of the remote cache has a query or fragment ('?' or '#')"
        raise ForgeError(Problem(message, hint="remove it"))
    return Remote(HttpBackend(url, options.seconds, options.variables), url, options)


class HttpBackend:
    """A `Backend` of files on one server; redirects are not followed."""

    def __init__(self, url: str, seconds: float, variables: Mapping[str, str]) -> None:
        """Set up a connection pool without connecting; each socket operation may take `seconds`."""
        try:
            from urllib3 import Timeout, connection_from_url
        except ImportError:
            message = "the remote cache requires the Python package 'urllib3', which is not installed"
            raise HostError(Problem(message, hint=f"run: {extra_command('remote')}")) from None

        parts = urlsplit(url)
        self._path = "".join(f"/{part}" for part in parts.path.split("/") if part)
        self._pool = connection_from_url(
            f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}",
            maxsize=8,
            timeout=Timeout(connect=seconds, read=seconds),
            headers={
                "User-Agent": f"ros-forge/{__version__}",
                "Accept-Encoding": "identity",
                **_authorization(url, variables),
            },
        )

    def read(self, path: str) -> Generator[bytes]:
        with self._response("GET", path) as response:
            self._check_exists(response)
            yield from response.stream(_BLOCK, decode_content=False)

    def size(self, path: str) -> int | None:
        with self._response("HEAD", path) as response:
            if response.status in {HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED}:
                raise FileNotFoundError
            self._check_exists(response)
            return _length(response)

    def write(self, path: str, size: int, blocks: Callable[[], Iterable[bytes]]) -> None:
        with self._response("PUT", path, size, blocks) as response:
            if response.status in _TOO_MUCH:
                raise BlobError(self._reason(response))
            if response.status in _UNWRITABLE:
                raise WritingRefused(self._reason(response))
            if not HTTPStatus.OK <= response.status <= HTTPStatus.NO_CONTENT:
                raise StoreError(self._reason(response))
            _skip_rest(response)

    def close(self) -> None:
        self._pool.close()

    def _check_exists(self, response: BaseHTTPResponse) -> None:
        if response.status in {HTTPStatus.NOT_FOUND, HTTPStatus.GONE}:
            _skip_rest(response)
            raise FileNotFoundError
        if response.status != HTTPStatus.OK:
            raise StoreError(self._reason(response))

    def _reason(self, response: BaseHTTPResponse) -> str:
        """Return a message for an unexpected response."""
        meaning = _MEANINGS.get(response.status, (response.reason or "")[:100])
        if response.status == HTTPStatus.UNAUTHORIZED and "Authorization" in self._pool.headers:
            meaning = "the server does not accept the user and password, or the token"
        if location := response.headers.get("Location"):
            meaning = f"redirects to {location[:200]!r} are not followed"
        return f"HTTP status {response.status}: {meaning}"

    @contextlib.contextmanager
    def _response(
        self, method: str, path: str, size: int = 0, blocks: Callable[[], Iterable[bytes]] | None = None
    ) -> Iterator[BaseHTTPResponse]:
        """Send a request and yield the response.

        Send it once more if the server has closed a pooled connection, not after a timeout.
        """
        from urllib3.exceptions import HTTPError, ProtocolError

        headers = dict(self._pool.headers)
        if blocks is not None:
            headers |= {"Content-Length": str(size), "Content-Type": "application/octet-stream"}

        def send() -> BaseHTTPResponse:
            return self._pool.urlopen(
                method,
                f"{self._path}/{path}",
                body=blocks() if blocks else None,
                headers=headers,
                retries=False,
                redirect=False,
                preload_content=False,
                decode_content=False,
            )

        try:
            try:
                response = send()
            except ProtocolError as error:
                if _timed_out(error):
                    raise
                response = send()
            with contextlib.closing(response):
                yield response
        except HTTPError as error:
            raise StoreError(_reason_of(error)) from None


def _length(response: BaseHTTPResponse) -> int | None:
    """Return the Content-Length of a response, or None."""
    announced = response.headers.get("Content-Length", "")
    return int(announced) if re.fullmatch(r"[0-9]{1,18}", announced) else None


def _skip_rest(response: BaseHTTPResponse) -> None:
    """Read a short response completely: only then can its connection be reused."""
    if (_length(response) or 0) <= _BLOCK:
        response.read(_BLOCK)


def _timed_out(error: HTTPError) -> bool:
    """Return True if the server did not take the request in time, which urllib3 reports as aborted."""
    return any(isinstance(cause, TimeoutError) for cause in error.args)


def _reason_of(error: HTTPError) -> str:
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


def _authorization(url: str, variables: Mapping[str, str]) -> dict[str, str]:
    """Return the credentials of the URL, else of FORGE_CACHE_TOKEN, else of ~/.netrc, else none."""
    parts, user = urlsplit(url), None
    if parts.username is not None:
        user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
    elif token := variables.get("FORGE_CACHE_TOKEN"):
        if not re.fullmatch(r"[!-~]+", token):
            raise ForgeError(Problem("FORGE_CACHE_TOKEN contains a blank or another invalid character"))
        return {"Authorization": f"Bearer {token}"}
    else:
        with contextlib.suppress(OSError, NetrcParseError):
            file = variables.get("NETRC") or Path(variables.get("HOME", "~"), ".netrc").expanduser()
            if login := netrc(str(file)).authenticators(parts.hostname or ""):
                user = f"{login[0]}:{login[2] or ''}"
    return {} if user is None else {"Authorization": f"Basic {b64encode(user.encode()).decode()}"}
