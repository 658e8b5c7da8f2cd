"""A store at any URL that fsspec supports: buckets, SSH, shared folders; with ac/ and cas/ as over HTTP."""

from __future__ import annotations

import contextlib
import os
import re
import threading
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

from forge.base.errors import ForgeError, HostError, Problem
from forge.base.own_environment import extra_command, install_beside_forge
from forge.cache import action_result
from forge.cache.checking import decode_result, encode_result, open_source, read_blocks, receiving
from forge.cache.deadline import Deadline, DeadlineExceeded, TimeoutExecutor
from forge.cache.model import BlobError, StoreError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path
    from typing import BinaryIO, TypeVar

    from forge.cache.checking import BlobDownload
    from forge.cache.model import ActionResult, Digest

    _Answer = TypeVar("_Answer")

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

_USER: Final = re.compile(r"(?<=//)[^/]*@")


class FsspecStore:
    """Uses an fsspec file system; blocking calls are abandoned at the deadline."""

    def __init__(self, url: str, seconds: float) -> None:
        """Find fsspec's implementation for the URL without connecting."""
        self._open = _file_system(url)
        self.name = _USER.sub("", url).rstrip("/")
        self._secret = found[0] if (found := _USER.search(url)) else None
        self._atomic = url.partition(":")[0] in _BUCKETS
        self._seconds = seconds
        self._executor = TimeoutExecutor()
        self._lock = threading.Lock()
        self._known: tuple[_FileSystem, str] | None = None
        self._rewrite_blobs = False

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""
        data = self._with_deadline(lambda deadline: self._read(f"ac/{key}", deadline))
        return decode_result(self.name, key, data)

    def put_result(self, key: str, result: ActionResult) -> None:
        """Store a result, whose blobs must be stored already."""
        data = encode_result(result)
        self._with_deadline(lambda deadline: self._write(f"ac/{key}", deadline.metered([data])))

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
        if not self._rewrite_blobs and self._with_deadline(lambda _: self._has(path, digest.size)):
            return
        with open_source(source) as stream:
            blocks = read_blocks(source, stream, digest, _BLOCK)
            self._with_deadline(lambda deadline: self._write(path, deadline.metered(blocks)))

    def close(self) -> None:
        """Abort pending requests; fsspec manages its connections itself."""
        self._executor.close()

    def _with_deadline(self, job: Callable[[Deadline], _Answer]) -> _Answer:
        """Run `job` until its deadline; convert the libraries' exceptions to StoreError."""
        deadline = Deadline(self._seconds)
        try:
            return self._executor.run(deadline, lambda: job(deadline))
        except DeadlineExceeded:
            raise StoreError(f"{self.name}: timed out after {self._seconds:g} s") from None
        except StoreError:
            raise
        except Exception as error:
            raise StoreError(f"{self.name}: {self._without_secret(error)}") from None

    def _without_secret(self, error: Exception) -> str:
        lines = str(error).splitlines()
        text = f"{type(error).__name__}{f': {lines[0]}' if lines else ''}"[:300]
        return text.replace(self._secret, "") if self._secret else text

    def _at(self, path: str) -> tuple[_FileSystem, str]:
        """Return the file system and a path in it; the first call connects."""
        with self._lock:
            if self._known is None:
                self._known = self._open()
        system, root = self._known
        return system, f"{root.rstrip('/')}/{path}"

    def _read(self, path: str, deadline: Deadline) -> bytes | None:
        system, location = self._at(path)
        data = bytearray()
        try:
            with system.open(location, "rb") as stream:
                for block in deadline.metered(_blocks(stream)):
                    data += block
                    if len(data) > action_result.MAX_SIZE:
                        raise BlobError(f"{self.name}: {path[:15]} is too large for a result")
        except FileNotFoundError:
            return None
        return bytes(data)

    def _receive(self, download: BlobDownload, deadline: Deadline) -> bool:
        """Download a blob; return False if it does not exist."""
        system, location = self._at(f"cas/{download.digest.hash}")
        try:
            with system.open(location, "rb") as stream:
                for block in deadline.metered(_blocks(stream)):
                    download.write(block)
        except FileNotFoundError:
            return False
        return True

    def _has(self, path: str, size: int) -> bool:
        system, location = self._at(path)
        try:
            return system.info(location).get("size") in {None, size}
        except FileNotFoundError:
            return False

    def _write(self, path: str, blocks: Iterable[bytes]) -> None:
        """Write a file atomically, as far as the file system supports it."""
        system, location = self._at(path)
        if self._atomic:
            with system.open(location, "wb") as stream:
                stream.writelines(blocks)
            return
        system.makedirs(location.rpartition("/")[0], exist_ok=True)
        draft = f"{location}.{os.urandom(4).hex()}.draft"
        try:
            with system.open(draft, "wb") as stream:
                stream.writelines(blocks)
            system.mv(draft, location)
        except BaseException:
            with contextlib.suppress(Exception):
                system.rm_file(draft)
            raise


def _blocks(stream: BinaryIO) -> Iterator[bytes]:
    while block := stream.read(_BLOCK):
        yield block


def _library(scheme: str) -> str | None:
    """Return a hint with the command that installs fsspec's library for a scheme, if known."""
    from fsspec.registry import known_implementations

    if scheme in _SHELLS:
        return f"run: {install_beside_forge('sshfs')}"
    module = str(known_implementations.get(scheme, {}).get("class", "")).partition(".")[0]
    return f"run: {install_beside_forge(module)}" if module not in {"", "fsspec"} else None


def _file_system(url: str) -> Callable[[], tuple[_FileSystem, str]]:
    """Return a function that connects to a URL; raises HostError if a library is missing."""
    try:
        from fsspec import get_filesystem_class
        from fsspec.core import url_to_fs
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
    # Without this, sshfs disables host key checks; for asyncssh, () means ~/.ssh/known_hosts.
    more = {"known_hosts": ()} if scheme in _SHELLS else {}
    return lambda: cast("tuple[_FileSystem, str]", url_to_fs(url, **more))
