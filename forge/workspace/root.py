"""Finds the root of the workspace from any folder inside it.

A folder that was built in or has a forge.toml is a root, else one that contains 'src'. Commands run at the
root; paths on the command line stay relative to the folder in which they were typed.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from forge.base.env_vars import setting
from forge.base.errors import ForgeError, HostError, Problem
from forge.base.layout import LAYOUT_MARKER
from forge.environment.install_state import recorded_state

_ROOT_MARKERS = ("forge.toml", f"install/{LAYOUT_MARKER}", "build/.built_by")
_PROFILE_MARKER = "build-*/.built_by"

_ONE_PATH = (
    *("--build-base", "--install-base", "--log-base", "--test-result-base", "--output"),
    *("--python", "--toolchain-file", "--sysroot"),
)
_MANY_PATHS = ("--base-paths", "--paths", "--metas", "--mixin-files")


def find_root(start: Path, home: Path) -> Path:
    """Return the root of the workspace around the absolute folder `start`, or `start` itself.

    Marked folders come first: `start`, then the nearest parent with `start` below its 'src'; then a folder
    that contains 'src' and is not a package. The home folder, the file system's root, and world-writable
    folders such as /tmp are used only if they are `start`.
    """
    if _has_marker(start):
        return start
    around = [folder for folder in start.parents if _may_be_found(folder, home)]
    marked = [folder for folder in around if _has_marker(folder)]
    sources = [folder for folder in around if start.is_relative_to(folder / "src")]
    with_sources = [folder for folder in (start, *sources) if _has_sources(folder)]
    return next(iter([*(folder for folder in marked if folder in sources), *with_sources, *marked, start]))


def find_install(start: Path, home: Path, profile: str | None = None) -> Path | None:
    """Return the install folder of the workspace around the absolute folder `start` if it was built.

    The folder is that of `profile`, by default of $FORGE_PROFILE. Raises SelectionError for an unknown
    profile.
    """
    root, base = find_root(start, home), "install"
    if name := profile or setting("PROFILE", os.environ):
        from forge.workspace.forge_toml import install_of_profile

        base = install_of_profile(root, name)
    return root / base if (root / base / LAYOUT_MARKER).is_file() else None


def source_packages(install: Path | None) -> Mapping[str, str]:
    """Return the build types by name of the readable packages in the workspace of an install folder."""
    if install is None:
        return {}
    from forge.workspace.load import find_packages
    from forge.workspace.selection import SearchPaths

    # Without --profile, it is beside the sources.
    root = Path(os.path.normpath(install / recorded_state(install).root))
    with suppress(ForgeError):
        packages = find_packages(root, SearchPaths(), os.environ).packages
        return {name: package.build_type for name, package in packages.items()}
    return {}


def is_root(folder: Path) -> bool:
    return _has_marker(folder) or _has_sources(folder)


def rebase_paths(arguments: Iterable[tuple[str, bool]], origin: Path, root: Path) -> list[str]:
    """Return a command line with its paths relative to `root`; flagged arguments are for other programs."""
    rewritten: list[str] = []
    name, left = "", 0
    for argument, passed_on in arguments:
        option, equals, value = argument.partition("=")
        if passed_on:
            pass
        elif argument.startswith("-"):
            left = 0 if equals else _paths_after(option)
            name = option
            if equals and _paths_after(option):
                argument = f"{option}={_moved(name, value, origin, root)}"
        elif left:
            left -= 1
            argument = _moved(name, argument, origin, root)
        rewritten.append(argument)
    return rewritten


@contextmanager
def working_directory(folder: Path) -> Iterator[None]:
    """Change the working directory temporarily; raises HostError if that fails."""
    try:
        before = Path.cwd()
    except FileNotFoundError:
        hint = "change to an existing folder: cd"
        raise HostError(Problem("the current folder has been removed", hint=hint)) from None
    try:
        os.chdir(folder)
    except OSError as error:
        raise HostError(Problem(f"cannot change to '{folder}': {error.strerror}")) from None
    try:
        yield
    finally:
        with suppress(FileNotFoundError):  # it was removed meanwhile
            os.chdir(before)


def _has_marker(folder: Path) -> bool:
    return any((folder / mark).is_file() for mark in _ROOT_MARKERS) or any(folder.glob(_PROFILE_MARKER))


def _has_sources(folder: Path) -> bool:
    # Packages may contain 'src', too.
    return (folder / "src").is_dir() and not (folder / "package.xml").exists()


def _may_be_found(folder: Path, home: Path) -> bool:
    with suppress(OSError):
        return folder not in {home, Path(folder.anchor)} and not folder.stat().st_mode & stat.S_ISVTX
    return False


def _paths_after(option: str) -> int:
    """Return how many arguments after an option are paths; abbreviated options are accepted."""
    if not option.startswith("--"):
        return int(option == "-o")
    if any(name.startswith(option) for name in _ONE_PATH):
        return 1
    return 1_000_000 if any(name.startswith(option) for name in _MANY_PATHS) else 0


def _moved(option: str, path: str, origin: Path, root: Path) -> str:
    path = path.strip()
    # An interpreter without a folder is searched on PATH.
    elsewhere = option == "--python" and os.sep not in path
    if elsewhere or os.path.isabs(path) or path.startswith("~"):  # noqa: PTH117  (text in, text out)
        return path
    moved = Path(os.path.normpath(origin / path))
    return str(moved.relative_to(root)) if moved.is_relative_to(root) else str(moved)
