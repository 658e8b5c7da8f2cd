"""Back up the installed files of a package before it is rebuilt, and restore them if the build fails.

A package is always installed as if built for the first time: its build does not find earlier files, and no
stale files remain. If the build fails or is interrupted, the backup is restored; after a kill, the next
failing build restores it. In a merged prefix the files listed for the package are moved, in an isolated one
the whole prefix. Files that other packages also installed, and files outside the prefix, are copied instead
of moved.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.files import BYTECODE, remove_tree, replace_file, tree_below
from forge.base.layout import BACKUP_DIR
from forge.build.installation import package_markers

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from forge.base.layout import Layout
    from forge.build.tasks import Task

_LIST = "list.json"
_SMALL = 65536
"""The size in bytes up to which a file is copied; larger files are hard-linked in constant time."""


def back_up(name: str, layout: Layout, files: Iterable[str], shared: Collection[str] = ()) -> None:
    """Back up the installed files of a package, unless a backup of an earlier build still exists.

    `files` are the absolute paths in records and install manifests; other packages also installed the
    `shared` ones.
    """
    prefix = str(layout.prefix(name))
    files = dict.fromkeys((*files, *(package_markers(name, layout) if layout.merged else ())))
    movable = [path for path in files if path.startswith(f"{prefix}/") and path not in shared]
    staying = files.keys() - set(movable)
    if staying:
        _copy_all(_folder(name, layout, "copies"), sorted(staying))
    if layout.merged:
        _back_up_listed(name, layout, movable)
    else:
        _back_up_prefix(name, layout)


def backed_up_files(name: str, layout: Layout) -> dict[str, tuple[str, os.stat_result]]:
    """Return the path of the backup and its stat for each backed-up file, by its original path."""
    prefix, folder = layout.prefix(name), _folder(name, layout)
    cut = len(str(folder))
    found = {f"{prefix}{path[cut:]}": (path, status) for path, status in tree_below(str(folder))[0]}
    copies = _folder(name, layout, "copies")
    for number, path, *_ in _listed(copies):
        found[path] = (f"{copies}/{number}", os.lstat(copies / number))
    return found


def restore_files(name: str, layout: Layout, paths: Iterable[str]) -> None:
    """Move backed-up files to their original paths, unless these exist."""
    prefix, folder = str(layout.prefix(name)), str(_folder(name, layout))
    for path in paths:
        # Files that forge does not own must not fail the build.
        with contextlib.suppress(OSError):
            if path.startswith(f"{prefix}/") and not os.path.lexists(path):
                os.makedirs(os.path.dirname(path), exist_ok=True)  # noqa: PTH103, PTH120
                os.rename(f"{folder}{path[len(prefix) :]}", path)  # noqa: PTH104


def restore(name: str, layout: Layout) -> None:
    """Restore the backup of a package; if it is incomplete, remove the markers of the package."""
    part = _folder(name, layout, "part")
    if part.is_dir():
        _move_back(part, layout.prefix(name))
    if _folder(name, layout).is_dir():
        if layout.merged:
            _move_back(_folder(name, layout), layout.prefix(name))
        else:
            _restore_prefix(name, layout)
    if not _restore_copies(_folder(name, layout, "copies")):
        for path in package_markers(name, layout):
            remove_tree(path)
    drop(name, layout)


def drop(name: str, layout: Layout) -> None:
    """Remove the backup of a package."""
    for kind in ("", "copies"):
        _discard(_folder(name, layout, kind))


def tidy(layout: Layout) -> None:
    """Remove the backup folder if it is empty."""
    with contextlib.suppress(OSError):
        os.rmdir(layout.install / BACKUP_DIR)  # noqa: PTH106


def leftover_backups(name: str, layout: Layout) -> list[Path]:
    """Return the backup folders of a package left by a killed build."""
    folder = _folder(name, layout)
    return [path for path in (folder, *sorted(folder.parent.glob(f"{name}.*"))) if path.is_dir()]


def _folder(name: str, layout: Layout, kind: str = "") -> Path:
    """Return a backup folder of a package; package names contain no dots."""
    return layout.install / BACKUP_DIR / (f"{name}.{kind}" if kind else name)


def _back_up_prefix(name: str, layout: Layout) -> None:
    """Move a prefix to the backup; after a kill, remove the files that the killed build installed."""
    prefix, folder, part = layout.prefix(name), _folder(name, layout), _folder(name, layout, "part")
    if part.is_dir():
        _move_entries(part, prefix)
    if folder.is_dir():
        _empty(prefix, folder)
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not prefix.is_dir():
        # An empty backup means that there was no prefix before this build.
        folder.mkdir()
        return
    if not prefix.is_symlink():
        with contextlib.suppress(OSError):  # a mount
            prefix.rename(folder)
            return
    part.mkdir()
    _move_entries(prefix, part)
    part.rename(folder)


def _restore_prefix(name: str, layout: Layout) -> None:
    prefix, folder = layout.prefix(name), _folder(name, layout)
    _empty(prefix, folder)
    if not any(folder.iterdir()):
        return
    if not os.path.lexists(prefix):
        folder.rename(prefix)
        return
    _move_entries(folder, prefix)


def _empty(prefix: Path, folder: Path) -> None:
    """Remove a prefix, or its contents if it is a link or mount; ignore it if it is not a folder."""
    if prefix.is_dir() and not prefix.is_symlink():
        with contextlib.suppress(OSError):  # a mount
            _discard(prefix, folder)
    for entry in prefix.iterdir() if prefix.is_dir() else ():
        remove_tree(str(entry))


def _discard(path: Path, folder: Path | None = None) -> None:
    """Remove a folder atomically: neither a kill nor files of other users leave it partially removed.

    `folder` is the package's backup folder, if it is a different one.
    """
    with contextlib.suppress(OSError):  # missing or empty
        os.rmdir(path)  # noqa: PTH106
    if not path.is_dir():
        return
    trash = Path(f"{folder or path}.trash")
    remove_tree(str(trash))
    if trash.exists():
        trash = Path(f"{folder or path}.{os.urandom(4).hex()}.trash")
    path.rename(trash)
    remove_tree(str(trash))


def _move_entries(source: Path, target: Path) -> None:
    """Move the entries of a folder into another one, which may be on another file system.

    An entry that exists in both was being removed when forge was killed: the one in the target is complete.
    """
    target.mkdir(parents=True, exist_ok=True)
    for entry in source.iterdir():
        if os.path.lexists(target / entry.name):
            remove_tree(str(entry))
        else:
            shutil.move(entry, target / entry.name)
    with contextlib.suppress(OSError):
        source.rmdir()


def _back_up_listed(name: str, layout: Layout, paths: Iterable[str]) -> None:
    """Move files out of a merged prefix, and remove folders that become empty."""
    prefix, folder, part = layout.install, _folder(name, layout), _folder(name, layout, "part")
    if part.is_dir():
        # Killed while moving: all files are still those of the last successful build.
        _move_back(part, prefix)
    target = folder if folder.is_dir() else part
    target.mkdir(parents=True, exist_ok=True)
    emptied = set()
    for path in sorted(paths):
        aside = target / os.path.relpath(path, prefix)
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            if os.path.isdir(path) and not os.path.islink(path):  # noqa: PTH112, PTH114
                continue
            if os.path.lexists(aside):
                os.unlink(path)  # noqa: PTH108
            else:
                os.lstat(path)
                aside.parent.mkdir(parents=True, exist_ok=True)
                os.rename(path, aside)  # noqa: PTH104
            emptied.add(os.path.dirname(path))  # noqa: PTH120
    for path in sorted(emptied, reverse=True):
        _remove_empty(Path(path), prefix)
    if target is part:
        part.rename(folder)


def _remove_empty(folder: Path, root: Path) -> None:
    """Remove a folder that is empty except for bytecode, and parents that become empty."""
    while folder != root:
        try:
            if all(entry.name == BYTECODE for entry in folder.iterdir()):
                remove_tree(str(folder / BYTECODE))
            folder.rmdir()
        except OSError:
            return
        folder = folder.parent


def _move_back(source: Path, target: Path) -> None:
    """Move files to their original paths, replacing whatever was created there since."""
    for path, _ in tree_below(str(source))[0]:
        destination = target / os.path.relpath(path, source)
        for parent in reversed(destination.relative_to(target).parents[:-1]):
            if not (target / parent).is_dir():
                remove_tree(str(target / parent))
        destination.parent.mkdir(parents=True, exist_ok=True)
        if destination.is_dir() and not destination.is_symlink():
            remove_tree(str(destination))
        os.replace(path, destination)  # noqa: PTH105
    remove_tree(str(source))


def _copy_all(folder: Path, paths: Iterable[str]) -> None:
    """Copy files to the backup, unless an older backup still exists."""
    if (folder / _LIST).is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = []
    for number, path in enumerate(paths):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
            status = os.lstat(path)
            if stat.S_ISDIR(status.st_mode):
                continue  # not installed by a build: the installed file is gone
            _copy(Path(path), folder / str(number), linked=status.st_size > _SMALL)
            kept.append((str(number), path, status.st_mtime_ns, status.st_size))
    replace_file(folder / _LIST, json.dumps(kept).encode())


def blocking_paths(task: Task, layout: Layout) -> Iterator[Problem]:
    """Yield a problem for each file at the path of a required folder, and vice versa.

    CMake installs a file *into* a folder of the same name without an error.
    """
    name = task.name
    for kind, folder in (("build", task.build_dir), ("install", task.prefix)):
        if os.path.lexists(folder) and not folder.is_dir():
            hint = f"remove it, or choose another folder with '--{kind}-base'"
            yield Problem(f"the {kind} folder '{folder}' of '{name}' is a file", hint=hint)
    if not task.earlier or leftover_backups(name, layout):
        return  # the latter: a killed build may have created it
    files = {path for path in task.earlier if not path.endswith("/")}
    parents = {parent for path in files for parent in _parents(path, str(task.prefix))}
    for path in sorted(files - parents):
        if os.path.isdir(path) and not os.path.islink(path):  # noqa: PTH112, PTH114  (each installed file: no Path for each)
            hint = "move or remove it"
            yield Problem(f"'{path}', installed as a file by '{name}', is now a folder", hint=hint)
    for path in sorted(parents - files):
        if os.path.lexists(path) and not os.path.isdir(path):  # noqa: PTH112
            hint = "move or remove it"
            yield Problem(f"'{path}', where '{name}' installed files, is no longer a folder", hint=hint)


def _parents(path: str, prefix: str) -> Iterator[str]:
    """Yield the folders between a file and its prefix."""
    while (path := os.path.dirname(path)).startswith(f"{prefix}/"):  # noqa: PTH120
        yield path


def _restore_copies(folder: Path) -> bool:
    """Restore the copied files; return False if a copy is unusable."""
    complete = True
    for number, path, modified, size in _listed(folder):
        status = os.lstat(folder / number)
        if (status.st_mtime_ns, status.st_size) != (modified, size):
            complete = False  # hard-linked, and then overwritten in place
        else:
            _restore_copy(folder / number, Path(path))
    return complete


def _listed(folder: Path) -> list[tuple[str, str, int, int]]:
    try:
        return [tuple(entry) for entry in json.loads((folder / _LIST).read_bytes())]
    except (OSError, ValueError, RecursionError):
        return []


def _copy(source: Path, target: Path, *, linked: bool) -> None:
    if linked:
        with contextlib.suppress(OSError):  # another file system
            target.hardlink_to(source)
            return
    shutil.copy2(source, target, follow_symlinks=False)


def _restore_copy(kept: Path, path: Path) -> None:
    """Restore a file unless it is unchanged."""
    status = kept.lstat()
    with contextlib.suppress(OSError):
        now = path.lstat()
        if now.st_ino == status.st_ino:
            return
    # Anything else at this path was created by the failed build.
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    for folder in path.parents:
        if folder.is_dir():
            break
        folder.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.forge-draft")
    draft.unlink(missing_ok=True)
    _copy(kept, draft, linked=not kept.is_symlink())
    draft.replace(path)
