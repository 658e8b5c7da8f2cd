"""Packs an install folder into a relocatable, reproducible archive of the files needed at run time."""

from __future__ import annotations

import gzip
import os
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from forge.base.errors import Problem, WorkspaceError
from forge.base.files import text_or_nothing
from forge.base.layout import LAYOUT_MARKER

_LEFT_OUT = frozenset({"__pycache__", ".git"})
_TIME = 315532800
"""1980-01-01, the earliest time that some archivers support."""


def write_bundle(install: Path, output: Path, *, name: str, build_files: bool) -> tuple[int, int]:
    """Write the archive; return the number of files and its size in bytes.

    Links that lead out of the tree are replaced by their targets, others are kept. All files are below one
    folder with this `name`. Raises WorkspaceError for files that cannot be packed.
    """
    if not (install / LAYOUT_MARKER).is_file():
        platforms = sorted(marker.parent.name for marker in install.glob(f"*/{LAYOUT_MARKER}"))
        hint = "run 'forge build' with the same '--profile', or choose another folder with '--install-base'"
        if platforms:
            hint = f"pass the platform that it was built for: --target {' or '.join(platforms)}"
        raise WorkspaceError(Problem(f"'{install}' contains no installed packages", hint=hint))
    merged = text_or_nothing(install / LAYOUT_MARKER).strip() == "merged"
    members = [
        path
        for path in _walk(install, "")
        if build_files or not for_building(path if merged else path.partition("/")[2])
    ]
    dangling_links = [path for path in members if not (install / path).exists()]
    if dangling_links:
        hint = "the linked files no longer exist; build again"
        raise WorkspaceError(
            *(Problem(f"dangling link '{install / path}'", hint=hint) for path in dangling_links)
        )
    if not output.parent.is_dir():
        what = "is not a folder" if os.path.lexists(output.parent) else "does not exist"
        hint = "create it, or choose another file with '--output'"
        raise WorkspaceError(Problem(f"cannot write '{output}': '{output.parent}' {what}", hint=hint))
    if os.path.lexists(output) and not _is_bundle(output):
        hint = "move it away, or choose another file with '--output'"
        raise WorkspaceError(Problem(f"'{output}' exists, and was not written by forge", hint=hint))
    draft = output.with_name(f".{output.name}.{os.urandom(4).hex()}.forge-draft")
    try:
        with (
            draft.open("wb") as stream,
            gzip.GzipFile("", "wb", mtime=0, fileobj=stream) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
        ):
            for path in members:
                _add(archive, install, path, name)
        draft.replace(output)
    finally:
        draft.unlink(missing_ok=True)
    return len(members), output.stat().st_size


def _is_bundle(path: Path) -> bool:
    """Return whether a file is empty or an archive of an earlier run, with the mark of an install folder."""
    if path.is_symlink() or not path.is_file():
        return False
    try:
        with tarfile.open(path, "r:gz") as archive:
            return any(PurePosixPath(member.name).name == LAYOUT_MARKER for member in archive)
    except (OSError, tarfile.TarError, EOFError, zlib.error):
        return path.stat().st_size == 0


def for_building(path: str) -> bool:
    """Return whether only compilers and build tools need a file, given its path below a prefix."""
    parts = PurePosixPath(path).parts
    if parts[:1] == ("include",) or path.endswith((".a", ".la", ".pc")):
        return True
    return (parts[:1] in {("lib",), ("share",)} and "cmake" in parts[1:3]) or path.endswith(".cmake")


def _walk(root: Path, below: str, above: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield the files below a folder in order, relative to the root, following links to folders.

    Raises WorkspaceError for a link to an enclosing folder.
    """
    real = os.path.realpath(root / below)
    if real in above:
        hint = "remove the link, or link only to the required subfolders"
        raise WorkspaceError(Problem(f"'{root / below}' is a link to an enclosing folder", hint=hint))
    for entry in sorted(os.scandir(root / below), key=lambda entry: entry.name):
        path = f"{below}/{entry.name}" if below else entry.name
        is_folder = entry.is_dir(follow_symlinks=False)
        if not below and is_folder and Path(entry, LAYOUT_MARKER).is_file():
            continue  # the packages for another platform
        if entry.name in _LEFT_OUT:
            continue
        if entry.is_dir() and not (entry.is_symlink() and _inside(root, path)):
            yield from _walk(root, path, (*above, real))
        else:
            yield path


def _inside(root: Path, path: str) -> bool:
    """Return whether the target of a link is inside the tree, so that the link can be kept."""
    return (root / path).resolve().is_relative_to(root.resolve())


def _add(archive: tarfile.TarFile, root: Path, path: str, name: str) -> None:
    place = root / path
    member = tarfile.TarInfo(f"{name}/{path}")
    member.mtime = _TIME
    if place.is_symlink() and _inside(root, path):
        member.type = tarfile.SYMTYPE
        target = place.readlink()
        if target.is_absolute():
            target = Path(os.path.relpath(target.parent.resolve() / target.name, place.parent.resolve()))
        member.linkname = str(target)
        archive.addfile(member)
        return
    status = place.stat()
    member.size = status.st_size
    member.mode = 0o755 if status.st_mode & 0o100 else 0o644
    with place.open("rb") as stream:
        archive.addfile(member, stream)
