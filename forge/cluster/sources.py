"""Sources on their way to workers that do not see our folders: an archive for each package, by its digest."""

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

from forge.digests import source_files
from forge.files import replace_file

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.cluster.model import Parcel

_PIECE = 4 << 20
"""Bytes that go to a worker at a time."""

_NOTE = ".forge_laid.json"
"""The file in a worker's workspace that says which archives lie in it."""


class Unshippable(Exception):  # noqa: N818  (it is told, and ends nothing)
    """Sources cannot be taken elsewhere as they are; the message says why."""


class Stock:
    """The archives of one build, each made when it is first asked for; threads share it."""

    def __init__(self, folder: Path) -> None:
        """Begin empty, in a folder of our own."""
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
        """Yield an archive piece by piece, each with whether it is the last."""
        path = self._folder / digest
        left = path.stat().st_size
        with path.open("rb") as archive:
            while left > 0:
                piece = archive.read(_PIECE)
                left -= len(piece)
                yield piece, left <= 0

    def close(self) -> None:
        """Remove the archives."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _pack(self, source: Path) -> str:
        content = packed(source)
        digest = hashlib.sha256(content).hexdigest()
        self._folder.mkdir(parents=True, exist_ok=True)
        (self._folder / digest).write_bytes(content)
        return digest


def packed(source: Path) -> bytes:
    """Return an archive of what counts as sources of a package: the same bytes for the same sources."""
    whole = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=whole, mode="wb", compresslevel=1, mtime=0) as squeezed,
        tarfile.open(fileobj=squeezed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        links: list[str] = []
        for path in source_files(str(source)):
            if any(path.startswith(f"{link}/") for link in links):
                # It comes with what the link leads to.
                continue
            status = os.lstat(path)
            if stat.S_ISLNK(status.st_mode):
                links.append(path)
            _add(archive, source, path, status)
    return whole.getvalue()


def lay_out(parcel: Parcel) -> None:
    """Make the worker's workspace hold these packages and no others; what is as it was is left alone."""
    note = parcel.folder / _NOTE
    try:
        laid: dict[str, str] = json.loads(note.read_bytes())
    except (OSError, ValueError):
        laid = {}
    wanted = dict(parcel.packages)
    note.unlink(missing_ok=True)
    for place, digest in laid.items():
        if wanted.get(place) != digest:
            shutil.rmtree(parcel.folder / place, ignore_errors=True)
    # What lies in another package's folder comes after it.
    for place, digest in sorted(wanted.items()):
        if laid.get(place) != digest or not (parcel.folder / place).is_dir():
            _unpack(parcel.archives / digest, parcel.folder / place)
    for name, text in parcel.texts:
        replace_file(parcel.folder / name, text.encode())
    replace_file(note, json.dumps(wanted).encode())


def _add(archive: tarfile.TarFile, source: Path, path: str, status: os.stat_result) -> None:
    """Add one file with its rights, and nothing of who owns it and when it was made."""
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
            raise Unshippable(f"'{path}' links to what is not part of the package")
        archive.addfile(entry)
    else:
        raise Unshippable(f"'{path}' is no file")


def _unpack(path: Path, target: Path) -> None:
    """Write an archive that `packed` made into a new folder."""
    target.mkdir(parents=True, exist_ok=True)
    with tarfile.open(path, "r:gz") as archive:
        for entry in archive:
            place = target / PurePosixPath(entry.name)
            if not Path(os.path.normpath(place)).is_relative_to(target):
                raise tarfile.TarError(f"'{entry.name}' lies outside")
            place.parent.mkdir(parents=True, exist_ok=True)
            if entry.issym():
                place.symlink_to(entry.linkname)
                continue
            content = archive.extractfile(entry)
            assert content is not None  # noqa: S101  (there are files and links alone)
            place.write_bytes(content.read())
            place.chmod(entry.mode)
