"""The digests of the files of each downloaded package, in a file beside its folder.

These files also mark folders that forge may remove from the cache.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from forge.base.files import replace_file, text_or_nothing


def record_path(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.json")


def write_record(folder: Path, draft: Path) -> None:
    """Record the files of `draft`, which becomes `folder`."""
    replace_file(record_path(folder), json.dumps(dict(_files(draft)), indent=0, sort_keys=True).encode())


def has_record(folder: Path) -> bool:
    return record_path(folder).is_file()


def changed_files(folder: Path) -> list[str]:
    """Return the files of a package that were changed, added or removed since it was downloaded."""
    try:
        recorded: dict[str, str] = json.loads(text_or_nothing(record_path(folder)))
    except ValueError:
        return [record_path(folder).name]
    current = dict(_files(folder))
    names = recorded.keys() | current.keys()
    return sorted(name for name in names if recorded.get(name) != current.get(name))


def _files(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the relative path and a digest of each file and link; the digest covers the executable bit."""
    for place, folders, names in os.walk(folder):
        links = [name for name in folders if Path(place, name).is_symlink()]
        for path in (Path(place, name) for name in (*names, *links)):
            status = path.lstat()
            link, mode = stat.S_ISLNK(status.st_mode), status.st_mode & 0o100
            content = os.fsencode(path.readlink()) if link else path.read_bytes()
            kind = "link" if link else f"{mode:o}"
            yield path.relative_to(folder).as_posix(), f"{kind} {hashlib.sha256(content).hexdigest()}"
