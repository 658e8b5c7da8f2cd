"""Collects all result files below a folder, like `colcon test-result`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import read_file, text_or_nothing
from forge.base.frozen import frozen
from forge.base.names import is_word
from forge.base.xml import parse_xml
from forge.testing.outcomes import NotAResultError, Outcome, read_ctest, read_junit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.base.xml import Element

    Read = Callable[[Element, str, str], Outcome]


@frozen
class Collection:
    """The results by path, all their files, and problems."""

    outcomes: tuple[Outcome, ...]
    files: tuple[str, ...]
    problems: tuple[Problem, ...] = ()


def collect(base: Path) -> Collection:
    """Return the results below `base`; paths start as `base` is spelled.

    Hidden folders are skipped, links are not followed. Only the last CTest run counts, which Testing/TAG
    names.
    """
    outcomes: list[Outcome] = []
    files: list[str] = []
    problems: list[Problem] = []
    for path, home, tag in _candidates(base):
        if tag is not None:
            files.append(tag)
        try:
            outcomes.append(_read(path, home, read_ctest if tag else read_junit))
        except WorkspaceError as error:
            problems += error.problems
        except NotAResultError as error:
            if tag is not None:
                problems.append(Problem(f"not a CTest result: {error}", Location(path)))
        else:
            files.append(path)
    return Collection(
        tuple(sorted(outcomes, key=lambda outcome: outcome.path)), tuple(sorted(files)), tuple(problems)
    )


def _candidates(base: Path) -> Iterator[tuple[str, str, str | None]]:
    """Yield (file, folder of the tests, Testing/TAG for a CTest file)."""
    homes: list[str] = []
    for folder, names, files in os.walk(base):
        names[:] = sorted(name for name in names if not name.startswith("."))
        home = _home(folder, str(base), homes, "Testing" in names)
        if os.path.basename(folder) == "Testing" and "TAG" in files:  # noqa: PTH119  (a walk is text)
            tag = f"{folder}/TAG"
            last = _last_run(tag)
            if last is not None:
                yield f"{folder}/{last}/Test.xml", home, tag
        yield from ((f"{folder}/{name}", home, None) for name in sorted(files) if name.endswith(".xml"))


def _home(folder: str, base: str, homes: list[str], has_testing: bool) -> str:  # noqa: FBT001  (a fact of the walk)
    """Return the nearest folder in which CTest ran, else the package's folder below `base`."""
    while homes and folder != homes[-1] and not folder.startswith(homes[-1] + os.sep):
        homes.pop()
    if has_testing:
        homes.append(folder)
    if homes:
        return homes[-1]
    first, _, _ = os.path.relpath(folder, base).partition(os.sep)
    return os.path.join(base, first)  # noqa: PTH118


def _last_run(tag: str) -> str | None:
    """Return the folder of the last CTest run if it has a result."""
    lines = text_or_nothing(tag).splitlines()
    # Unlike Path.is_file, os.path.isfile returns False for invalid names.
    if not lines or not is_word(lines[0]):
        return None
    there = os.path.isfile(f"{Path(tag).parent}/{lines[0]}/Test.xml")  # noqa: PTH113
    return lines[0] if there else None


def _read(path: str, home: str, read: Read) -> Outcome:
    """Parse a file if it mentions tests, because build folders contain much other XML."""
    try:
        content = read_file(path)
    except OSError as error:
        problem = Problem(f"cannot read the result: {error.strerror}", Location(path))
        raise WorkspaceError(problem) from None
    if b"<testsuite" not in content and read is read_junit:
        raise NotAResultError("it contains no 'testsuite'")
    return read(parse_xml(content, Path(path)), path, home)
