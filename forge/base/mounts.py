"""Finds mount points, such as container volumes, and removes folders without what is mounted in them."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.files import mount_points

if TYPE_CHECKING:
    from collections.abc import Iterator


def mounts_below(folder: str) -> Iterator[str]:
    """Yield the mount points at or below a folder, which is spelled as the caller spells it."""
    real = os.path.realpath(folder)
    for point in sorted(mount_points()):
        if point == real or point.startswith(f"{real.rstrip('/')}/"):
            yield folder + point[len(real) :]


def remove_folder(folder: str, last: str = "") -> None:
    """Remove a folder, but neither what is mounted in it nor anything behind a link.

    The entry called `last` is the mark of the folder: it goes last, and stays if the folder stays. Raises
    OSError as the system does.
    """
    mounts = set(mounts_below(folder))
    _remove(folder, mounts, {parent for mount in mounts for parent in _parents(mount, folder)}, last)


def _remove(folder: str, mounts: set[str], above: set[str], last: str = "") -> None:
    if folder in mounts:
        return
    with os.scandir(folder) as found:
        entries = sorted(found, key=lambda entry: entry.name == last)
    for entry in entries:
        if entry.name == last and folder in above:
            return
        if entry.is_dir(follow_symlinks=False):
            _remove(entry.path, mounts, above)
        else:
            os.unlink(entry.path)
    if folder not in above:
        os.rmdir(folder)


def _parents(path: str, top: str) -> Iterator[str]:
    while path != top and path.startswith(top):
        path = os.path.dirname(path)
        yield path
