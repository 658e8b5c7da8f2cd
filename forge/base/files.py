"""Reads regular files safely, and writes files atomically."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import stat
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from forge.base.errors import NotRegularFileError

BYTECODE = "__pycache__"
DRAFT = ".forge-draft"
"""The suffix of hidden files and folders that forge has begun to write."""

_CHUNK = 65536
"""Bytes read at a time."""
_MAX_LINES = 8
"""The maximum number of lines of a file name."""

_NOT_A_FILE = frozenset({errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG})
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def read_file(path: str | Path) -> bytes:
    """Return the bytes of a regular file, or of the null device; never blocks.

    Raises NotRegularFileError for other files, OSError as the system does.
    """
    # Avoid a file object, which would stat the file two more times: builds read thousands of small files.
    descriptor = open_regular(os.fspath(path), os.O_RDONLY | os.O_CLOEXEC)
    try:
        chunks = []
        while chunk := os.read(descriptor, _CHUNK):
            chunks.append(chunk)
    finally:
        os.close(descriptor)
    return b"".join(chunks)


def open_regular(path: str, flags: int) -> int:
    """Return a descriptor of a regular file, for open(); raises NotRegularFileError for other files."""

    def require_regular(status: os.stat_result) -> None:
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
        if reason := not_regular_reason(path, status):
            raise NotRegularFileError(path, reason)

    # Check before opening, because opening some devices has side effects.
    require_regular(os.stat(path))
    descriptor = os.open(path, flags | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        require_regular(os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def capabilities(path: str) -> bytes:
    """Return the capabilities of a program, as setcap sets them; b"" for none."""
    try:
        return os.getxattr(path, "security.capability", follow_symlinks=False)
    except OSError:
        return b""


def read_text(path: str | Path, errors: str = "replace") -> str:
    """Return the text of a regular file, as by `read_file`, with universal newlines."""
    text = read_file(path).decode(errors=errors)
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def text_if_exists(path: str | Path) -> str | None:
    """Return the text of a file with its newlines and with surrogate escapes, None if it is missing."""
    try:
        with open(path, encoding="utf-8", errors="surrogateescape") as stream:
            return stream.read()
    except OSError as error:
        if error.errno in _NOT_A_FILE:
            return None
        raise


def text_or_nothing(path: str | Path, errors: str = "replace") -> str:
    """Like read_text, but return an empty string if the file cannot be read."""
    try:
        return read_text(path, errors)
    except OSError:
        return ""


def read_json(path: Path) -> Mapping[str, Any]:
    """Return the JSON object in a file, or {} if it is missing or invalid."""
    try:
        status = path.stat()
        return _object(path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
    except OSError:
        return {}


@lru_cache(maxsize=8)
def _object(path: Path, *_state_of_file: int) -> Mapping[str, Any]:
    """Return the JSON object in a file; cached, because several stages of a build read the same file."""
    try:
        data = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def names_in(folder: str | Path) -> list[str]:
    """Return the sorted names in a folder; none if it cannot be read."""
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []


def current_umask() -> int:
    """Return the umask; unlike os.umask, /proc provides it without a temporary change."""
    if match := re.search(r"^Umask:\s*([0-7]+)$", text_or_nothing("/proc/self/status"), re.MULTILINE):
        return int(match[1], 8)
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def listed_paths(path: str | Path) -> Iterator[str]:
    """Yield the absolute paths in a list of installed files, one per line; none if there is no list.

    Names with a line break or, from CMake, a semicolon span several lines.
    """
    try:
        lines = read_file(path).decode(errors="surrogateescape").split("\n")
    except OSError:
        return
    starts = [at for at, line in enumerate(lines) if line.startswith("/")]
    for start, end in pairwise((*starts, len(lines))):
        # The longest existing name that the first lines form when joined.
        names = [longest := lines[start]]
        for line in lines[start + 1 : min(end, start + _MAX_LINES)]:
            names = [f"{name}{sign}{line}" for name in names for sign in "\n;"]
            longest = next(filter(os.path.lexists, names), longest)
        yield os.path.normpath(longest)


def not_regular_reason(path: str | Path, status: os.stat_result) -> str:
    """Return why a file with this stat cannot be read as text; '' if it can."""
    kind = stat.S_IFMT(status.st_mode)
    if kind == stat.S_IFREG or (kind == stat.S_IFCHR and os.path.realpath(path) == os.devnull):
        return ""
    return f"it is {_KINDS.get(kind, 'of an unknown kind')}, not a regular file"


@contextlib.contextmanager
def naming(path: Path | str) -> Iterator[None]:
    """Add the path to OSErrors that have none, as for files that are already open."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def replace_file(path: Path, content: bytes, *, mode: int | None = None) -> None:
    """Write `content` to `path` atomically, and create its folders; a link at `path` is replaced."""
    folder, name = os.path.split(path)
    temporary = os.path.join(folder, f".{name}.{os.urandom(4).hex()}{DRAFT}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    try:
        descriptor = os.open(temporary, flags, 0o666)
    except FileNotFoundError:
        os.makedirs(folder, exist_ok=True)
        descriptor = os.open(temporary, flags, 0o666)
    try:
        with naming(path), os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            if mode is not None:
                os.fchmod(descriptor, mode)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


def tree_below(root: str, device: int | None = None) -> tuple[list[tuple[str, os.stat_result]], list[str]]:
    """Return the files and links below a folder with their stats, and the empty folders; no bytecode caches.

    With a `device`, mounts and folders on other devices count as empty folders.
    """
    files: list[tuple[str, os.stat_result]] = []
    empty: list[str] = []
    waiting = [root]
    while waiting:
        folder = waiting.pop()
        count = len(files) + len(waiting) + len(empty)
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if not entry.is_dir(follow_symlinks=False):
                        files.append((entry.path, entry.stat(follow_symlinks=False)))
                    elif device is not None and (
                        entry.stat(follow_symlinks=False).st_dev != device or os.path.ismount(entry.path)
                    ):
                        empty.append(entry.path)
                    elif entry.name != BYTECODE:
                        waiting.append(entry.path)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:
            if device is None:
                raise
        if len(files) + len(waiting) + len(empty) == count and folder != root:
            empty.append(folder)
    return files, empty


def mount_points() -> Iterator[str]:
    """Yield the mount points of this process; bind mounts have the device of their parent."""
    with contextlib.suppress(OSError), open("/proc/self/mountinfo", "rb") as mounts:
        for line in mounts:
            escaped = line.split(b" ")[4]
            yield os.fsdecode(re.sub(rb"\\(\d{3})", lambda match: bytes([int(match[1], 8)]), escaped))


def mounts_below(folder: str) -> Iterator[str]:
    """Yield the mount points at or below a folder, as paths that begin with `folder` as given."""
    real = os.path.realpath(folder)
    for point in sorted(mount_points()):
        if point == real or point.startswith(f"{real.rstrip('/')}/"):
            yield folder + point[len(real) :]


def delete_tree(path: str | Path) -> None:
    """Remove a folder recursively; raises OSError if it is a link, or a file system is mounted below."""
    folder = os.fspath(path)
    if mounted := next(mounts_below(folder), None):
        raise OSError(errno.EBUSY, os.strerror(errno.EBUSY), mounted)
    if os.path.islink(folder):
        raise OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), folder)
    remove_folder(folder)


def remove_tree(path: str) -> None:
    """Remove a file, link or folder recursively, ignoring errors; keep it if something is mounted below."""
    try:
        os.unlink(path)
    except FileNotFoundError:
        return
    except OSError:
        with contextlib.suppress(OSError):  # already empty
            os.rmdir(path)
            return
        if any(mounts_below(path)):
            return
        import shutil  # takes 3 ms to import

        shutil.rmtree(path, ignore_errors=True)
        if os.path.isdir(path):  # contains folders that are not writable
            with contextlib.suppress(OSError):
                os.chmod(path, stat.S_IRWXU)
            for folder, names, _ in os.walk(path):
                for below in (f"{folder}/{name}" for name in names):
                    if not os.path.islink(below):
                        with contextlib.suppress(OSError):
                            os.chmod(below, stat.S_IRWXU)
            shutil.rmtree(path, ignore_errors=True)


def remove_drafts(root: Path) -> None:
    """Remove temporary files of an interrupted `replace_file` below `root`."""
    for folder, _, names in os.walk(root):
        for name in names:
            if name.startswith(".") and name.endswith(DRAFT):
                with contextlib.suppress(OSError):
                    os.unlink(os.path.join(folder, name))


def writable_by_others(status: os.stat_result) -> bool:
    """Return whether users other than this one and root can write; the user's own group does not count."""
    user = os.geteuid()
    if status.st_mode & stat.S_IWOTH or (status.st_uid not in {user, 0} and user != 0):
        return True
    if not status.st_mode & stat.S_IWGRP:
        return False
    import grp
    import pwd

    try:
        account, group = pwd.getpwuid(user), grp.getgrgid(status.st_gid)
    except KeyError:
        return True
    return account.pw_gid != status.st_gid or group.gr_name != account.pw_name or bool(group.gr_mem)


def has_text(path: Path, text: str) -> bool:
    """Return whether a regular file has exactly this text."""
    try:
        return not path.is_symlink() and path.read_bytes() == text.encode(errors="surrogateescape")
    except OSError:
        return False


def write_if_changed(path: Path, text: str, *, mode: int | None = None) -> bool:
    """Write UTF-8 `text` unless the file already has it; return whether it was written."""
    if has_text(path, text) and (mode is None or path.stat().st_mode & 0o777 == mode):
        return False
    replace_file(path, text.encode(errors="surrogateescape"), mode=mode)
    return True


def remove_folder(folder: str, last: str = "") -> None:
    """Remove a folder without the file systems mounted in it and the targets of links.

    The entry named `last` is removed last, and only if the folder itself can be removed. Raises OSError.
    """
    mounts = set(mounts_below(folder))
    mount_parents: set[str] = set()
    for mount in mounts:
        while mount != folder:
            mount = os.path.dirname(mount)
            mount_parents.add(mount)

    def remove(at: str, last: str = "") -> None:
        if at in mounts:
            return
        with os.scandir(at) as iterator:
            entries = sorted(iterator, key=lambda entry: entry.name == last)
        for entry in entries:
            if entry.name == last and at in mount_parents:
                return
            if entry.is_dir(follow_symlinks=False):
                remove(entry.path)
            else:
                os.unlink(entry.path)
        if at not in mount_parents:
            os.rmdir(at)

    remove(folder, last)
