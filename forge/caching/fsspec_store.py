"""A store behind any URL that fsspec knows: buckets, SSH, shared folders; with ac/ and cas/ as over HTTP."""

from __future__ import annotations

import contextlib
import os
import re
import threading
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

from forge.caching import action_result
from forge.caching.checking import arriving, decoded, departing, encoded, opened
from forge.caching.faults import BlobFault
from forge.caching.model import StoreFault
from forge.caching.patience import Errands, Overdue, Patience
from forge.errors import EnvironmentFault, ForgeError, Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path
    from typing import BinaryIO, TypeVar

    from forge.caching.checking import Arrival
    from forge.caching.model import ActionResult, Digest

    _Answer = TypeVar("_Answer")

    class _FileSystem(Protocol):
        """What forge uses of fsspec's file systems, which have no types."""

        def open(self, path: str, mode: str) -> BinaryIO: ...
        def info(self, path: str) -> dict[str, Any]: ...
        def makedirs(self, path: str, *, exist_ok: bool) -> None: ...
        def mv(self, path1: str, path2: str) -> None: ...
        def rm_file(self, path: str) -> None: ...


_BLOCK: Final = 1 << 18
_BUCKETS: Final = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oss", "oci", "tos"})
"""What has no folders, and shows a file only when all of it is there; moving would be copying."""

_SHELLS: Final = frozenset({"ssh", "sftp"})

_USER: Final = re.compile(r"(?<=//)[^/]*@")


class FsspecStore:
    """Asks a file system of fsspec, whose blocking calls are left behind when they take too long."""

    def __init__(self, url: str, seconds: float) -> None:
        """Take a URL that fsspec has a library for; nobody is asked yet."""
        self._open = _file_system(url)
        self.name = _USER.sub("", url).rstrip("/")
        self._secret = found[0] if (found := _USER.search(url)) else None
        self._atomic = url.partition(":")[0] in _BUCKETS
        self._seconds = seconds
        self._errands = Errands()
        self._lock = threading.Lock()
        self._known: tuple[_FileSystem, str] | None = None
        self._doubtful = False

    def result(self, key: str) -> ActionResult | None:
        """Return what a key leads to, or None."""
        data = self._within(lambda patience: self._read(f"ac/{key}", patience))
        return decoded(self.name, key, data)

    def put_result(self, key: str, result: ActionResult) -> None:
        """Let a key lead to a result, whose blobs are there already."""
        data = encoded(result)
        self._within(lambda patience: self._write(f"ac/{key}", patience.counted([data])))

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
        if not self._doubtful and self._within(lambda _: self._has(path, digest.size)):
            return
        with opened(source) as stream:
            blocks = departing(source, stream, digest, _BLOCK)
            self._within(lambda patience: self._write(path, patience.counted(blocks)))

    def close(self) -> None:
        """Let nobody wait any more; fsspec keeps its connections itself."""
        self._errands.close()

    def _within(self, job: Callable[[Patience], _Answer]) -> _Answer:
        """Do what asks the file system, and give up in time; libraries raise what they like."""
        patience = Patience(self._seconds)
        try:
            return self._errands.run(patience, lambda: job(patience))
        except Overdue:
            raise StoreFault(f"{self.name}: it took longer than {self._seconds:g} s") from None
        except StoreFault:
            raise
        except Exception as error:  # noqa: BLE001  (of botocore, paramiko and so on: no build fails over them)
            raise StoreFault(f"{self.name}: {self._without_secret(error)}") from None

    def _without_secret(self, error: Exception) -> str:
        lines = str(error).splitlines()
        text = f"{type(error).__name__}{f': {lines[0]}' if lines else ''}"[:300]
        return text.replace(self._secret, "") if self._secret else text

    def _at(self, path: str) -> tuple[_FileSystem, str]:
        """Return the file system and a path there; the first who asks connects."""
        with self._lock:
            if self._known is None:
                self._known = self._open()
        system, root = self._known
        return system, f"{root.rstrip('/')}/{path}"

    def _read(self, path: str, patience: Patience) -> bytes | None:
        system, where = self._at(path)
        data = bytearray()
        try:
            with system.open(where, "rb") as stream:
                for block in patience.counted(_blocks(stream)):
                    data += block
                    if len(data) > action_result.LARGEST:
                        raise BlobFault(f"{self.name}: {path[:15]} is too long for a result")
        except FileNotFoundError:
            return None
        return bytes(data)

    def _receive(self, arrival: Arrival, patience: Patience) -> bool:
        """Hand a blob over as it comes; tell if there is one."""
        system, where = self._at(f"cas/{arrival.digest.hash}")
        try:
            with system.open(where, "rb") as stream:
                for block in patience.counted(_blocks(stream)):
                    arrival.write(block)
        except FileNotFoundError:
            return False
        return True

    def _has(self, path: str, size: int) -> bool:
        system, where = self._at(path)
        try:
            return system.info(where).get("size") in {None, size}
        except FileNotFoundError:
            return False

    def _write(self, path: str, blocks: Iterable[bytes]) -> None:
        """Write a file that nobody sees before it is whole, as far as the file system allows that."""
        system, where = self._at(path)
        if self._atomic:
            with system.open(where, "wb") as stream:
                stream.writelines(blocks)
            return
        system.makedirs(where.rpartition("/")[0], exist_ok=True)
        draft = f"{where}.{os.urandom(4).hex()}.draft"
        try:
            with system.open(draft, "wb") as stream:
                stream.writelines(blocks)
            system.mv(draft, where)
        except BaseException:
            with contextlib.suppress(Exception):
                system.rm_file(draft)
            raise


def _blocks(stream: BinaryIO) -> Iterator[bytes]:
    while block := stream.read(_BLOCK):
        yield block


def _library(scheme: str) -> str | None:
    """Return the command that installs what fsspec needs for a scheme, as far as its table says that."""
    from fsspec.registry import known_implementations  # noqa: PLC0415  (as below)

    if scheme in _SHELLS:
        return "run: pip install sshfs"
    module = str(known_implementations.get(scheme, {}).get("class", "")).partition(".")[0]
    return f"run: pip install {module}" if module not in {"", "fsspec"} else None


def _file_system(url: str) -> Callable[[], tuple[_FileSystem, str]]:
    """Return what connects to a URL; a library that is missing is a problem of the user's."""
    try:
        from fsspec import get_filesystem_class  # noqa: PLC0415  (only who has such a URL needs it)
        from fsspec.core import url_to_fs  # noqa: PLC0415
    except ImportError:
        what = "fsspec is missing, by which forge reaches the remote cache"
        raise EnvironmentFault(Problem(what, hint="run: pip install 'ros-forge[remote]'")) from None
    scheme = url.partition(":")[0]
    try:
        kind = get_filesystem_class(scheme)
    except ImportError as error:
        what = f"fsspec needs one more library for '{scheme}:' URLs: {error}"
        raise EnvironmentFault(Problem(what, hint=_library(scheme))) from None
    except ValueError:
        what = f"nothing is known of '{scheme}:' URLs, which the remote cache has"
        hint = "use http, https, s3, gs, ssh or another one that fsspec knows"
        raise ForgeError(Problem(what, hint=hint)) from None
    if kind.__module__ == "fsspec.implementations.sftp":
        what = "fsspec's own SSH believes every server that it is the right one"
        raise EnvironmentFault(Problem(what, hint=_library(scheme)))
    # What sshfs takes for none given: believe everybody; what asyncssh below it takes so: ~/.ssh/known_hosts.
    more = {"known_hosts": ()} if scheme in _SHELLS else {}
    return lambda: cast("tuple[_FileSystem, str]", url_to_fs(url, **more))
