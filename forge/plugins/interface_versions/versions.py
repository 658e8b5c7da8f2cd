"""Read the interfaces of all packages in a folder, or in a revision of a git repository."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from forge.base.errors import (
    ForgeError,
    InterfaceError,
    Location,
    Problem,
    SelectionError,
    print_warnings,
    raise_if_any,
)
from forge.interfaces.model import Catalog
from forge.interfaces.read.parsing import ENDINGS, Parsed, parse_all
from forge.interfaces.read.sources import Library, read_source
from forge.interfaces.resolve.resolution import resolve
from forge.plugins.interface_versions.packages import IGNORED, definitions_in, packages_in

_SUBMODULE = "160000"
"""The mode of the commit of another repository in a tree of git."""


@contextmanager
def opened(text: str) -> Iterator[tuple[Path, str]]:
    """Yield the folder and the name of a version; a revision is extracted temporarily.

    A version is a folder, or REVISION or REVISION:FOLDER as in git, without FOLDER that of the working
    directory. Raises SelectionError if there is neither, and names files of a revision as git does.
    """
    if Path(text).is_dir():
        yield Path(text), Path(text).resolve().name
        return
    # Without ':', git lists the current folder of the tree.
    listed = _git("ls-tree", "-r", "-z", *(("--full-tree",) if ":" in text else ()), "--end-of-options", text)
    if listed.returncode:
        reason = listed.stderr.decode(errors="replace").strip().removeprefix("fatal: ")
        hint = "revisions refer to the repository of the current folder, as in HEAD~1 or v1.2.0:src/my_msgs"
        raise SelectionError(Problem(f"'{text}' is neither a folder nor a git revision: {reason}", hint=hint))
    with tempfile.TemporaryDirectory(prefix="forge-") as folder:
        _extract(listed.stdout, Path(folder), text)
        try:
            yield Path(folder), Path(text.partition(":")[2]).absolute().name
        except ForgeError as error:
            raise type(error)(*(_renamed(each, Path(folder), text) for each in error.problems)) from None


def _extract(listing: bytes, folder: Path, revision: str) -> None:
    """Write definitions and manifests into a folder; `listing` is that of `git ls-tree -r -z`.

    Raises SelectionError if a clone lacks one.
    """
    objects: dict[str, str] = {}
    links: list[Problem] = []
    for entry in filter(None, listing.decode(errors="surrogateescape").split("\0")):
        (mode, _, name), path = entry.partition("\t")[0].split(" "), entry.partition("\t")[2]
        if mode.startswith("100") and _is_read(PurePosixPath(path)):
            objects[path] = name
        elif mode == _SUBMODULE:
            hint = "compare its own revisions in its folder, or folders instead of revisions"
            print_warnings([Problem(f"the submodule '{path}' of '{revision}' is left out", hint=hint)])
        elif _is_read(PurePosixPath(path)):
            links.append(Problem(f"'{path}' of '{revision}' is a symbolic link", hint="compare folders"))
    raise_if_any(links, SelectionError)
    contents = _git("cat-file", "--batch", content="\n".join(objects.values()).encode()).stdout
    at = 0
    for path in objects:
        end = contents.index(b"\n", at)
        size = contents[at:end].rpartition(b" ")[2]
        if not size.isdigit():
            message = f"'{path}' of '{revision}' is not in this clone"
            raise SelectionError(Problem(message, hint="fetch it: git fetch --unshallow, or --refetch"))
        at = end + 1 + int(size) + 1
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(contents[end + 1 : at - 1])


def _is_read(path: PurePosixPath) -> bool:
    is_safe = ".." not in path.parts
    return is_safe and (path.name in {"package.xml", *IGNORED} or path.suffix.removeprefix(".") in ENDINGS)


def _git(*words: str, content: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(("git", *words), input=content, capture_output=True, check=False)
    except OSError:
        hint = "install it, or name folders instead of revisions"
        raise SelectionError(Problem("git is not installed", hint=hint)) from None


def _renamed(problem: Problem, folder: Path, text: str) -> Problem:
    """Return a problem whose place is in the revision instead of in the extracted folder."""
    place = problem.location
    if place is None or not Path(place.path).is_relative_to(folder):
        return problem
    below = Path(place.path).relative_to(folder)
    return replace(problem, location=replace(place, path=Path(f"{text}{'/' if ':' in text else ':'}{below}")))


def catalogs_in(folder: Path, name: str, others: Library, package: str | None) -> list[Catalog]:
    """Return the resolved interfaces of each package in a folder, or of one `package`.

    Definitions without a package.xml belong to a package with the `name` of the folder. `others` has what
    they refer to elsewhere. Raises InterfaceError with all problems.
    """
    problems: list[Problem] = []
    parsed: dict[str, tuple[Parsed, ...]] = {}
    for each, home in packages_in(folder, package or name):
        try:
            found = parse_all([read_source(each, home, relative) for relative in definitions_in(home)])
        except InterfaceError as error:
            problems += error.problems
            continue
        if each in parsed and found:
            problems.append(Problem(f"another package of '{name}' is called '{each}', too", Location(home)))
        elif found:
            parsed[each] = found
    raise_if_any(problems, InterfaceError)
    here = {one.interface.name: one for found in parsed.values() for one in found}
    lookup = replace(others, given=here)
    catalogs = []
    for each, found in sorted(parsed.items()):
        if package in {None, each}:
            try:
                catalogs.append(resolve(each, found, lookup, events=others.has_events))
            except InterfaceError as error:
                problems += error.problems
    raise_if_any(problems, InterfaceError)
    return catalogs
