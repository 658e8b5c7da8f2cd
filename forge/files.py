"""Reading and writing files: one writer, the same bytes, nothing half-written."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


BYTECODE = "__pycache__"
_DRAFT = ".forge-draft"


@contextlib.contextmanager
def naming(path: Path) -> Iterator[None]:
    """Let an OSError say which file it is about: the system names none where a file is open already."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def replace_file(path: Path, content: bytes, *, mode: int | None = None) -> None:
    """Write `content` to `path` atomically: a reader sees the old bytes or the new, never a part.

    Folders are made as needed. A symbolic link at `path` is replaced, not followed.
    Raises OSError as the system does.
    """
    temporary = path.with_name(f".{path.name}.{os.urandom(4).hex()}{_DRAFT}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    try:
        descriptor = os.open(temporary, flags, 0o666)
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(temporary, flags, 0o666)
    try:
        with naming(path), os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            if mode is not None:
                os.fchmod(descriptor, mode)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def tree_below(root: str) -> tuple[list[tuple[str, os.stat_result]], list[str]]:
    """Return the files and links below a folder with their own stats, and the empty folders.

    What Python compiles for itself when programs run is left out. No folder, no files.
    """
    files: list[tuple[str, os.stat_result]] = []
    empty: list[str] = []
    waiting = [root]
    while waiting:
        folder = waiting.pop()
        count = len(files) + len(waiting)
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if not entry.is_dir(follow_symlinks=False):
                        files.append((entry.path, entry.stat(follow_symlinks=False)))
                    elif entry.name != BYTECODE:
                        waiting.append(entry.path)
        except (FileNotFoundError, NotADirectoryError):
            continue
        if len(files) + len(waiting) == count and folder != root:
            empty.append(folder)
    return files, empty


def remove_tree(path: str) -> None:
    """Remove a file, a link or a folder with all below it, as far as the system lets us."""
    try:
        os.unlink(path)  # noqa: PTH108
    except FileNotFoundError:
        return
    except OSError:
        with contextlib.suppress(OSError):  # it is empty
            os.rmdir(path)  # noqa: PTH106
            return
        shutil.rmtree(path, ignore_errors=True)
        if os.path.isdir(path):  # noqa: PTH112
            _make_writable(path)
            shutil.rmtree(path, ignore_errors=True)


def _make_writable(root: str) -> None:
    """Give us the right to remove what is in a folder: it may have been installed without."""
    with contextlib.suppress(OSError):
        os.chmod(root, stat.S_IRWXU)  # noqa: PTH101
    for folder, names, _ in os.walk(root):
        for path in (f"{folder}/{name}" for name in names):
            if not os.path.islink(path):  # noqa: PTH114
                with contextlib.suppress(OSError):
                    os.chmod(path, stat.S_IRWXU)  # noqa: PTH101


def remove_drafts(root: Path) -> None:
    """Remove what `replace_file` left unfinished anywhere below `root` when it was killed."""
    for folder, _, names in os.walk(root):
        for name in names:
            if name.startswith(".") and name.endswith(_DRAFT):
                with contextlib.suppress(OSError):
                    os.unlink(os.path.join(folder, name))  # noqa: PTH108, PTH118  (as os.walk says it)


def says(path: Path, text: str) -> bool:
    """Tell if there is a regular file that says just this."""
    try:
        return not path.is_symlink() and path.read_bytes() == text.encode(errors="surrogateescape")
    except OSError:
        return False


def write_if_changed(path: Path, text: str, *, mode: int | None = None) -> bool:
    """Write UTF-8 `text`, unless the file already says so; tell if it was written.

    Names of files that are no UTF-8, which Python reads as surrogates, become what they were.
    """
    content = text.encode(errors="surrogateescape")
    try:
        same = not path.is_symlink() and path.read_bytes() == content
        if same and (mode is None or path.stat().st_mode & 0o777 == mode):
            return False
    except OSError:
        pass
    replace_file(path, content, mode=mode)
    return True
