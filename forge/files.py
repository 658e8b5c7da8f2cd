"""Reading and writing files: one writer, the same bytes, nothing half-written."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from io import FileIO
    from pathlib import Path


BYTECODE = "__pycache__"
_DRAFT = ".forge-draft"

LARGEST = 16 << 20
"""How many bytes a file may have that people write and forge reads as a whole."""

_MOST_PARTS = 8

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


class UnfitFileError(OSError):
    """A file that is not read: it is no regular file, or it is too large. Names the file and the reason."""

    def __init__(self, path: str, reason: str) -> None:
        """Give `reason` in the words that follow the name of the file."""
        super().__init__(None, reason, path)


def read_file(path: str | Path, most: int = LARGEST) -> bytes:
    """Return the bytes of a regular file.

    Never waits for a writer, as for that of a named pipe, and never fills the memory. The null device reads
    as an empty file. Raises UnfitFileError for anything else that is no regular file and for one of more
    than `most` bytes, OSError as the system does.
    """
    with open(path, "rb", buffering=0, opener=open_regular) as stream:
        content = _read_up_to(stream, most + 1)
    if len(content) > most:
        raise UnfitFileError(str(path), f"it is larger than {most >> 20} MiB")
    return content


def open_regular(path: str, flags: int) -> int:
    """Return a descriptor of a regular file, for open(); raises UnfitFileError for what is none."""
    # First without opening: to open some devices does something.
    _refuse_unfit(path, os.stat(path))  # noqa: PTH116
    descriptor = os.open(path, flags | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        _refuse_unfit(path, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _refuse_unfit(path: str, status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    problem = unfit(path, status)
    if problem:
        raise UnfitFileError(str(path), problem)


def read_text(path: str | Path, most: int = LARGEST) -> str:
    """Return the text of a regular file, read as by `read_file`, its line ends as Python has them.

    What is no UTF-8 is replaced.
    """
    text = read_file(path, most).decode(errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def text_or_nothing(path: str | Path, most: int = LARGEST) -> str:
    """Return the same, or nothing where there is no file that can be read."""
    try:
        return read_text(path, most)
    except OSError:
        return ""


def listed_paths(path: str | Path) -> Iterator[str]:
    """Yield the absolute paths that a list of installed files holds, one on a line; none without a list.

    A name with a line break or, by CMake, a semicolon takes several lines: these are put together where that
    makes the name of a file.
    """
    try:
        lines = read_file(path, 1 << 30).decode(errors="surrogateescape").split("\n")
    except OSError:
        return
    starts = [at for at, line in enumerate(lines) if line.startswith("/")]
    for start, end in pairwise((*starts, len(lines))):
        yield os.path.normpath(_joined(lines[start:end]))


def _joined(parts: list[str]) -> str:
    """Return the longest name of a file that the first parts make, which were divided where it has a sign."""
    names = [parts[0]]
    found = parts[0]
    for part in parts[1:_MOST_PARTS]:
        names = [f"{name}{sign}{part}" for name in names for sign in "\n;"]
        found = next(filter(os.path.lexists, names), found)
    return found


def unfit(path: str | Path, status: os.stat_result) -> str:
    """Return why a file with this stat, links followed, cannot be read as a text; '' when it can be."""
    kind = stat.S_IFMT(status.st_mode)
    if kind == stat.S_IFREG or (kind == stat.S_IFCHR and os.path.realpath(path) == os.devnull):
        return ""
    return f"it is {_KINDS.get(kind, 'of an unknown kind')}, not a regular file"


def _read_up_to(stream: FileIO, most: int) -> bytes:
    blocks = []
    while most > 0 and (block := stream.read(min(most, 1 << 16))):
        blocks.append(block)
        most -= len(block)
    return b"".join(blocks)


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
