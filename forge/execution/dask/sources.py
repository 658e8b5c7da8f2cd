"""Transfer sources to workers without shared folders: one archive for each package, named by its digest."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import shutil
import stat
import tarfile
import threading
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from forge.base.files import replace_file
from forge.build.inputs.fingerprints import source_files

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.execution.dask.model import SourceBundle

_PIECE = 4 << 20
"""The size in bytes of the pieces sent to a worker."""

_NOTE = ".forge_laid.json"
"""The file in a worker's workspace that lists its unpacked archives."""


class Unshippable(Exception):  # noqa: N818  (reported as a remark)
    """Sources cannot be transferred to a worker; the message is the reason."""


class ArchiveStore:
    """The archives of one build, created on demand; thread-safe."""

    def __init__(self, folder: Path) -> None:
        """Start empty, in a folder owned by this object."""
        self._folder = folder
        self._digests: dict[Path, str | Unshippable] = {}
        self._lock = threading.Lock()

    def digest(self, source: Path) -> str:
        """Return the digest of the archive of a package's folder; raises Unshippable."""
        with self._lock:
            if source not in self._digests:
                try:
                    self._digests[source] = self._pack(source)
                except Unshippable as reason:
                    self._digests[source] = reason
            found = self._digests[source]
        if isinstance(found, Unshippable):
            raise found
        return found

    def pieces(self, digest: str) -> Iterator[tuple[bytes, bool]]:
        """Yield the pieces of an archive, each with True if it is the last."""
        path = self._folder / digest
        remaining = path.stat().st_size
        with path.open("rb") as archive:
            while remaining > 0:
                piece = archive.read(_PIECE)
                remaining -= len(piece)
                yield piece, remaining <= 0

    def close(self) -> None:
        """Remove the archives."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _pack(self, source: Path) -> str:
        content = pack_sources(source)
        digest = hashlib.sha256(content).hexdigest()
        self._folder.mkdir(parents=True, exist_ok=True)
        (self._folder / digest).write_bytes(content)
        return digest


def pack_sources(source: Path) -> bytes:
    """Return a reproducible archive of the sources of a package."""
    archive_bytes = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=archive_bytes, mode="wb", compresslevel=1, mtime=0) as compressed,
        tarfile.open(fileobj=compressed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        links: list[str] = []
        for path in source_files(str(source)):
            if any(path.startswith(f"{link}/") for link in links):
                # It is included through the target of the link.
                continue
            status = os.lstat(path)
            if stat.S_ISLNK(status.st_mode):
                links.append(path)
            _add(archive, source, path, status)
    return archive_bytes.getvalue()


def unpack_bundle(bundle: SourceBundle) -> None:
    """Unpack these packages into the worker's workspace and remove others; unchanged ones are kept."""
    note = bundle.folder / _NOTE
    try:
        unpacked: dict[str, str] = json.loads(note.read_bytes())
    except (OSError, ValueError):
        unpacked = {}
    wanted = dict(bundle.packages)
    note.unlink(missing_ok=True)
    for folder, digest in unpacked.items():
        if wanted.get(folder) != digest:
            shutil.rmtree(bundle.folder / folder, ignore_errors=True)
    # Nested packages come after the package that contains them.
    for folder, digest in sorted(wanted.items()):
        if unpacked.get(folder) != digest or not (bundle.folder / folder).is_dir():
            _unpack(bundle.archives / digest, bundle.folder / folder)
    for name, text in bundle.texts:
        replace_file(bundle.folder / name, text.encode())
    replace_file(note, json.dumps(wanted).encode())


def _add(archive: tarfile.TarFile, source: Path, path: str, status: os.stat_result) -> None:
    """Add one file with its mode, but without owner and time."""
    entry = tarfile.TarInfo(os.path.relpath(path, source))
    entry.mode = stat.S_IMODE(status.st_mode)
    if stat.S_ISREG(status.st_mode):
        content = Path(path).read_bytes()
        entry.size = len(content)
        archive.addfile(entry, io.BytesIO(content))
    elif stat.S_ISLNK(status.st_mode):
        entry.type, entry.linkname = tarfile.SYMTYPE, str(Path(path).readlink())
        if not Path(os.path.realpath(path)).is_relative_to(source.resolve()) or entry.linkname.startswith(
            "/"
        ):
            raise Unshippable(f"'{path}' is a link that leaves the package")
        archive.addfile(entry)
    else:
        raise Unshippable(f"'{path}' is not a regular file")


def _unpack(path: Path, target: Path) -> None:
    """Unpack an archive created by `pack_sources` into a new folder."""
    target.mkdir(parents=True, exist_ok=True)
    with tarfile.open(path, "r:gz") as archive:
        for entry in archive:
            folder = target / PurePosixPath(entry.name)
            if not Path(os.path.normpath(folder)).is_relative_to(target):
                raise tarfile.TarError(f"'{entry.name}' is outside the package")
            folder.parent.mkdir(parents=True, exist_ok=True)
            if entry.issym():
                folder.symlink_to(entry.linkname)
                continue
            content = archive.extractfile(entry)
            assert content is not None  # noqa: S101  (archives contain only files and links)
            folder.write_bytes(content.read())
            folder.chmod(entry.mode)
