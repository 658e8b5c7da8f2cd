"""All result files below a folder, as colcon finds them (workspace spec 7.4)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import Place, Problem, WorkspaceError
from forge.files import read_file, text_or_nothing
from forge.frozen import frozen
from forge.names import is_word
from forge.testing.outcomes import NotAResultError, Outcome, read_ctest, read_junit
from forge.xml_tree import parse_xml

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.xml_tree import Element

    Read = Callable[[Element, str, str], Outcome]

_LARGEST = 1 << 30
"""How many bytes a result may have: with the output of its tests it may be long."""


@frozen
class Collection:
    """What was found: outcomes by path, every file that belongs to them, and what could not be read."""

    outcomes: tuple[Outcome, ...]
    files: tuple[str, ...]
    problems: tuple[Problem, ...] = ()


def collect(base: Path) -> Collection:
    """Return the results below `base`; their paths begin as it is spelled.

    Folders whose names begin with a dot are left out, links are not followed. Of CTest's runs the last
    one counts, which Testing/TAG names.
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
                problems.append(Problem(f"this is no result of CTest: {error}", Place(path)))
        else:
            files.append(path)
    return Collection(
        tuple(sorted(outcomes, key=lambda outcome: outcome.path)), tuple(sorted(files)), tuple(problems)
    )


def _candidates(base: Path) -> Iterator[tuple[str, str, str | None]]:
    """Yield (file, the folder whose tests it tells of, Testing/TAG for a file of CTest)."""
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
    """Return the nearest folder above, or this one, that CTest ran in; else the package's below `base`."""
    while homes and folder != homes[-1] and not folder.startswith(homes[-1] + os.sep):
        homes.pop()
    if has_testing:
        homes.append(folder)
    if homes:
        return homes[-1]
    first, _, _ = os.path.relpath(folder, base).partition(os.sep)
    return os.path.join(base, first)  # noqa: PTH118


def _last_run(tag: str) -> str | None:
    """Return the folder of CTest's last run, if it got as far as a result."""
    lines = text_or_nothing(tag).splitlines()
    # A folder beside the file; unlike Path.is_file, os.path.isfile says no to a name that none can have.
    if not lines or not is_word(lines[0]):
        return None
    there = os.path.isfile(f"{Path(tag).parent}/{lines[0]}/Test.xml")  # noqa: PTH113
    return lines[0] if there else None


def _read(path: str, home: str, read: Read) -> Outcome:
    """Read a file; one that mentions no test is not even parsed: build folders hold much XML."""
    try:
        content = read_file(path, _LARGEST)
    except OSError as error:
        problem = Problem(f"cannot read the result: {error.strerror}", Place(path))
        raise WorkspaceError(problem) from None
    if b"<testsuite" not in content and read is read_junit:
        raise NotAResultError("there is no 'testsuite' in it")
    return read(parse_xml(content, Path(path)), path, home)
