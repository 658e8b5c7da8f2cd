"""Collects all result files below a folder, like `colcon test-result`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import read_file, text_or_nothing
from forge.base.frozen import frozen
from forge.base.names import is_safe_name
from forge.base.xml import as_utf8, mentions, parse_xml
from forge.build.folder_marks import is_own_result_dir
from forge.testing.outcomes import (
    BrokenResultError,
    NotAResultError,
    Outcome,
    read_ctest,
    read_junit,
    unreadable,
)


@frozen
class Collection:
    """The results by path, all their files, those at the paths to which tests write, and problems."""

    outcomes: tuple[Outcome, ...]
    files: tuple[str, ...]
    problems: tuple[Problem, ...] = ()
    expected: frozenset[str] = frozenset()


def collect(base: Path) -> Collection:
    """Return the results below `base`; paths begin with `base` as given.

    Hidden folders are skipped, links are not followed, except those to folders for results of packages. Only
    the last CTest run counts, which Testing/TAG names. A result that cannot be read counts as an error.
    """
    outcomes: list[Outcome] = []
    files: list[str] = []
    problems: list[Problem] = []
    expected: set[str] = set()
    denied: list[OSError] = []
    for candidate in _candidates(base, denied):
        files += [candidate.tag] if candidate.tag else []
        try:
            outcomes.append(_read(candidate))
        except NotAResultError:
            continue
        except WorkspaceError as error:
            problems += error.problems
            reason = "; ".join(problem.message for problem in error.problems)
            outcomes.append(unreadable(candidate.path, candidate.home, reason))
        else:
            files.append(candidate.path)
            if candidate.expected:
                expected |= {candidate.path, candidate.tag}
    for fault in denied:
        if isinstance(fault, PermissionError):  # the others have been removed meanwhile
            reason = f"cannot read the folder: {fault.strerror}"
            problems.append(Problem(reason, Location(Path(fault.filename))))
            outcomes.append(unreadable(fault.filename, str(base), reason))
    ordered = sorted(outcomes, key=lambda outcome: outcome.path)
    return Collection(tuple(ordered), tuple(sorted(files)), tuple(problems), frozenset(expected))


@frozen
class _Candidate:
    """A file that may be a result, in the folder of its tests; `tag` is Testing/TAG for a CTest result.

    `expected` is True for the paths at which CTest, ament and the Python test runners write results.
    """

    path: str
    home: str
    tag: str = ""
    expected: bool = False


def _candidates(base: Path, denied: list[OSError]) -> Iterator[_Candidate]:
    """Yield possible result files; append the reasons for unreadable folders to `denied`."""
    homes: dict[str, str] = {}  # the nearest folder in which CTest ran
    waiting = [str(base)]
    while waiting:
        for folder, names, files in os.walk(waiting.pop(), onerror=denied.append):
            names[:] = sorted(name for name in names if not name.startswith("."))
            if folder == str(base):
                links = (path for name in names if (path := base / name).is_symlink())
                waiting += [str(link) for link in links if is_own_result_dir(link)]
            nearest = folder if "Testing" in names else homes.get(os.path.dirname(folder))  # noqa: PTH120
            if nearest:
                homes[folder] = nearest
            within = Path(folder).relative_to(base).parts
            home = nearest or str(base.joinpath(*within[:1]))
            if os.path.basename(folder) == "Testing" and "TAG" in files:  # noqa: PTH119  (a walk is text)
                tag = f"{folder}/TAG"
                result = last_run(tag)
                if os.path.lexists(result):
                    yield _Candidate(result, home, tag, expected=True)
            expected = _OF_AMENT in within
            for name in sorted((*files, *names)):
                if name.endswith(".xml"):
                    is_expected = expected or (name in _OF_PYTHON and len(within) <= 1)
                    if is_expected or name in files:
                        yield _Candidate(f"{folder}/{name}", home, expected=is_expected)


_OF_AMENT, _OF_PYTHON = "test_results", ("pytest.xml", "unittest.xml")


def last_run(tag: str) -> str:
    """Return the result of the last CTest run, which may be missing; `tag` itself if it names no run."""
    lines = text_or_nothing(tag).splitlines()
    return f"{Path(tag).parent}/{lines[0]}/Test.xml" if lines and is_safe_name(lines[0]) else tag


def _read(found: _Candidate) -> Outcome:
    """Parse a result; raises WorkspaceError if it cannot be read, NotAResultError for other XML files."""
    path = Path(found.path)
    try:
        content = read_file(path)
    except OSError as error:
        if not found.expected and not isinstance(error, PermissionError):  # such as a dangling link
            raise NotAResultError from None
        raise WorkspaceError(Problem(f"cannot read the result: {error.strerror}", Location(path))) from None
    if not found.expected and not mentions(content, "<testsuite"):
        raise NotAResultError
    read = read_ctest if found.tag else read_junit
    try:
        return read(parse_xml(as_utf8(content, path), path), found.path, found.home)
    except (BrokenResultError, NotAResultError) as error:
        if isinstance(error, NotAResultError) and not (
            found.expected and (path.name in _OF_PYTHON or mentions(content, "<testsuite"))
        ):
            raise
        raise WorkspaceError(Problem(f"not a test result: {error}", Location(path))) from None


_CTEST_RUN = re.compile(r"\d{8}-\d{4}")


def result_folder_problems(names: Iterable[str], base: Path) -> Iterator[Problem]:
    """Yield a problem for each result folder in which tests would replace files of others."""
    for name in names:
        folder = base / name
        if is_own_result_dir(folder):
            continue
        places = (*_OF_PYTHON, "Testing", f"{_OF_AMENT}/{name}")
        for path in (folder / place for place in places):
            if os.path.lexists(path) and not _is_of_colcon(path, name):
                message = f"tests of '{name}' would replace '{path}', which forge did not create"
                yield Problem(
                    message, hint="move it away, or choose another folder with '--test-result-base'"
                )


def _is_of_colcon(path: Path, package: str) -> bool:
    """Return whether a path has copies of CTest's results, or JUnit files of this package, as from colcon."""
    if path.is_symlink():
        return False
    if path.name == "Testing":
        runs = [entry for entry in path.iterdir() if entry.name != "TAG"] if path.is_dir() else []
        return Path(last_run(str(path / "TAG"))).is_file() and all(
            _CTEST_RUN.fullmatch(run.name) and run.is_dir() and [*run.iterdir()] == [run / "Test.xml"]
            for run in runs
        )
    if path.is_dir():
        return all(file.suffix != ".xml" or _is_of_colcon(file, package) for file in path.iterdir())
    try:
        root = parse_xml(as_utf8(read_file(path), path), path)
    except (OSError, WorkspaceError):
        return False
    cases = [case for suite in (root, *root.all("testsuite")) for case in suite.all("testcase")]
    classes = [case.attributes.get("classname", "").partition(".")[0] for case in cases]
    return bool(classes) and set(classes) == {package}
