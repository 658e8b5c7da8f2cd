"""What was installed of a package before it is built anew, put aside until that has gone well.

So a package is always installed as by a first build: nothing of an earlier one is in the way, is found by
its own build, or stays behind. A build that fails, or is interrupted, puts everything back; after a kill the
next build does that if it fails, too. In a shared prefix the files move that the package's lists name, in a
prefix of its own everything does. What other packages have installed as well, and what is outside of the
prefix, stays where it is: there a copy is kept.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import Problem
from forge.files import BYTECODE, remove_tree, replace_file, tree_below
from forge.installation import markers
from forge.results import BEFORE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from forge.layout import Layout
    from forge.model import Task

_LIST = "list.json"
_SMALL = 65536
"""Bytes up to which a file is copied; larger ones are linked, which costs nothing however large they are."""


def keep(name: str, layout: Layout, files: Iterable[str], shared: Collection[str] = ()) -> None:
    """Put aside what is installed of a package, unless what an earlier build put aside is there still.

    `files` are those that records and lists name, as absolute paths; of these others have installed the
    `shared` ones as well.
    """
    prefix = str(layout.prefix(name))
    files = dict.fromkeys((*files, *(markers(name, layout) if layout.merged else ())))
    movable = [path for path in files if path.startswith(f"{prefix}/") and path not in shared]
    staying = files.keys() - set(movable)
    if staying:
        _copy_all(_folder(name, layout, "copies"), sorted(staying))
    if layout.merged:
        _keep_listed(name, layout, movable)
    else:
        _keep_prefix(name, layout)


def earlier_files(name: str, layout: Layout) -> dict[str, tuple[str, os.stat_result]]:
    """Return what was put aside: where each file is now, and its stat, by the path that it had."""
    prefix, folder = layout.prefix(name), _folder(name, layout)
    cut = len(str(folder))
    found = {f"{prefix}{path[cut:]}": (path, status) for path, status in tree_below(str(folder))[0]}
    copies = _folder(name, layout, "copies")
    for number, path, *_ in _listed(copies):
        found[path] = (f"{copies}/{number}", os.lstat(copies / number))
    return found


def bring_back(name: str, layout: Layout, paths: Iterable[str]) -> None:
    """Put files that no build had installed where they were, unless something else is there now."""
    prefix, folder = str(layout.prefix(name)), str(_folder(name, layout))
    for path in paths:
        # A file of somebody else must not fail the build.
        with contextlib.suppress(OSError):
            if path.startswith(f"{prefix}/") and not os.path.lexists(path):
                os.makedirs(os.path.dirname(path), exist_ok=True)  # noqa: PTH103, PTH120
                os.rename(f"{folder}{path[len(prefix) :]}", path)  # noqa: PTH104


def restore(name: str, layout: Layout) -> None:
    """Put back what was put aside; a package of which something is lost looks as if it was not installed."""
    part = _folder(name, layout, "part")
    if part.is_dir():
        _move_back(part, layout.prefix(name))
    if _folder(name, layout).is_dir():
        if layout.merged:
            _move_back(_folder(name, layout), layout.prefix(name))
        else:
            _restore_prefix(name, layout)
    if not _put_copies_back(_folder(name, layout, "copies")):
        for path in markers(name, layout):
            remove_tree(path)
    drop(name, layout)


def drop(name: str, layout: Layout) -> None:
    """Keep nothing any more."""
    for kind in ("", "copies"):
        _discard(_folder(name, layout, kind))


def tidy(layout: Layout) -> None:
    """Remove the folder for what is put aside, if nothing is."""
    with contextlib.suppress(OSError):
        os.rmdir(layout.install / BEFORE)  # noqa: PTH106


def put_aside(name: str, layout: Layout) -> list[Path]:
    """Return the folders with what a killed build has put aside of a package."""
    folder = _folder(name, layout)
    return [path for path in (folder, *sorted(folder.parent.glob(f"{name}.*"))) if path.is_dir()]


def _folder(name: str, layout: Layout, kind: str = "") -> Path:
    """Return a folder for a package; no package has a dot in its name."""
    return layout.install / BEFORE / (f"{name}.{kind}" if kind else name)


def _keep_prefix(name: str, layout: Layout) -> None:
    """Put a prefix aside as it stands; after a kill, remove what the killed build had installed there."""
    prefix, folder, part = layout.prefix(name), _folder(name, layout), _folder(name, layout, "part")
    if part.is_dir():
        _move_entries(part, prefix)
    if folder.is_dir():
        _empty(prefix, folder)
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not prefix.is_dir():
        # This says that whatever will be there is of this build.
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
    """Remove a prefix at once, or what is in it if that is elsewhere; what is no folder is not ours."""
    if prefix.is_dir() and not prefix.is_symlink():
        with contextlib.suppress(OSError):  # a mount
            _discard(prefix, folder)
    for entry in prefix.iterdir() if prefix.is_dir() else ():
        remove_tree(str(entry))


def _discard(path: Path, folder: Path | None = None) -> None:
    """Remove a folder at once: neither a kill nor files of other users leave a part of it in its place.

    `folder` is where the package's files are put aside, if that is another one.
    """
    with contextlib.suppress(OSError):  # it is not there, or it was empty
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
    """Move what is in a folder into another one, which may be on another file system.

    What is in both was being copied when forge was killed: then that in the target is whole.
    """
    target.mkdir(parents=True, exist_ok=True)
    for entry in source.iterdir():
        if os.path.lexists(target / entry.name):
            remove_tree(str(entry))
        else:
            shutil.move(entry, target / entry.name)
    with contextlib.suppress(OSError):
        source.rmdir()


def _keep_listed(name: str, layout: Layout, paths: Iterable[str]) -> None:
    """Move files out of a shared prefix, and remove the folders that this leaves empty."""
    prefix, folder, part = layout.install, _folder(name, layout), _folder(name, layout, "part")
    if part.is_dir():
        # Killed while it moved: all of it is as the last good build had it.
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
    """Remove a folder that holds nothing, or only bytecode of what was there, and those that this empties."""
    while folder != root:
        try:
            if all(entry.name == BYTECODE for entry in folder.iterdir()):
                remove_tree(str(folder / BYTECODE))
            folder.rmdir()
        except OSError:
            return
        folder = folder.parent


def _move_back(source: Path, target: Path) -> None:
    """Move files to where they were, and what has been made in their place since out of the way."""
    for path, _ in tree_below(str(source))[0]:
        place = target / os.path.relpath(path, source)
        for parent in reversed(place.relative_to(target).parents[:-1]):
            if not (target / parent).is_dir():
                remove_tree(str(target / parent))
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.is_dir() and not place.is_symlink():
            remove_tree(str(place))
        os.replace(path, place)  # noqa: PTH105
    remove_tree(str(source))


def _copy_all(folder: Path, paths: Iterable[str]) -> None:
    """Keep copies of files, unless older ones are kept still."""
    if (folder / _LIST).is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = []
    for number, path in enumerate(paths):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
            status = os.lstat(path)
            if stat.S_ISDIR(status.st_mode):
                continue  # put there by somebody else: what was installed is gone
            _copy(Path(path), folder / str(number), linked=status.st_size > _SMALL)
            kept.append((str(number), path, status.st_mtime_ns, status.st_size))
    replace_file(folder / _LIST, json.dumps(kept).encode())


def in_the_way(task: Task, layout: Layout) -> Iterator[Problem]:
    """Yield what somebody put where the task will need a folder, or a file.

    CMake installs a file *into* a folder of its name, and says that all is well.
    """
    name = task.name
    for word, folder in (("build", task.build_dir), ("install", task.prefix)):
        if os.path.lexists(folder) and not folder.is_dir():
            hint = f"remove it, or choose another folder with '--{word}-base'"
            yield Problem(f"the {word} folder '{folder}' of '{name}' is a file", hint=hint)
    if not task.earlier or put_aside(name, layout):
        return  # in the latter case a build was killed that may have put it there
    files = {path for path in task.earlier if not path.endswith("/")}
    parents = {parent for path in files for parent in _parents(path, str(task.prefix))}
    for path in sorted(files - parents):
        if os.path.isdir(path) and not os.path.islink(path):  # noqa: PTH112, PTH114  (each installed file: no Path for each)
            hint = "move it away, or remove it"
            yield Problem(f"'{path}', which '{name}' installed as a file, is a folder now", hint=hint)
    for path in sorted(parents - files):
        if os.path.lexists(path) and not os.path.isdir(path):  # noqa: PTH112
            hint = "move it away, or remove it"
            yield Problem(f"'{path}', in which '{name}' installed files, is no folder now", hint=hint)


def _parents(path: str, prefix: str) -> Iterator[str]:
    """Yield the folders between a file and the prefix that it is in."""
    while (path := os.path.dirname(path)).startswith(f"{prefix}/"):  # noqa: PTH120
        yield path


def _put_copies_back(folder: Path) -> bool:
    """Make files what they were; return False if one is lost."""
    whole = True
    for number, path, modified, size in _listed(folder):
        status = os.lstat(folder / number)
        if (status.st_mtime_ns, status.st_size) != (modified, size):
            whole = False  # it was linked, and written to in its place
        else:
            _put_back(folder / number, Path(path))
    return whole


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


def _put_back(kept: Path, path: Path) -> None:
    """Make a file what it was, if it is not."""
    status = kept.lstat()
    with contextlib.suppress(OSError):
        now = path.lstat()
        if now.st_ino == status.st_ino:
            return
    # Where a file was kept, what stands there now was made by the build that failed.
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
