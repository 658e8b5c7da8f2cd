"""Reinstall a package into a stage, from where changed files are renamed into the prefix.

Until its steps have succeeded, the prefix is unchanged and can be used. The steps find an empty stage in its
place, as if the package was built for the first time: the library of forge.engine redirects each path below
the prefix to it. Then each changed file is renamed into place; unchanged files are not touched. After a kill,
every file comes from the last build or the new one, and the next build completes the rest.

A step that uses the prefix nevertheless needs the new files in place. Then all files are exchanged by
forge.build.prefix, as they are without the library.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.errors import Problem
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.files import (
    BYTECODE,
    DRAFT,
    capabilities,
    listed_paths,
    read_json,
    remove_tree,
    replace_file,
    tree_below,
)
from forge.base.layout import INSTALLED_STATES_DIR, SCRATCH_DIR, Layout
from forge.base.text import digest
from forge.build.copies import is_folder, is_same_file, status_of
from forge.build.installation import InstalledFiles
from forge.build.installed_lists import (
    MANIFESTS,
    InstalledList,
    add_files,
    edited,
    folders_above,
    identity_now,
    listed_files,
    read_installed_list,
)
from forge.build.observed_writes import ObservedSteps, begin_log, remove_log
from forge.build.prefix import (
    guarded_links,
    leftover_backups,
    make_writable,
    remove_empty_folders,
    stage_folder,
    written_log,
)
from forge.build.tasks import Step, StepKind, Task

_NEXT = "install_next.json"
"""The notes of the running install step."""
_CHANGED = "install_changed.cmake"
_FOUND = frozenset("RYTLWDUX")
"""The kinds of records of existing paths."""
_OF_STAGING = frozenset({".links", ".notes", ".stage", ".written"})
"""Leftovers of a killed build that had a stage."""


# Around the steps


def staged(task: Task, layout: Layout, shared: Collection[str]) -> Task:
    """Return the task with a stage, if the installed files are known and belong only to the package.

    Other packages have installed the `shared` files as well.
    """
    notes, listed = read_json(_notes_file(task.build_dir)), read_installed_list(task.name, layout)
    if shared or not notes.keys() >= {"scripts", "files", "folders"} or not task.prefix.is_dir():
        return task
    if listed is None or listed.unclaimed:
        return task
    if not task.intact:
        forget_sources(task)
    if any(path.suffix not in _OF_STAGING for path in leftover_backups(task.name, layout)):
        return task
    stage = stage_folder(task.name, layout)
    steps = (replace(step, stage=stage) if step.kind is StepKind.INSTALL else step for step in task.steps)
    return replace(task, stage=stage, steps=tuple(steps))


def forget_sources(task: Task) -> None:
    """Make the next build install everything, because the installed files come from elsewhere."""
    notes = _notes_file(task.build_dir)
    if data := read_json(notes):
        replace_file(notes, json.dumps({**data, "sources": None}).encode())


def keep_linked(task: Task, layout: Layout, removed: Collection[str] | None) -> None:
    """Copy files of the build folder that installed links lead to and that are to be `removed` (None: all).

    Otherwise the last build could not be used until this one succeeds, or at all if it fails.
    """
    listed = read_installed_list(task.name, layout) or InstalledList({})
    below = f"-> {task.build_dir}/"
    kept: dict[str, str] = {}
    for path, identity in listed.files.items():
        target = identity.removeprefix("-> ")
        if not identity.startswith(below) or (removed is not None and target not in removed):
            continue
        folder, _, name = path.rpartition("/")
        draft = f"{folder}/.{name[:200]}{DRAFT}"
        with contextlib.suppress(OSError):
            if os.readlink(path) == target and stat.S_ISREG(os.lstat(target).st_mode):
                Path(draft).unlink(missing_ok=True)
                try:
                    os.link(target, draft)
                except OSError:  # perhaps on another file system
                    shutil.copy2(target, draft)
                os.replace(draft, path)
                kept[path] = identity_now(path)
    if kept:
        add_files(task.name, layout, kept)
        forget_sources(task)


def begin(task: Task, layout: Layout) -> None:
    """Redirect the steps to the stage instead of the prefix."""
    remove_tree(str(task.stage))
    begin_log(written_log(task.name, layout))
    words: list[str] = [*dict.fromkeys((str(task.prefix), os.path.realpath(task.prefix)))]
    if layout.merged:
        skip = len(str(task.prefix)) + 1
        words += ("", *sorted((path[skip:] for path in _own_entries(task, layout)), key=os.fsencode))
    guarded_links(task.name, layout).write_bytes(b"".join(b"%s\0" % os.fsencode(word) for word in words))


def _own_entries(task: Task, layout: Layout) -> set[str]:
    """Return the files of a package, and the folders that contain nothing else."""
    listed = read_installed_list(task.name, layout) or InstalledList({})
    own = {*listed.files, *(folder.rstrip("/") for folder in listed.folders)}
    above = {folder for path in own for folder in folders_above(path, str(task.prefix))}
    for folder in sorted(above, key=len, reverse=True):  # the innermost first
        with contextlib.suppress(OSError), os.scandir(folder) as entries:
            if all(entry.path in own or entry.name == BYTECODE for entry in entries):
                own.add(folder)
    return own


def end(task: Task, layout: Layout) -> None:
    """Remove the stage; the prefix is unchanged."""
    remove_tree(str(task.stage))
    remove_log(written_log(task.name, layout))
    guarded_links(task.name, layout).unlink(missing_ok=True)


def in_place(task: Task, layout: Layout, steps: ObservedSteps, failed: Step | None) -> Task | None:
    """Return the task as it has to run again in place, or None if the stage is complete.

    It runs again if it may have used the prefix itself, or if its files do not fit into the prefix. Later
    builds with the same install scripts then run in place from the start.
    """
    own = tuple(f"{path}/" for path in {str(task.prefix), os.path.realpath(task.prefix)})
    roots = [each for each in steps.observed.processes if steps.kinds.get(each.pid) == StepKind.INSTALL.value]
    installing = {process.pid for root in roots for process in root.family()}
    following = read_json(task.build_dir / SCRATCH_DIR / _NEXT)
    records = [
        (process.pid in installing, kind, path)
        for process in steps.observed.processes
        for _, kind, path in process.records
    ]
    # The next build does not rewrite files that an earlier step wrote there.
    using = frozenset("WDU") if layout.merged else _FOUND
    uses = any(
        kind == "B" or (kind in using and f"{path}/".startswith(own))
        for is_installing, kind, path in records
        if not is_installing
    )
    if failed:
        # A step that fails in a stage may succeed in the prefix.
        fits = failed.kind is not StepKind.INSTALL or not following.get("code")
        fits &= all(kind != "B" for _, kind, _ in records)
    else:
        uses |= bool(steps.observed.blind)
        fits = steps.complete and _fits(task, layout, has_code=following.get("code", True))
    if fits and not uses:
        return None
    notes = json.dumps({"in place": following.get("scripts")})
    replace_file(_notes_file(task.build_dir), notes.encode())
    plain = tuple(replace(step, stage=None) for step in task.steps)
    if uses or (failed and failed.kind is not StepKind.INSTALL) or len(plain) == 1:
        return replace(task, stage=None, from_empty=True, steps=plain)
    last = tuple(step for step in plain if step.kind is StepKind.INSTALL)
    return replace(task, stage=None, prepared=True, steps=last)


def _fits(task: Task, layout: Layout, *, has_code: bool) -> bool:
    """Return whether the staged files can replace those of the last build, and none names the stage."""
    listed = read_installed_list(task.name, layout)
    stage = str(task.stage)
    files, folders = tree_below(stage)
    for path in listed_files(task.build_dir):
        # If the target is a folder, CMake installs the file into it.
        if not path.startswith((f"{task.prefix}/", f"{stage}/")) or is_folder(path):
            return False
    for path, status in files:
        target = _target(task, path)
        is_foreign = os.path.lexists(target) and (listed is None or target not in listed.files)
        if is_foreign or is_folder(target):
            return False
        is_new = stat.S_ISREG(status.st_mode) and not _is_same(path, target)
        if is_new and os.fsencode(stage) in Path(path).read_bytes():
            return False
        if has_code and stat.S_ISLNK(status.st_mode):
            # Such a link may have been followed to a file of the last build.
            leads_to = os.path.normpath(os.path.join(os.path.dirname(target), os.readlink(path)))
            is_inside = f"{leads_to}/".startswith(f"{task.prefix}/")
            if os.readlink(path).startswith("/") and is_inside:
                return False
            if not os.readlink(path).startswith("/") and not (
                is_inside and os.path.lexists(f"{stage}{leads_to[len(str(task.prefix)) :]}")
            ):
                return False
    return all(is_folder(target) or not os.path.lexists(target) for target in _folders(task, files, folders))


# The install step


def next_install(step: Step, task: Task) -> Step:
    """Return the install step to run, and note the sources that it installs.

    In a stage, it installs only what changed since the last build if this can be derived from CMake's
    scripts, else everything.
    """
    scratch, notes = task.build_dir / SCRATCH_DIR, read_json(_notes_file(task.build_dir))
    now: dict[str, Any] = {"scripts": digest("", *map("=".join, step.env)), "code": not step.prefix}
    code = None
    if step.argv[1:2] == ("--install",) and (plugin := own_plugin(OPTIONS, "partial-install")):
        now, code = plugin.partial_install(task.build_dir, step.env, notes if step.stage else {})
    scratch.mkdir(parents=True, exist_ok=True)
    replace_file(scratch / _NEXT, json.dumps({**now, "partial": code is not None}).encode())
    if step.stage and step.prefix:
        words = (str(step.stage) if word == str(step.prefix) else word for word in step.argv)
        return replace(step, argv=tuple(words))
    if code is None:
        return step
    replace_file(scratch / _CHANGED, code.encode(errors="surrogateescape"))
    argv = (step.argv[0], f"-DCMAKE_INSTALL_PREFIX={task.prefix}", "-P", str(scratch / _CHANGED))
    return replace(step, argv=argv)


# After the steps


def commit(task: Task, layout: Layout) -> tuple[InstalledFiles, tuple[Problem, ...]]:
    """Rename the changed files of the stage into the prefix, and remove files that are no longer installed.

    Return all files that the steps have installed, and a problem for each edited file that is kept.
    """
    os.makedirs(str(task.stage), exist_ok=True)
    files, empty = tree_below(str(task.stage))
    notes = read_json(_notes_file(task.build_dir))
    before, folders_before = (
        frozenset(f"{task.prefix}/{path}" for path in notes[key]) for key in ("files", "folders")
    )
    now = frozenset(_target(task, path) for path, _ in files)
    stale = frozenset[str]()
    if read_json(task.build_dir / SCRATCH_DIR / _NEXT)["partial"]:
        written = now.union(f"{folder}/" for folder in _folders(task, files, empty))
        installed = InstalledFiles(tuple(sorted(before)), tuple(sorted(folders_before)), written=written)
    else:
        folders = frozenset(f"{_target(task, path)}/" for path in empty)
        if layout.merged:  # the others existed before
            own = {f"{path}/" for path in _own_entries(task, layout)}
            folders = frozenset(path for path in folders if path in own or not os.path.isdir(path))
        stale = (before | folders_before) - now - folders
        installed = InstalledFiles(tuple(sorted(now)), tuple(sorted(folders)))
    changing = (folder for path in stale | now for folder in folders_above(path, str(task.prefix)))
    modes = make_writable(changing)
    problems = remove_stale(task, layout, stale) if stale else ()
    # After a kill, new files are known to belong to the package.
    listed = read_installed_list(task.name, layout) or InstalledList({})
    targets = {_target(task, path): path for path, _ in files}
    new = {target: identity_now(path) for target, path in targets.items() if target not in listed.files}
    if new:
        add_files(task.name, layout, new)
    for folder in _folders(task, files, empty):
        source = f"{task.stage}{folder[len(str(task.prefix)) :]}"
        modes[folder] = mode = stat.S_IMODE(os.lstat(source).st_mode)
        if mode & stat.S_IRWXU != stat.S_IRWXU:
            os.chmod(source, stat.S_IRWXU)
        os.makedirs(folder, exist_ok=True)
    for path, status in files:
        target = _target(task, path)
        if not _is_same(path, target):
            if stat.S_ISREG(status.st_mode):
                os.utime(path)
            os.replace(path, target)
    for folder, mode in modes.items():
        folder_status = status_of(folder)
        if folder_status and stat.S_IMODE(folder_status.st_mode) != mode:
            os.chmod(folder, mode)
    for name in MANIFESTS:
        manifest = task.build_dir / name
        if manifest.is_file():
            lines = "\n".join(_target(task, path) for path in listed_paths(manifest))
            replace_file(manifest, lines.encode(errors="surrogateescape"))
    return installed, problems


def remove_stale(
    task: Task, layout: Layout, stale: Iterable[str], folders: Collection[str] = ()
) -> tuple[Problem, ...]:
    """Remove files of the package and its empty folders (paths that end with '/'), except for `folders`.

    Return a problem for each edited file, which is kept.
    """
    listed = read_installed_list(task.name, layout) or InstalledList({})
    own = {folder.rstrip("/") for folder in folders}
    problems = []
    for path in sorted(stale, reverse=True):
        if path.endswith("/"):
            remove_empty_folders(f"{path}x", str(task.prefix), own)
        elif path not in listed.files or not os.path.lexists(path):
            continue
        elif identity_now(path) == listed.files[path]:
            os.unlink(path)
            remove_empty_folders(path, str(task.prefix), own)
        else:
            problems.append(edited(path, task.name))
    return tuple(problems)


def remove_other_stale(task: Task, layout: Layout, installed: InstalledFiles) -> tuple[Problem, ...]:
    listed = read_installed_list(task.name, layout) or InstalledList({})
    stale = listed.files.keys() - listed.unclaimed - {*installed.files}
    return remove_stale(task, layout, stale, installed.folders)


def note_installed(task: Task, installed: InstalledFiles, *, observed: bool) -> None:
    """Record the files that the install step installed, and their sources, for the next build.

    After incompletely observed steps, it does not run in a stage.
    """
    following, notes = task.build_dir / SCRATCH_DIR / _NEXT, _notes_file(task.build_dir)
    data = read_json(following)
    below = f"{task.prefix}/"
    if data and data["scripts"] == read_json(notes).get("in place"):
        return
    is_known = observed and bool(data) and not installed.unclaimed
    if not is_known or not all(path.startswith(below) for path in installed.files):
        notes.unlink(missing_ok=True)
        return
    paths = {"files": installed.files, "folders": installed.folders}
    relative = {key: [path.removeprefix(below) for path in entries] for key, entries in paths.items()}
    notes.parent.mkdir(parents=True, exist_ok=True)
    replace_file(notes, json.dumps({**data, **relative}).encode())
    following.unlink(missing_ok=True)


def _notes_file(build: Path) -> Path:
    return build.parent / INSTALLED_STATES_DIR / build.name / "install_step"


def _target(task: Task, path: str) -> str:
    """Return the final path of a staged file; other paths are returned unchanged."""
    below = f"{task.stage}/"
    return f"{task.prefix}/{path[len(below) :]}" if path.startswith(below) else path


def _folders(task: Task, files: Iterable[tuple[str, os.stat_result]], empty: Iterable[str]) -> list[str]:
    """Return the folders of the prefix with staged entries, parents first."""
    stage = str(task.stage)
    folders = {stage, *empty}
    for path in (*(path for path, _ in files), *empty):
        while (path := os.path.dirname(path)) not in folders:
            folders.add(path)
    return sorted(_target(task, f"{path}/").rstrip("/") for path in folders)


def _is_same(path: str, other: str) -> bool:
    """Return whether two files have equal content, mode, owner and capabilities, or two links one target."""
    one, two = os.lstat(path), status_of(other)
    if two is None or (one.st_mode, one.st_uid, one.st_gid) != (two.st_mode, two.st_uid, two.st_gid):
        return False
    is_link = stat.S_ISLNK(one.st_mode)
    return is_same_file(path, Path(other)) and (is_link or capabilities(path) == capabilities(other))
