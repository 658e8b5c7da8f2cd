"""Decides which files are not sources, by name and adjacent files, as packages may install whole folders."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator

_LITTER_FOLDERS = frozenset(
    """.git .hg .svn .bzr __pycache__ .pytest_cache .mypy_cache .ruff_cache .hypothesis .tox .eggs
    .ipynb_checkpoints .direnv .ccls-cache""".split()
)
"""Private folders of version control and development tools, at any depth."""

_LITTER = frozenset({".DS_Store", "COLCON_IGNORE", "AMENT_IGNORE", "4913"})
"""Ignored file names; Vim creates 4913 to test write permission."""

_LITTER_OF_PROJECTS = frozenset(
    """.idea .vscode .cache .clangd .coverage .venv node_modules site-packages dist-packages
    compile_commands.json""".split()
)
"""Files of development tools next to the main file of a project; elsewhere they may be data."""

_INSTALLED = frozenset({"site-packages", "dist-packages", "node_modules"})
"""Folders into which package managers install third-party packages."""

ENVIRONMENT_MARKS = ("pyvenv.cfg", "conda-meta")
"""Names in the top folder of a virtual environment or conda environment."""

_PROJECT_FILES = ("CMakeLists.txt", "package.xml", "setup.py", "pyproject.toml", "package.json")
_STILL_OPEN = re.compile(r"\.nfs[0-9a-f]+|\.fuse_hidden[0-9a-f]+")
"""Names of deleted files that a process still has open."""

_COPY = re.compile(
    r"\.(?P<edited>.+)\.(?:sw[a-p]|kate-swp|un~)|(?P<backup>.+?)(?:\.~\d+)?~|(?P<merged>.+)\.(?:orig|rej)"
    r"|#(?P<saved>.+)#|\.#(?P<locked>.+)|(?P<python>.+\.py)[co]|(?P<egg>.+)\.egg-info"
)
"""Derived files of editors, merges and Python; ignored only next to the original file."""

_SUSPECT_BEGINNINGS = (".", "#", "4913", "COLCON_IGNORE", "AMENT_IGNORE", *_LITTER_OF_PROJECTS)
_SUSPECT_ENDINGS = ("~", ".orig", ".rej", ".pyc", ".pyo", ".egg-info")


def is_source(name: str, beside: Callable[[str], bool]) -> bool:
    """Return whether a file may be a source; `beside` returns whether a name is in the same folder."""
    if not (name.startswith(_SUSPECT_BEGINNINGS) or name.endswith(_SUSPECT_ENDINGS)):
        return True
    return not (name in _LITTER or _STILL_OPEN.fullmatch(name) or _belongs_to_another(name, beside))


def is_source_folder(name: str, beside: Callable[[str], bool]) -> bool:
    if name == "target" and beside("Cargo.toml"):
        return False  # cargo's build folder, if a user or an editor ran cargo
    suspect = name in _INSTALLED or name.startswith((".", "__pycache__")) or name.endswith(".egg-info")
    return not (suspect and (name in _LITTER_FOLDERS or _belongs_to_another(name, beside)))


def is_environment(inside: Callable[[str], bool]) -> bool:
    """Return whether a folder is a Python environment; `inside` returns whether a name exists in it."""
    return any(map(inside, ENVIRONMENT_MARKS))


def may_contain_packages(name: str) -> bool:
    """Return whether packages of a workspace may be below a folder, which is itself not a package."""
    return not name.startswith(".") and name not in _INSTALLED


def folders_to_search(
    base: str, visited: set[tuple[int, int]] | None = None, denied: list[PermissionError] | None = None
) -> Iterator[tuple[str, dict[str, os.DirEntry[str]]]]:
    """Yield each folder that a search for packages visits, with its entries; follow links without loops.

    As with os.walk, clear the entries to skip everything below a folder. Folders are sorted, each before
    those below it. Folders in `visited` (device and inode) are left out, as are unreadable ones: see
    `denied`.
    """
    waiting, visited = [base], set() if visited is None else visited
    while waiting:
        folder = waiting.pop()
        try:
            status = os.stat(folder)
            identity = (status.st_dev, status.st_ino)
            if identity in visited:
                continue
            visited.add(identity)
            with os.scandir(folder) as iterator:
                entries = {entry.name: entry for entry in iterator}
        except OSError as error:  # entries that are not denied were removed meanwhile, or are dangling links
            if isinstance(error, PermissionError) and denied is not None:
                denied.append(error)
            continue
        # A workspace may have an environment at its root and is still searched.
        if folder != base and is_environment(entries.__contains__):
            continue
        yield folder, entries
        below = (entries[name] for name in sorted(entries, reverse=True) if may_contain_packages(name))
        waiting += (entry.path for entry in below if _is_folder(entry))


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def _belongs_to_another(name: str, beside: Callable[[str], bool]) -> bool:
    """Return whether a name is derived from another file in the folder."""
    copy = _COPY.fullmatch(name)
    if copy is not None and beside(str(copy[copy.lastgroup or 0])):
        return True
    of_project = name in _LITTER_OF_PROJECTS or name.startswith(".coverage.") or name.endswith(".egg-info")
    return of_project and any(map(beside, _PROJECT_FILES))
