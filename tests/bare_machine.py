"""Run a command as on a fresh machine with nothing but Debian's essential packages, Python, make and g++.

    python -m tests.bare_machine make test
    python -m tests.bare_machine --with cmake --with ctest make test

The command gets mounts of its own: the folders for programs contain only those programs, and folders of
optional libraries are empty, so that neither PATH nor an absolute path nor CMake finds more. Other processes
see no change. It needs dpkg and the right to mount: root, user namespaces or sudo.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).parents[1]
PYTHON = Path(sys.executable).resolve()
FOLDERS = (
    str(PYTHON.parent),
    *("/usr/local/sbin", "/usr/local/bin", "/usr/sbin", "/usr/bin", "/sbin", "/bin"),
)
"""Where programs are; other programs than those of the bare machine are missing there."""
OPTIONAL = (
    "/opt/ros",
    "/usr/include/fastcdr",
    "/usr/lib/cmake",
    "/usr/lib/x86_64-linux-gnu/cmake",
    "/usr/lib/aarch64-linux-gnu/cmake",
    "/usr/src/googletest",
    f"{ROOT}/.debian-peers",
    f"{ROOT}/.venv-peers",
)
"""Folders that are empty on the bare machine."""

_INSTALLED = re.compile(
    r"(binutils|cpp|g\+\+|gcc|make|mawk|mount|python3(\.\d+)?(-minimal|-venv)?)(-\d+)?(-[\w-]+-linux-gnu)?"
)
"""Debian's packages with the programs that `apt-get install make g++ python3-venv` brings."""
_UNSHARE = (("unshare", "-m"), ("unshare", "-Urm"), ("sudo", "-nE", "unshare", "-m"))
_INSIDE = "--inside"


def main(argv: Sequence[str]) -> NoReturn:
    """Become the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.bare_machine")
    parser.add_argument(
        "--with", dest="kept", action="append", default=[], help="an optional program to keep"
    )
    parser.add_argument(_INSIDE, action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args(argv)
    if not options.command:
        parser.error("no command")
    if options.inside:
        _mount(frozenset(options.kept))
        command = [*options.command]
        os.environ["PATH"] = os.pathsep.join(dict.fromkeys(FOLDERS))
    else:
        command = [*_unshare(), sys.executable, "-m", "tests.bare_machine", _INSIDE, *argv]
    os.execvp(command[0], command)


def programs() -> frozenset[str]:
    """Return the names of the programs of Debian's essential packages, Python, make and g++."""
    query = ("dpkg-query", "-W", "-f", "${Essential} ${Package} ${binary:Package}\n")
    lines = subprocess.run(query, capture_output=True, text=True, check=True).stdout.splitlines()
    packages = (
        full
        for essential, name, full in map(str.split, lines)
        if essential == "yes" or _INSTALLED.fullmatch(name)
    )
    listed = subprocess.run(("dpkg-query", "-L", *packages), capture_output=True, text=True, check=True)
    return frozenset(Path(path).name for path in listed.stdout.splitlines() if "bin/" in path)


def _unshare() -> tuple[str, ...]:
    """Return the words that start a program with mounts of its own."""
    for words in _UNSHARE:
        if (
            shutil.which(words[0])
            and not subprocess.run((*words, "true"), capture_output=True, check=False).returncode
        ):
            return words
    sys.exit("error: no right to mount\nhint: run this as root, and a container with '--cap-add SYS_ADMIN'")


def _mount(kept: frozenset[str]) -> None:
    """Mount copies of the programs over their folders, and an empty folder over the optional ones."""
    room = Path(tempfile.mkdtemp(prefix="bare-machine-"))
    _run("mount", "-t", "tmpfs", "-o", "mode=755", "none", str(room))
    binds = {folder: str(copy) for folder, copy in _copies(room, programs() | kept).items()}
    (room / "empty").mkdir()
    binds |= {folder: f"{room}/empty" for folder in OPTIONAL if Path(folder).is_dir()}
    lines = (f"mount --bind '{source}' '{folder}' || exit" for folder, source in binds.items())
    _run("sh", "-c", "\n".join((*lines, f"umount -l '{room}' && rmdir '{room}'")))


def _copies(room: Path, shown: frozenset[str]) -> Mapping[str, Path]:
    """Copy the folders for programs; those that are links, in a merged /usr, lead to the copies."""
    copies = {}
    for folder in FOLDERS:
        if Path(folder).is_dir() and not Path(folder).is_symlink():
            copies[folder] = Path(tempfile.mkdtemp(dir=room))
            copies[folder].chmod(0o755)
            for path in _shown(Path(folder), shown):
                shutil.copy2(path, copies[folder] / path.name, follow_symlinks=False)
    return copies


def _shown(folder: Path, names: frozenset[str]) -> Iterator[Path]:
    """Yield the programs of these names; this Python and Debian's alternatives may have others."""
    for path in folder.iterdir():
        alternative = path.is_symlink() and str(path.readlink()).startswith("/etc/alternatives/")
        if path.name in names or path.resolve() == PYTHON or (alternative and path.resolve().name in names):
            yield path


def _run(*argv: str) -> None:
    """Run a program that must succeed and says itself why it did not."""
    if subprocess.run(argv, check=False).returncode:
        sys.exit("error: the bare machine could not be set up")


if __name__ == "__main__":
    main(sys.argv[1:])
