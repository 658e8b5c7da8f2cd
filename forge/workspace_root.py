"""Where a workspace begins: its root, found from any folder inside it.

A folder that was built in, or has a forge.toml, is a root; else one that holds 'src'. Commands run there,
as if the user stood there; paths typed on the command line still mean what they mean where it was typed.
"""

from __future__ import annotations

import os
import stat
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_MARKS = ("forge.toml", "install/.colcon_install_layout", "build/.built_by")

_ONE_PATH = ("--build-base", "--install-base", "--log-base", "--python", "--test-result-base", "--output")
_MANY_PATHS = ("--base-paths", "--paths", "--metas", "--mixin-files")
_WITH_SHORT_OUTPUT = frozenset({"bundle", "graph"})
"""The commands whose -o is --output."""


def find_root(start: Path, home: Path) -> Path:
    """Return the root of the workspace that the absolute folder `start` is in, or `start` itself.

    What is marked comes first: `start`, then the nearest folder around with `start` below its 'src'. Then
    a folder with 'src' in it that is no package. Home, the root of all, and folders that everybody may
    write to, such as /tmp, are workspaces only for who stands there.
    """
    if _marked(start):
        return start
    around = [folder for folder in start.parents if _may_be_found(folder, home)]
    marked = [folder for folder in around if _marked(folder)]
    sources = [folder for folder in around if start.is_relative_to(folder / "src")]
    candidates = (
        *(folder for folder in marked if folder in sources),
        *(folder for folder in (start, *sources) if _has_sources(folder)),
        *marked,
    )
    return next(iter(candidates), start)


def typed_elsewhere(arguments: Sequence[str], origin: Path, root: Path) -> list[str]:
    """Return a command line typed in `origin` as it reads in `root`: paths stay the same places."""
    rewritten: list[str] = []
    name, left = "", 0
    short = not _WITH_SHORT_OUTPUT.isdisjoint(arguments)
    for argument in arguments:
        option, equals, value = argument.partition("=")
        if argument.startswith("-"):
            left = 0 if equals else _paths_after(option, short=short)
            name = option
            if equals and _paths_after(option, short=short):
                argument = f"{option}={_moved(name, value, origin, root)}"  # noqa: PLW2901
        elif left:
            left -= 1
            argument = _moved(name, argument, origin, root)  # noqa: PLW2901
        rewritten.append(argument)
    return rewritten


@contextmanager
def standing_in(folder: Path) -> Iterator[None]:
    """Change the working folder for a while; raises EnvironmentFault when that cannot be."""
    try:
        before = Path.cwd()
    except FileNotFoundError:
        from forge.errors import EnvironmentFault, Problem  # noqa: PLC0415

        hint = "go to one that exists: cd"
        raise EnvironmentFault(Problem("the folder that you are in was removed", hint=hint)) from None
    try:
        os.chdir(folder)
    except OSError as error:
        # Not above: completion imports this module for each press of a key.
        from forge.errors import EnvironmentFault, Problem  # noqa: PLC0415

        raise EnvironmentFault(Problem(f"cannot go to '{folder}': {error.strerror}")) from None
    try:
        yield
    finally:
        with suppress(FileNotFoundError):  # it was removed meanwhile
            os.chdir(before)


def _marked(folder: Path) -> bool:
    return any((folder / mark).is_file() for mark in _MARKS)


def _has_sources(folder: Path) -> bool:
    """Tell if a folder looks like a workspace that was never built; a package may have a 'src' too."""
    return (folder / "src").is_dir() and not (folder / "package.xml").exists()


def _may_be_found(folder: Path, home: Path) -> bool:
    if folder in {home, Path(folder.anchor)}:
        return False
    try:
        return not folder.stat().st_mode & stat.S_ISVTX
    except OSError:
        return False


def _paths_after(option: str, *, short: bool) -> int:
    """Return how many words after an option are paths; a unique beginning stands for it.

    `short` where '-o' is --output, and not a word for pytest.
    """
    if not option.startswith("--"):
        return int(option == "-o" and short)
    if any(known.startswith(option) for known in _ONE_PATH):
        return 1
    return 1_000_000 if any(known.startswith(option) for known in _MANY_PATHS) else 0


def _moved(option: str, path: str, origin: Path, root: Path) -> str:
    path = path.strip()
    # An interpreter without a folder is looked for on PATH.
    elsewhere = option == "--python" and os.sep not in path
    if elsewhere or os.path.isabs(path) or path.startswith("~"):  # noqa: PTH117  (text in, text out)
        return path
    place = Path(os.path.normpath(origin / path))
    return str(place.relative_to(root)) if place.is_relative_to(root) else str(place)
