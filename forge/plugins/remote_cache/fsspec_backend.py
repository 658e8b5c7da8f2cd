"""Remote caches at any URL that fsspec supports: buckets, SSH, shared folders."""

from __future__ import annotations

import contextlib
import os
import threading
from typing import TYPE_CHECKING, Any, Final, Protocol

from forge.base.errors import ForgeError, HostError, Problem
from forge.base.own_environment import extra_command, install_beside_forge
from forge.plugins.remote_cache.remote import Remote

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable
    from typing import BinaryIO

    from forge.cache.model import RemoteOptions

    class _FileSystem(Protocol):
        """The methods that forge uses of fsspec's untyped file systems."""

        def open(self, path: str, mode: str) -> BinaryIO: ...
        def info(self, path: str) -> dict[str, Any]: ...
        def makedirs(self, path: str, *, exist_ok: bool) -> None: ...
        def mv(self, path1: str, path2: str) -> None: ...
        def rm_file(self, path: str) -> None: ...


_BLOCK: Final = 1 << 18
_BUCKETS: Final = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oss", "oci", "tos"})
"""Object stores: they have no folders, files appear atomically, and moving means copying."""

_SHELLS: Final = frozenset({"ssh", "sftp"})


def connect(url: str, options: RemoteOptions) -> Remote:
    """Return the store for a URL without connecting to it; raises HostError if a library is missing."""
    try:
        from fsspec import get_filesystem_class
    except ImportError:
        message = "the remote cache requires the Python package 'fsspec', which is not installed"
        raise HostError(Problem(message, hint=f"run: {extra_command('remote')}")) from None
    scheme = url.partition(":")[0]
    try:
        kind = get_filesystem_class(scheme)
    except ImportError as error:
        message = f"fsspec requires another library for '{scheme}:' URLs: {error}"
        raise HostError(Problem(message, hint=_library(scheme))) from None
    except ValueError:
        message = f"unsupported URL scheme '{scheme}' of the remote cache"
        hint = "use http, https, s3, gs, ssh or another scheme supported by fsspec"
        raise ForgeError(Problem(message, hint=hint)) from None
    if kind.__module__ == "fsspec.implementations.sftp":
        message = "fsspec's built-in SSH implementation does not verify host keys"
        raise HostError(Problem(message, hint=_library(scheme)))
    return Remote(FsspecBackend(url), url, options)


def _library(scheme: str) -> str | None:
    """Return a hint with the command that installs fsspec's library for a scheme, if known."""
    from fsspec.registry import known_implementations

    if scheme in _SHELLS:
        return f"run: {install_beside_forge('sshfs')}"
    module = str(known_implementations.get(scheme, {}).get("class", "")).partition(".")[0]
    return f"run: {install_beside_forge(module)}" if module not in {"", "fsspec"} else None


class FsspecBackend:
    """A `Backend` of files in an fsspec file system, which manages its connections itself."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._scheme = url.partition(":")[0]
        self._lock = threading.Lock()
        self._connection: tuple[_FileSystem, str] | None = None

    def read(self, path: str) -> Generator[bytes]:
        system, location = self._at(path)
        with system.open(location, "rb") as stream:
            while block := stream.read(_BLOCK):
                yield block

    def size(self, path: str) -> int | None:
        system, location = self._at(path)
        size: int | None = system.info(location).get("size")
        return size

    def write(self, path: str, size: int, blocks: Callable[[], Iterable[bytes]]) -> None:
        """Write a file atomically, as far as the file system supports it."""
        system, location = self._at(path)
        if self._scheme in _BUCKETS:
            with system.open(location, "wb") as stream:
                stream.writelines(blocks())
            return
        system.makedirs(location.rpartition("/")[0], exist_ok=True)
        draft = f"{location}.{os.urandom(4).hex()}.draft"
        try:
            with system.open(draft, "wb") as stream:
                stream.writelines(blocks())
            system.mv(draft, location)
        except BaseException:
            with contextlib.suppress(Exception):
                system.rm_file(draft)
            raise

    def close(self) -> None:
        pass

    def _at(self, path: str) -> tuple[_FileSystem, str]:
        """Return the file system and a path in it; the first call connects."""
        from fsspec.core import url_to_fs

        with self._lock:
            if self._connection is None:
                # Without this, sshfs disables host key checks; for asyncssh, () means ~/.ssh/known_hosts.
                more = {"known_hosts": ()} if self._scheme in _SHELLS else {}
                self._connection = url_to_fs(self._url, **more)
        system, root = self._connection
        return system, f"{root.rstrip('/')}/{path}"
