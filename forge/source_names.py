"""Which files of a package are no sources, by their names and what lies beside them; pure.

Editors, indexers and virtual environments leave files in a package that no build should depend on. But a
package may install a whole folder, whatever the names in it, so a name alone seldom decides.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

_LITTER_FOLDERS = frozenset(
    """.git .hg .svn .bzr __pycache__ .pytest_cache .mypy_cache .ruff_cache .hypothesis .tox .eggs
    .ipynb_checkpoints .direnv .ccls-cache""".split()  # noqa: SIM905  (a list of as many lines would say no more)
)
"""What version control and development tools keep for themselves, wherever it lies."""

_LITTER = frozenset({".DS_Store", "COLCON_IGNORE", "AMENT_IGNORE", "4913"})
"""The last is how Vim tries whether it may write into a folder."""

_LITTER_OF_PROJECTS = frozenset(
    {".idea", ".vscode", ".cache", ".clangd", ".coverage", ".venv", "node_modules", "compile_commands.json"}
)
"""What development tools put beside the main file of a project. Elsewhere it may be data."""

_PROJECT_FILES = ("CMakeLists.txt", "package.xml", "setup.py", "pyproject.toml", "package.json")
_STILL_OPEN = re.compile(r"\.nfs[0-9a-f]+|\.fuse_hidden[0-9a-f]+")
"""Names of removed files that a program has open still."""

_COPY = re.compile(
    r"\.(?P<edited>.+)\.(?:sw[a-p]|kate-swp|un~)|(?P<backup>.+?)(?:\.~\d+)?~|(?P<merged>.+)\.(?:orig|rej)"
    r"|#(?P<saved>.+)#|\.#(?P<locked>.+)|(?P<python>.+\.py)[co]|(?P<egg>.+)\.egg-info"
)
"""What editors, merges and Python put beside a file, by the name of that; without the file it may be data."""

_SUSPECT_BEGINNINGS = (".", "#", "4913", "COLCON_IGNORE", "AMENT_IGNORE", *_LITTER_OF_PROJECTS)
_SUSPECT_ENDINGS = ("~", ".orig", ".rej", ".pyc", ".pyo", ".egg-info")


def is_source(name: str, beside: Callable[[str], bool]) -> bool:
    """Tell if a file of this name counts as a source; `beside` tells what else is in its folder.

    What a package may want to install counts: a name alone seldom shows that a file is litter, but a name
    and what lies beside it do.
    """
    if not (name.startswith(_SUSPECT_BEGINNINGS) or name.endswith(_SUSPECT_ENDINGS)):
        return True
    return not (name in _LITTER or _STILL_OPEN.fullmatch(name) or _belongs_to_another(name, beside))


def is_source_folder(name: str, beside: Callable[[str], bool]) -> bool:
    """Tell the same of a folder."""
    if not name.startswith((".", "__pycache__", "node_modules")) and not name.endswith(".egg-info"):
        return True
    return not (name in _LITTER_FOLDERS or _belongs_to_another(name, beside))


def _belongs_to_another(name: str, beside: Callable[[str], bool]) -> bool:
    """Tell if something of this name was made for what lies beside it."""
    copy = _COPY.fullmatch(name)
    if copy is not None and beside(str(copy[copy.lastgroup or 0])):
        return True
    of_project = name in _LITTER_OF_PROJECTS or name.startswith(".coverage.") or name.endswith(".egg-info")
    return of_project and any(map(beside, _PROJECT_FILES))
