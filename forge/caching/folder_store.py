"""A folder that keeps results and blobs, as Bazel's disk cache has them: ac/ab/KEY and cas/ab/SHA-256.

Many builds may read and write it at a time: each file appears whole or not at all. A result is used when
its file was touched last; what is used least goes first when there is too much.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import stat
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from forge.caching.action_result import decode, encode
from forge.caching.model import Digest, StoreFault
from forge.files import replace_file

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.caching.model import ActionResult

_CHUNK = 1 << 20
_CLONE = 0x40049409
"""Linux's ioctl that lets a new file share the blocks of another, where the file system can (FICLONE)."""


PRIVATE = 0o700
"""Rights of folders that nobody else may look into."""
_SHARED = stat.S_ISGID | stat.S_IRWXG
"""What `chmod g+rwxs` gives to the folder of a group: what is put into it belongs to that as well."""


class FolderStore:
    """A store in a folder of this machine."""

    def __init__(self, folder: Path) -> None:
        """Remember the folder; it is made when something is put into it."""
        self.folder = folder
        self.name = str(folder)
        self._seen: set[Path] = set()
        """Folders that were there before, and are nobody else's to look into."""

    def result(self, key: str) -> ActionResult | None:
        """Return what a key leads to, or None; a message that cannot be read is none."""
        path = self._path("ac", key)
        try:
            with open(path, "rb", buffering=0) as stream:  # noqa: PTH123  (two of each package)
                content = stream.read()
            with contextlib.suppress(OSError):  # a folder that may only be read
                os.utime(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise _fault(error) from None
        try:
            return decode(content)
        except ValueError:
            return None

    def put_result(self, key: str, result: ActionResult) -> None:
        """Let a key lead to a result."""
        with _told():
            path = self.result_path(key)
            self._make(self.folder / "ac")
            self._make(path.parent)
            replace_file(path, encode(result), mode=self.rights & 0o666)

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Copy a blob to `target`, by sharing its blocks where the file system can; verified before."""
        source = self.blob_path(digest.hash)
        try:
            with source.open("rb") as stream:
                if not _is(digest, stream.fileno()):
                    self.discard(digest.hash)
                    return False
                with _told(), target.open("xb") as copy:
                    copy_bytes(stream.fileno(), copy.fileno(), digest.size)
        except FileNotFoundError:
            return False
        return True

    def put(self, digest: Digest, source: Path) -> None:
        """Keep the bytes of `source`."""
        path = self.blob_path(digest.hash)
        if path.is_file():
            return
        with _told():
            draft = self.draft()
            try:
                with source.open("rb") as stream, draft.open("xb") as copy:
                    copy_bytes(stream.fileno(), copy.fileno(), digest.size)
                self.adopt(draft, digest)
            finally:
                draft.unlink(missing_ok=True)

    def close(self) -> None:
        """Do nothing: no connection is open."""

    def open(self, digest: Digest) -> int | None:
        """Return a descriptor of a blob that was verified just now; None when there is none. To be closed."""
        try:
            descriptor = os.open(self._path("cas", digest.hash), os.O_RDONLY)
        except FileNotFoundError:
            return None
        try:
            if _is(digest, descriptor):
                return descriptor
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)
        self.discard(digest.hash)
        return None

    def adopt(self, draft: Path, digest: Digest) -> None:
        """Make a verified file in the folder the blob that it is."""
        path = self.blob_path(digest.hash)
        self._make(path.parent)
        _set_rights(draft, self.rights & 0o666)
        draft.replace(path)

    def draft(self) -> Path:
        """Return the path of a new file in the folder, not made yet, for what is to be a blob."""
        folder = self.folder / "cas"
        self._make(folder)
        return folder / f".{os.urandom(8).hex()}.forge-draft"

    def discard(self, sha256: str) -> None:
        """Remove a blob that is not what its name says."""
        with contextlib.suppress(OSError):
            self.blob_path(sha256).unlink()

    def result_path(self, key: str) -> Path:
        """Return where the result of a key is."""
        return Path(self._path("ac", key))

    def blob_path(self, sha256: str) -> Path:
        """Return where a blob is."""
        return Path(self._path("cas", sha256))

    @cached_property
    def rights(self) -> int:
        """The rights of what is kept: for its owner alone, unless the folder was made for a group."""
        try:
            mode = stat.S_IMODE(self.folder.stat().st_mode)
        except OSError:
            return PRIVATE
        return mode | 0o700 if mode & _SHARED == _SHARED else PRIVATE

    def _make(self, folder: Path) -> None:
        """Make a folder in this one, and those above it, with the rights of what is kept."""
        try:
            folder.mkdir(mode=self.rights & 0o777)
        except FileExistsError:
            # Earlier versions made them for everybody; this folder itself may be there for other things, too.
            if folder not in self._seen and folder != self.folder and self.rights == PRIVATE:
                self._seen.add(folder)
                _close_to_others(folder)
        except FileNotFoundError:
            if folder == self.folder:
                folder.parent.mkdir(parents=True, exist_ok=True)
            else:
                self._make(folder.parent)
            self._make(folder)
        else:
            _set_rights(folder, self.rights)

    def _path(self, kind: str, name: str) -> str:
        """Return where a file is: as a word, since each package asks several times."""
        return f"{self.folder}/{kind}/{name[:2]}/{name}"


def _close_to_others(folder: Path) -> None:
    if stat.S_IMODE(folder.stat().st_mode) & 0o077:
        _set_rights(folder, PRIVATE)


def _set_rights(path: Path, rights: int) -> None:
    """Set rights where that is possible: a folder may be somebody else's, a file system may have none."""
    with contextlib.suppress(PermissionError):
        path.chmod(rights)


def _is(digest: Digest, descriptor: int) -> bool:
    if os.fstat(descriptor).st_size != digest.size:
        return False
    found = hashlib.sha256()
    offset = 0
    while chunk := os.pread(descriptor, _CHUNK, offset):
        found.update(chunk)
        offset += len(chunk)
    return found.hexdigest() == digest.hash


def copy_bytes(source: int, target: int, size: int) -> None:
    """Copy a file from one descriptor to another, by sharing blocks where the file system can."""
    with contextlib.suppress(OSError):
        fcntl.ioctl(target, _CLONE, source)
        return
    offset = 0
    while offset < size:
        try:
            count = os.copy_file_range(source, target, size - offset, offset, offset)
        except OSError:
            count = os.pwrite(target, os.pread(source, _CHUNK, offset), offset)
        if not count:
            break
        offset += count


@contextlib.contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise _fault(error) from None


def _fault(error: OSError) -> StoreFault:
    return StoreFault(f"{error.filename or 'a file'}: {error.strerror}")
