"""Read and write the lists of files that forge has installed for each package: it removes only these.

Without them, for example after a build with colcon, the install manifests in build folders list the files.
The files of the last few states remain known, so that dependents can compare them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.ament_index import INDEX
from forge.base.errors import Problem
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.files import listed_paths, read_json, replace_file
from forge.base.frozen import frozen
from forge.base.layout import INSTALLED_LISTS_DIR, INSTALLED_STATES_DIR, LAYOUT_MARKER, Layout
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS

if TYPE_CHECKING:
    from forge.build.inputs.fingerprints import Changes

_VERSION = 1
STATES_PER_PACKAGE = 8
"""Dependents may have been built with different states."""
MANIFESTS = ("install_manifest.txt", "symlink_install_manifest.txt")
"""The files in which CMake, ament and forge list installed files."""


@frozen
class InstalledList:
    """The files that forge installed for a package: their contents by absolute path, and empty folders.

    `links` are the links that lead from the prefix to these files, with their targets: a link that appears
    there later is unowned. `unclaimed` files appeared during the build, but it is unknown whether the package
    or another program has written them: they count as installed, and are never removed. `workspace` is the
    root of the workspace that built the package, relative to the install folder, which it may share with
    others; '' if an earlier version wrote the list.
    """

    files: Mapping[str, str]
    folders: tuple[str, ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    unclaimed: frozenset[str] = frozenset()
    workspace: str = ""


def read_installed_list(name: str, layout: Layout) -> InstalledList | None:
    return read_list(list_file(name, layout), str(layout.install))


def read_list(file: Path, base: str) -> InstalledList | None:
    """Return the content of a list, or of a copy of it; `base` is the install folder."""
    try:
        data = json.loads(file.read_bytes())
        if data["version"] != _VERSION:
            return None
        return InstalledList(
            {f"{base}/{path}": str(content) for path, content in data["files"].items()},
            tuple(f"{base}/{path}" for path in data["folders"]),
            tuple((f"{base}/{path}", str(target)) for path, target in data["links"].items()),
            frozenset(f"{base}/{path}" for path in data["unclaimed"]),
            str(data.get("workspace", "")),
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def write_installed_list(
    name: str,
    layout: Layout,
    contents: Mapping[str, str],
    folders: Iterable[str],
    unclaimed: Collection[str] = (),
    workspace: str = "",
) -> None:
    """Record the installed files of a package, with their contents as by `contents_of`.

    `workspace` is the root of the workspace.
    """
    base = str(layout.install)
    inside = [path for path in contents if path.startswith(f"{base}/") and path not in unclaimed]
    parents = {parent for path in inside for parent in folders_above(path, base)}
    data = {
        "version": _VERSION,
        "files": {path[len(base) + 1 :]: identity(path, contents[path]) for path in inside},
        "folders": [path.rstrip("/")[len(base) + 1 :] for path in folders if path.startswith(f"{base}/")],
        "links": {
            path[len(base) + 1 :]: os.readlink(path) for path in sorted(parents) if os.path.islink(path)
        },
        "unclaimed": [path[len(base) + 1 :] for path in sorted(unclaimed)],
        "workspace": workspace and _relative(workspace, base),
    }
    replace_file(list_file(name, layout), json.dumps(data).encode())


@cache
def _relative(workspace: str, base: str) -> str:
    return os.path.relpath(os.path.realpath(workspace), os.path.realpath(base))


def add_files(name: str, layout: Layout, identities: Mapping[str, str]) -> None:
    """Add files to the existing list of a package, with their identities, or replace these."""
    file, skip = list_file(name, layout), len(str(layout.install)) + 1
    data = json.loads(file.read_bytes())
    data["files"].update((path[skip:], content) for path, content in identities.items())
    replace_file(file, json.dumps(data).encode())


def add_unclaimed(name: str, layout: Layout, paths: Iterable[str]) -> None:
    """Add files to the list of a package of which it is unknown whether it has written them."""
    file, skip = list_file(name, layout), len(str(layout.install)) + 1
    empty: dict[str, Any] = {"version": _VERSION, "files": {}, "folders": [], "links": {}}
    data = read_json(file) or empty
    unclaimed = {*data.get("unclaimed", ()), *(path[skip:] for path in paths)}
    replace_file(file, json.dumps({**data, "unclaimed": sorted(unclaimed)}).encode())


def package_markers(name: str, layout: Layout) -> tuple[str, ...]:
    """Return the files that mark a package as installed, in the order in which they are read."""
    prefix = layout.prefix(name)
    scripts_of_it = (f"{prefix}/share/{name}/package.{extension}" for extension in ("dsv", *SHELLS))
    return (*scripts_of_it, f"{prefix}/{PACKAGES}/{name}", f"{prefix}/{INDEX}/packages/{name}")


def identity(path: str, content: str) -> str:
    """Return the identity of a file at its path: the target of a link, else the digest."""
    return f"-> {os.readlink(path)}" if content.startswith("link ") else content.rpartition(" ")[2]


def identity_now(path: str) -> str:
    """Return the identity of an existing file."""
    from forge.build.inputs.fingerprints import content_digest

    return identity(path, "link " if os.path.islink(path) else content_digest(path))


def edited(path: str, name: str) -> Problem:
    """Return a warning about a file that is kept although package `name` no longer installs it."""
    message = f"kept '{path}', which '{name}' no longer installs, because it was edited"
    return Problem(message, hint="remove it if you do not need it")


def list_file(name: str, layout: Layout) -> Path:
    return Path(f"{layout.install}/{INSTALLED_LISTS_DIR}/{name}.json")


def folders_above(path: str, root: str) -> tuple[str, ...]:
    """Return the folders between a file and a folder that contains it, the innermost first."""
    return _with_folders_above(path.rpartition("/")[0], root)


@lru_cache(maxsize=4096)  # many files share a folder
def _with_folders_above(folder: str, root: str) -> tuple[str, ...]:
    inside = folder.startswith(f"{root}/")
    return (folder, *_with_folders_above(folder.rpartition("/")[0], root)) if inside else ()


def listed_files(build: Path) -> Iterator[str]:
    """Yield the absolute paths in the install manifests of a build folder; duplicates are possible."""
    for name in MANIFESTS:
        yield from listed_paths(build / name)


def without_other_installs(paths: Iterable[str], install: Path) -> Iterator[str]:
    """Yield listed paths, except those in the install folder of another workspace or build.

    A copied build folder lists the files of the original workspace.
    """
    base, own = f"{install}/", {str(install): True, "/": True}

    def is_own(folder: str) -> bool:
        if folder not in own:
            if os.path.lexists(f"{folder}/{LAYOUT_MARKER}"):
                own[folder] = install.is_dir() and os.path.samefile(folder, install)
            else:
                own[folder] = is_own(os.path.dirname(folder))
        return own[folder]

    for path in paths:
        if path.startswith(base) or is_own(os.path.dirname(path)):
            yield path


class InstalledStates:
    """Lists of installed files by package and by the digest of all of them."""

    def __init__(self, build: Path) -> None:
        """Store the path of the lists; `build` is the parent of all build folders."""
        self._home = build / INSTALLED_STATES_DIR
        self._compared: dict[tuple[str, str, str], Changes | None] = {}

    def folder(self, name: str) -> Path:
        """Return the folder for what is recorded about the installed files of a package."""
        return self._home / name

    def keep(self, name: str, digest: str, contents: Mapping[str, str]) -> None:
        """Record the contents of a package's installed files by absolute path; remove old states."""
        replace_file(self.folder(name) / f"{digest}.json", json.dumps(contents).encode())
        if plugin := own_plugin(OPTIONS, "library-abi"):
            plugin.keep_interfaces(name, contents, self)
        states = [*self.folder(name).glob("*.json")]
        if len(states) > STATES_PER_PACKAGE:
            states.sort(key=lambda path: path.stat().st_mtime_ns)
            for path in states[:-STATES_PER_PACKAGE]:
                path.unlink(missing_ok=True)

    def contents(self, name: str, digest: str) -> Mapping[str, str] | None:
        """Return the installed files of a package in one of its states, None if it is unknown."""
        return read_json(self.folder(name) / f"{digest}.json") or None

    def changes(self, name: str, then: str, now: str) -> Changes | None:
        """Return how two states of a package differ, by their digests; None if one of them is unknown.

        An empty digest means that the package was not installed.
        """
        key = (name, then, now)
        if key not in self._compared:
            from forge.build.inputs.fingerprints import compare

            one, other = (self.contents(name, digest) if digest else {} for digest in (then, now))
            self._compared[key] = None if one is None or other is None else compare(one, other)
        return self._compared[key]
