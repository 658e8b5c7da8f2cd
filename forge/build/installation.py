"""Install the files of packages, their hooks and indexes, and the workspace's scripts."""

from __future__ import annotations

import contextlib
import json
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.ament_index import INDEX
from forge.base.errors import WorkspaceError, raise_if_any
from forge.base.files import (
    BYTECODE,
    current_umask,
    has_text,
    read_file,
    replace_file,
    tree_below,
    write_if_changed,
)
from forge.base.frozen import frozen
from forge.base.layout import INSTALL_STATE_FILE, Layout
from forge.build.build_types import build_type_of
from forge.build.copies import is_folder
from forge.build.file_conflicts import owned_by_others
from forge.build.inputs.fingerprints import FileTable, content_digest
from forge.build.installed_lists import listed_files, package_markers
from forge.build.prefix import PrefixExchange, remove_empty_folders
from forge.environment import scripts
from forge.environment.dsv import PackageEdits
from forge.environment.hooks import package_hooks
from forge.environment.install_state import recorded_state, recorded_underlays
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS
from forge.environment.sourcing import own_edits, package_edits, packages_in_order
from forge.workspace.model import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from forge.build.model import BuildRecord
    from forge.build.tasks import Task
    from forge.toolchain.interpreter import Interpreter
    from forge.workspace.model import Package

_SETUP_EXTENSIONS = ("bash", "dsv", "sh", "zsh")


def install_package(
    package: Package,
    layout: Layout,
    run_dependencies: tuple[str, ...],
    python: Interpreter,
    installed: Collection[str] | None = None,
    exchange: PrefixExchange | None = None,
) -> tuple[str, ...]:
    """Finish a package's prefix after its own install step: implicit files, hooks, scripts, index.

    `installed` are the absolute paths of its files (default: `installed_files`), `exchange` is the build's.
    Returns the files that forge itself installed. Raises WorkspaceError if an unowned file is in their place.
    """
    prefix = layout.prefix(package.name)
    exchange = exchange or PrefixExchange(package.name, layout)
    paths = installed_files(package, layout, exchange).files if installed is None else installed
    skip = len(f"{prefix}/")
    files = frozenset(path[skip:] for path in paths if path.startswith(f"{prefix}/"))
    share = prefix / "share" / package.name
    implicit = (prefix / INDEX / "packages" / package.name, share / "package.xml")
    scripts_of_it = (share / f"package.{extension}" for extension in ("dsv", *SHELLS))
    marker = prefix / PACKAGES / package.name
    # CMake packages add themselves to the ament index, or deliberately do not.
    is_registered = package.ros and package.build_type not in {*CMAKE_TYPES, "python"}
    hooks = package_hooks(package.name, files, python.site_packages, ament=is_registered)
    hook_files = (share / "hook" / f"{name}.dsv" for name in hooks)
    own = (*map(str, (*scripts_of_it, *hook_files, marker, *(implicit if is_registered else ()))),)
    raise_if_any(exchange.in_the_way(own), WorkspaceError)
    exchange.announce(own)
    mode = 0o666 & ~current_umask()
    if is_registered:
        _write_implicit(package, prefix, files, symlink=layout.symlink)
    for name, line in hooks.items():
        write_if_changed(share / "hook" / f"{name}.dsv", scripts.render_dsv([line]), mode=mode)
    sources = [f"share/{package.name}/hook/{name}.dsv" for name in hooks]
    setups = (f"share/{package.name}/local_setup.{extension}" for extension in _SETUP_EXTENSIONS)
    sources += (path for path in (*setups, *package.hooks) if (prefix / path).is_file())
    # Always write a new file: its stamp indicates that some of the package's hooks may have changed.
    script, text = share / "package.dsv", scripts.render_dsv([f"source;{path}" for path in sources])
    before = os.stat(script) if has_text(script, text) else None
    replace_file(script, text.encode())
    if before:
        os.utime(script, ns=(before.st_atime_ns, before.st_mtime_ns))
    edits = own_edits(package.name, prefix, files) if layout.merged else package_edits(package.name, prefix)
    for shell in SHELLS:
        text = scripts.package_setup(shell, prefix, PackageEdits(package.name, "", edits))
        write_if_changed(share / f"package.{shell}", text, mode=mode)
    write_if_changed(marker, os.pathsep.join(sorted(set(run_dependencies))), mode=mode)
    return own


@frozen
class InstalledFiles:
    """The files that a build installed, as sorted absolute paths; those of empty folders end with '/'.

    It is unknown whether the package or another program has written the `unclaimed` files.
    """

    files: tuple[str, ...]
    folders: tuple[str, ...] = ()
    unclaimed: frozenset[str] = frozenset()
    written: frozenset[str] | None = None
    """The files that may differ from the last build; None if all may."""


def installed_files(
    package: Package, layout: Layout, exchange: PrefixExchange, earlier: Collection[str] = ()
) -> InstalledFiles:
    """Return the files that the steps of a package have just installed.

    These are the files in install manifests, and files and folders that its steps were observed to write. If
    some process could not be observed, all files that appeared in an isolated prefix during the build count,
    and so do `earlier` ones. Raises WorkspaceError if the package has overwritten an unowned file.
    """
    name, prefix = package.name, layout.prefix(package.name)
    build = layout.build_dir(name)
    below = f"{prefix}/"
    listed = {*listed_files(build)}
    raise_if_any((*exchange.overwritten(listed), *exchange.folders_of_others(listed)), WorkspaceError)
    # A listed file may be missing: the package's own code can remove files that CMake installed.
    others, writes = exchange.others(), exchange.writes()
    installed = {path for path in listed if os.path.lexists(path) and not is_folder(path)}
    folders = set[str]()
    for path in writes.files | writes.folders:
        hidden = BYTECODE in path or path.startswith(f"{below}.forge")
        if hidden or not path.startswith(below) or not os.path.lexists(path):
            continue
        if not is_folder(path):
            installed.add(path)
        elif path not in others and not os.listdir(path):
            folders.add(f"{path}/")
    raise_if_any(exchange.overwritten(installed), WorkspaceError)
    unclaimed = frozenset[str]()
    if not (layout.merged or writes.complete or build_type_of(package).staged):
        earlier = {*earlier, *exchange.unclaimed()}
        files, empty = tree_below(str(prefix))
        rest = {path for path, _ in files} - installed
        unclaimed = frozenset(path for path in rest if path not in others or path in earlier)
        folders.update(f"{path}/" for path in empty if path not in others)
    return InstalledFiles(tuple(sorted(installed | unclaimed)), tuple(sorted(folders)), unclaimed)


def uninstall_markers(name: str, layout: Layout) -> None:
    for path in package_markers(name, layout):
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)


def finish_workspace(
    layout: Layout,
    underlays: tuple[Path, ...],
    python: Path,
    rosdistro: str | None = None,
    *,
    unchanged: bool = False,
) -> tuple[Path, ...]:
    """Write the scripts of the install root; return the underlays that they source, lowest first.

    Underlays of earlier builds are kept even if they are not sourced this time; without `rosdistro`, so is
    the recorded ROS distribution. If `unchanged`, no package has changed its contribution to the scripts,
    which are kept unless underlays or interpreter changed. Raises WorkspaceError for an invalid dsv file.
    """
    root, chain = layout.install, underlays
    recorded = recorded_underlays(root)
    if not {path.resolve() for path in recorded} <= {path.resolve() for path in underlays}:
        joined: dict[Path, Path] = {}
        for path in (*recorded, *underlays):
            joined.setdefault(path.resolve(), path)
        chain = tuple(joined.values())
    state = {
        "version": 1,
        "python": str(python),
        "underlays": [str(path) for path in chain],
        "rosdistro": rosdistro or recorded_state(root).rosdistro,
        **({"profile": layout.profile, "root": os.path.relpath(layout.root, root)} if layout.profile else {}),
    }
    state_changed = write_if_changed(root / INSTALL_STATE_FILE, json.dumps(state, indent=2) + "\n")
    if unchanged and not state_changed:
        return chain
    packages = packages_in_order(root)
    for shell in SHELLS:
        write_if_changed(root / f"local_setup.{shell}", scripts.local_setup(shell, root, packages))
        # Another tool may have written scripts for some shells only.
        own, plain = f"local_setup.{shell}", "local_setup.sh"
        below = [
            path / (plain if (path / plain).exists() and not (path / own).exists() else own) for path in chain
        ]
        write_if_changed(root / f"setup.{shell}", scripts.setup(shell, root, below))
    return chain


def _write_implicit(package: Package, prefix: Path, installed: Collection[str], *, symlink: bool) -> None:
    """Write the index marker and package.xml of a package unless its own build installs them."""
    marker, manifest = f"{INDEX}/packages/{package.name}", f"share/{package.name}/package.xml"
    if marker not in installed and not has_text(prefix / marker, ""):
        replace_file(prefix / marker, b"")
    path, source = prefix / manifest, package.manifest.path.absolute()
    if manifest in installed or (symlink and path.is_symlink() and path.readlink() == source):
        return
    if symlink:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f".{path.name}.forge-draft")
        draft.unlink(missing_ok=True)
        draft.symlink_to(source)
        draft.replace(path)
    elif path.is_symlink() or not path.is_file() or read_file(path) != read_file(source):
        replace_file(path, read_file(source))


def set_file_times(
    exchange: PrefixExchange, files: tuple[str, ...], table: FileTable, *, restored: bool = False
) -> None:
    """Restore the times of unchanged installed files, and set a new time on changed ones.

    Build tools only compare times: users of an unchanged header must not be recompiled. CMake truncates
    copied times to seconds, so a header that changed soon after a compilation would look older than the
    object. Files `restored` from the cache have new times. The package's own script gets its time last: later
    files were not installed by a build.
    """
    before, marker = exchange.moved_files(), exchange.markers[0]
    dated = () if restored and not before else files
    for path in (*(path for path in dated if path != marker), marker):
        with contextlib.suppress(FileNotFoundError):  # listed, but removed by the package's own code
            status = os.lstat(path)
            if stat.S_ISREG(status.st_mode):
                digest = table.digest(path, status)
                backup, then = before.get(path, ("", status))
                is_alike = backup and (status.st_size, status.st_mode) == (then.st_size, then.st_mode)
                if is_alike and content_digest(backup) == digest:
                    os.utime(path, ns=(status.st_atime_ns, then.st_mtime_ns))
                elif not restored or path == marker:
                    os.utime(path)
                table.learn(path, os.lstat(path), digest)


def remove_stale(
    task: Task,
    files: tuple[str, ...],
    layout: Layout,
    exchange: PrefixExchange,
    records: Mapping[str, BuildRecord],
) -> None:
    """Remove files that a package no longer installs, unless another package does.

    Those in its own prefix were moved aside before the build: any file there now is another's or unowned.
    """
    stale = exchange.copied_files().intersection(task.earlier).difference(files)
    left = frozenset(path for path in stale if os.path.islink(path) or os.path.isfile(path))
    if not left:
        return
    for path in sorted(left - owned_by_others(task.name, left, records), reverse=True):
        if Path(path).is_relative_to(layout.install):
            os.unlink(path)
            remove_empty_folders(path, str(layout.install))
