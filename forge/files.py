"""Reading and writing files: one writer, the same bytes, nothing half-written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def replace_file(path: Path, content: bytes, *, mode: int | None = None) -> None:
    """Write `content` to `path` atomically: a reader sees the old bytes or the new, never a part.

    Folders are made as needed. A symbolic link at `path` is replaced, not followed.
    Raises OSError as the system does.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
        Path(temporary).chmod(mode if mode is not None else 0o666 & ~_umask())
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_if_changed(path: Path, text: str, *, mode: int | None = None) -> bool:
    """Write UTF-8 `text`, unless the file already says so; tell if it was written."""
    content = text.encode()
    try:
        same = not path.is_symlink() and path.read_bytes() == content
        if same and (mode is None or path.stat().st_mode & 0o777 == mode):
            return False
    except OSError:
        pass
    replace_file(path, content, mode=mode)
    return True


def _umask() -> int:
    """Return the process's umask; reading it means setting it."""
    current = os.umask(0o022)
    os.umask(current)
    return current
