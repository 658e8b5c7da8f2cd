"""What was installed of a package before it is built anew, kept until that has gone well.

A build that fails, or is interrupted, leaves the package as it was; after a kill the next build does that
if it fails, too. What CMake code writes into an installed large file in place is beyond this.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from forge.files import replace_file
from forge.installation import markers

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.layout import Layout

_LIST = "list.json"
_SMALL = 65536
"""Bytes up to which a file is copied; larger ones are linked, which costs nothing however large they are."""


def keep(name: str, layout: Layout, files: Iterable[str]) -> None:
    """Keep the installed `files` of a package that is wholly installed, unless older ones are kept still."""
    folder = _folder(name, layout)
    marks = markers(name, layout)
    if (folder / _LIST).is_file() or not Path(marks[0]).is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = []
    for number, path in enumerate(dict.fromkeys((*files, *marks))):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            status = os.lstat(path)
            _copy(Path(path), folder / str(number), linked=status.st_size > _SMALL)
            kept.append((str(number), path, status.st_mtime_ns, status.st_size))
    replace_file(folder / _LIST, json.dumps(kept).encode())


def restore(name: str, layout: Layout) -> None:
    """Put back what was kept; a package of which something is lost is left looking as if not installed."""
    folder = _folder(name, layout)
    try:
        kept = json.loads((folder / _LIST).read_bytes())
    except (OSError, ValueError, RecursionError):
        return
    marks = frozenset(markers(name, layout))
    whole = True
    for number, path, modified, size in sorted(kept, key=lambda entry: entry[1] in marks):
        status = os.lstat(folder / number)
        if (status.st_mtime_ns, status.st_size) != (modified, size):
            whole = False  # it was linked, and written to in its place
        elif whole or path not in marks:
            _put_back(folder / number, Path(path))
    drop(name, layout)


def drop(name: str, layout: Layout) -> None:
    """Keep nothing any more."""
    shutil.rmtree(_folder(name, layout), ignore_errors=True)


def _folder(name: str, layout: Layout) -> Path:
    return layout.build / ".forge_before" / name


def _copy(source: Path, target: Path, *, linked: bool) -> None:
    if linked:
        with contextlib.suppress(OSError):  # another file system
            target.hardlink_to(source)
            return
    shutil.copy2(source, target, follow_symlinks=False)


def _put_back(kept: Path, path: Path) -> None:
    """Make a file what it was, if it is not."""
    status = kept.lstat()
    with contextlib.suppress(OSError):
        now = path.lstat()
        if now.st_ino == status.st_ino:
            return
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.forge-draft")
    draft.unlink(missing_ok=True)
    _copy(kept, draft, linked=not kept.is_symlink())
    draft.replace(path)
