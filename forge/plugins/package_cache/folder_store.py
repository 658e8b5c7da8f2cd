"""A folder of results and blobs, laid out like Bazel's disk cache: ac/ab/KEY and cas/ab/SHA-256.

Concurrent builds may read and write it: each file appears atomically. The modification time of a result is
the time of its last use; pruning removes the least recently used results first.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import stat
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from forge.base.errors import HostError, Location, Problem
from forge.base.files import replace_file, writable_by_others
from forge.cache.model import ActionResult, Digest, OutputFile, StoreError

_CHUNK = 1 << 20
_SHA256 = re.compile(r"[0-9a-f]{64}")
DRAFT = re.compile(r"\..*\.forge-draft")
_MARK = ".forge_cache"
_TEXT = b"This folder contains a package cache of forge, which removes files in 'ac' and 'cas'.\n"
PRIVATE = 0o700
"""The permissions of private folders."""
_SHARED = stat.S_ISGID | stat.S_IRWXG
"""The permissions set by `chmod g+rwxs`: new files in the folder belong to its group."""


class FolderStore:
    def __init__(self, folder: Path) -> None:
        """Store the folder; it is created when something is stored."""
        self.folder = folder
        self.name = str(folder)
        self._checked: set[Path] = set()
        """Existing folders whose permissions have been checked, and the mark."""

    def foreign_entry(self) -> Path | None:
        """Return an entry that prevents an unmarked folder from becoming a cache, or None."""
        if os.path.lexists(self.folder / _MARK):
            return None
        folders = (self.folder / kind for kind in ("ac", "cas"))
        return next((entry for folder in folders if folder.is_dir() for entry in folder.iterdir()), None)

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None.

        An invalid result, or one in a private folder that others could have written, counts as missing.
        """
        path = self._path("ac", key)
        try:
            with open(path, "rb", buffering=0) as stream:  # noqa: PTH123  (two of each package)
                if self.rights == PRIVATE and writable_by_others(os.fstat(stream.fileno())):
                    return None
                content = stream.read()
            with contextlib.suppress(OSError):  # a read-only folder
                os.utime(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise _fault(error) from None
        try:
            return decode_result(content)
        except ValueError:
            return None

    def put_result(self, key: str, result: ActionResult) -> None:
        with _store_faults():
            path = self.result_path(key)
            self._make(self.folder / "ac")
            self._make(path.parent)
            replace_file(path, encode_result(result), mode=self.rights & 0o666)

    def put(self, digest: Digest, source: Path) -> None:
        path = self.blob_path(digest.hash)
        if path.is_file():
            return
        with _store_faults():
            draft = self.draft()
            try:
                with source.open("rb") as stream, draft.open("xb") as copy:
                    copy_bytes(stream.fileno(), copy.fileno(), digest.size)
                self.adopt(draft, digest)
            finally:
                draft.unlink(missing_ok=True)

    def open(self, digest: Digest) -> int | None:
        """Return a descriptor of a blob that was just verified, or None; a corrupt blob is removed."""
        try:
            descriptor = os.open(self._path("cas", digest.hash), os.O_RDONLY)
        except FileNotFoundError:
            return None
        is_valid = False
        try:
            is_valid = os.fstat(descriptor).st_size == digest.size and sha256_of(descriptor) == digest.hash
        finally:
            if not is_valid:
                os.close(descriptor)
        if is_valid:
            return descriptor
        with contextlib.suppress(OSError):
            self.blob_path(digest.hash).unlink()
        return None

    def adopt(self, draft: Path, digest: Digest) -> None:
        """Move a verified draft to the path of its blob."""
        path = self.blob_path(digest.hash)
        self._make(path.parent)
        _set_rights(draft, self.rights & 0o666)
        draft.replace(path)

    def draft(self) -> Path:
        """Return an unused path in the folder for a future blob."""
        folder = self.folder / "cas"
        self._make(folder)
        return folder / f".{os.urandom(8).hex()}.forge-draft"

    def result_path(self, key: str) -> Path:
        return Path(self._path("ac", key))

    def blob_path(self, sha256: str) -> Path:
        return Path(self._path("cas", sha256))

    @cached_property
    def rights(self) -> int:
        """The permissions of stored files: private, unless the folder is shared with a group."""
        try:
            mode = stat.S_IMODE(self.folder.stat().st_mode)
        except OSError:
            return PRIVATE
        return (mode | 0o700) & ~stat.S_IWOTH if mode & _SHARED == _SHARED else PRIVATE

    def check(self) -> None:
        """Raise HostError if other users can replace results, unless the folder is shared on purpose.

        Results are executed, so users who can write them can run programs as this user.
        """
        for folder in (self.folder, self.folder / "ac"):
            try:
                status = folder.stat()
            except OSError:
                continue
            shared = self.rights != PRIVATE and not status.st_mode & stat.S_IWOTH
            if writable_by_others(status) and not shared:
                name = shlex.quote(str(folder))
                raise HostError(
                    Problem(
                        "other users can write to this cache folder and replace results that you run",
                        Location(folder),
                        f"'chmod go-w {name}' makes it private, 'chmod 2770 {name}' shares it with its group",
                    )
                )

    def _make(self, folder: Path) -> None:
        """Create a folder in the store, and its parents, with the permissions of stored files.

        The store is marked before anything else.
        """
        mark = self.folder / _MARK
        if folder != self.folder and mark not in self._checked:
            self._make(self.folder)
            if not os.path.lexists(mark):
                replace_file(mark, _TEXT, mode=self.rights & 0o666)
            self._checked.add(mark)
        try:
            folder.mkdir(mode=self.rights & 0o777)
        except FileExistsError:
            # Earlier versions created them world-readable. The store's root may serve other purposes, too.
            if folder not in self._checked and folder != self.folder and self.rights == PRIVATE:
                self._checked.add(folder)
                if stat.S_IMODE(folder.stat().st_mode) & 0o077:
                    _set_rights(folder, PRIVATE)
        except FileNotFoundError:
            if folder == self.folder:
                folder.parent.mkdir(parents=True, exist_ok=True)
            else:
                self._make(folder.parent)
            self._make(folder)
        else:
            _set_rights(folder, self.rights)

    def _path(self, kind: str, name: str) -> str:
        """Return the path of a file as a string, since this is called often."""
        return f"{self.folder}/{kind}/{name[:2]}/{name}"


def _set_rights(path: Path, rights: int) -> None:
    """Set permissions if possible: the owner may differ, or the file system may not support them."""
    with contextlib.suppress(PermissionError):
        path.chmod(rights)


def encode_result(result: ActionResult) -> bytes:
    """Return a result as JSON, as folders of this machine store it."""
    files = [(file.path, file.digest.hash, file.digest.size) for file in result.files]
    return json.dumps({"files": files, "stdout": result.stdout.decode(errors="surrogateescape")}).encode()


def decode_result(data: bytes) -> ActionResult:
    """Decode the result of `encode_result`; raises ValueError for other data."""
    try:
        value = json.loads(data)
        files = tuple(OutputFile(path, Digest(name, size)) for path, name, size in value["files"])
        stdout = value["stdout"].encode(errors="surrogateescape")
        texts = [text for file in files for text in (file.path, file.digest.hash)]
        is_valid = all(isinstance(text, str) for text in texts) and all(
            _SHA256.fullmatch(file.digest.hash) and type(file.digest.size) is int and file.digest.size >= 0
            for file in files
        )
    except (LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("it is not a result") from error
    if not is_valid:
        raise ValueError("one of its files is invalid")
    return ActionResult(files, stdout)


def sha256_of(descriptor: int) -> str:
    digest = hashlib.sha256()
    offset = 0
    while chunk := os.pread(descriptor, _CHUNK, offset):
        digest.update(chunk)
        offset += len(chunk)
    return digest.hexdigest()


def copy_bytes(source: int, target: int, size: int) -> None:
    """Copy a file between descriptors, sharing blocks if the file system supports it."""
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
def _store_faults() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise _fault(error) from None


def _fault(error: OSError) -> StoreError:
    return StoreError(f"{error.filename or 'a file'}: {error.strerror}")
