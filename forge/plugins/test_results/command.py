"""`forge test-result`: summarize the result files of tests."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from forge.base.errors import Problem, WorkspaceError, print_problem
from forge.base.frozen import frozen
from forge.base.layout import forge_command
from forge.base.options import flag, option
from forge.build.folder_marks import is_own_result_dir, is_removed_package, sources_in
from forge.build.journal import open_journal
from forge.cli import options as shared
from forge.testing.collecting import Collection, collect
from forge.testing.outcomes import Case, Counts, Outcome, counted_once
from forge.workspace.discovery import discover


def _folder(path: str) -> Path:
    """Return the path of an existing folder; raises ValueError."""
    if not Path(path).is_dir():
        what = "is not a folder" if Path(path).exists() else "does not exist"
        raise ValueError(f"'{path}' {what}")
    return Path(path)


@frozen
class Options:
    test_result_base: Path | None = option(
        "folder to search for result files (default: the build folder)", parse=_folder, metavar="DIR"
    )
    all: bool = flag("show result files without failures, too")
    result_files_only: bool = flag("print only the paths of result files")
    verbose: bool = flag("show the message of each failed test, and why tests were skipped")
    delete: bool = flag("delete result files after confirmation")
    delete_yes: bool = flag("delete result files without confirmation")
    json: bool = flag("print one JSON object")
    build_base: str = shared.build_base_option()
    profile: str | None = shared.profile_option()
    origin: str = os.curdir


def run(options: Options) -> int:
    """Show or delete results; returns 1 if a test failed."""
    base = options.test_result_base or Path(options.build_base)
    if options.test_result_base is None and not base.is_dir():
        command = forge_command("test", options.profile)
        hint = f"run '{command}' first, or name the folder with '--test-result-base'"
        raise WorkspaceError(Problem(f"the folder '{base}' does not exist", hint=hint))
    collection = collect(base)
    if options.delete or options.delete_yes:
        return _delete(collection, base, options)
    gone = _gone(base)
    counted = [one for one in collection.outcomes if _package_of(one.path, base) not in gone]
    ignored = {_package_of(one.path, base) for one in collection.outcomes} & gone
    for name in sorted(ignored):
        message = f"ignoring results of '{name}', which is no longer in the workspace"
        print_problem(Problem(message, hint=forge_command("clean stale", options.profile)), "warning")
    for problem in collection.problems:
        if problem.location and _package_of(str(problem.location.path), base) not in gone:
            print_problem(problem)
    named = [replace(one, path=shared.displayed(one.path, options.origin)) for one in counted]
    outcomes = counted_once(named)
    shown = [outcome for outcome in outcomes if outcome.counts.bad or options.all]
    total = _sum(outcomes)
    if options.json:
        print(json.dumps({"summary": asdict(total), "results": [_as_json(each) for each in shown]}, indent=2))
    elif options.result_files_only:
        print(*(outcome.path for outcome in shown), sep="\n", end="\n" if shown else "")
    else:
        if not collection.outcomes:
            command = forge_command("test", options.profile)
            hint = f"run '{command}', or name the folder with '--test-result-base'"
            print_problem(Problem(f"no test results in '{base}'", hint=hint), "warning")
        raw = _sum(counted)
        for outcome in shown:
            print(f"{outcome.path}: {outcome.counts}")
            for case in outcome.cases if options.verbose else ():
                print(*details(case), sep="\n")
        if shown:
            print()
        print(f"Summary: {total}")
        skipped = [test for outcome in outcomes for test in outcome.skipped] if options.verbose else []
        if skipped:
            print("Skipped:")
        for test in skipped:
            print(f"- {' '.join(filter(None, (test.suite, test.name)))}: {test.text}")
        if options.verbose and raw != total:
            print(f"Files: {raw} (ament's tests twice, as CTest and JUnit results)")
    return int(total.bad)


def details(case: Case) -> list[str]:
    """Return colcon's lines for a case; the first one starts with a dash."""
    place = f"({case.file}{f':{case.line}' if case.line else ''})" if case.file else ""
    lines = [" ".join(filter(None, (case.suite, case.name, place)))]
    for label, texts in (
        ("error message", case.errors),
        ("failure message", case.failures),
        ("stdout output", case.stdout),
        ("stderr output", case.stderr),
    ):
        if texts:
            lines.append(f"<<< {label}")
            lines += [f"  {line}" for text in texts for line in text.strip("\r\n").splitlines()]
            lines.append(">>>")
    return [f"{'-' if number == 0 else ' '} {line}" for number, line in enumerate(lines)]


def _as_json(outcome: Outcome) -> dict[str, object]:
    cases = [
        {
            "suite": case.suite,
            "name": case.name,
            "file": case.file or None,
            "line": int(case.line) if case.line.isdecimal() else None,
            "errors": list(case.errors),
            "failures": list(case.failures),
        }
        for case in outcome.cases
    ]
    return {"path": outcome.path, **asdict(outcome.counts), "cases": cases}


def _removable_results(found: Collection, base: Path) -> tuple[str, ...]:
    """Return the result files to delete: all in marked folders, elsewhere those at the expected paths.

    Files in sources, such as test data, are kept.
    """

    def is_removable(path: str) -> bool:
        for folder in Path(path).parents:
            if is_own_result_dir(folder):
                return True
            if sources_in(folder):
                return False
            if folder == base:
                break
        return path in found.expected

    return tuple(filter(is_removable, found.files))


def _delete(found: Collection, base: Path, options: Options) -> int:
    """Delete result files after confirmation; the end of input aborts."""
    files = _removable_results(found, base)
    for path in sorted({*found.files} - {*files}):
        message = f"kept '{shared.displayed(path, options.origin)}', which is not a result of forge's tests"
        print_problem(Problem(message), "warning")
    if not files:
        print("No result files found to delete")
        return 0
    print(*(f"- {shared.displayed(path, options.origin)}" for path in files), sep="\n")
    while not options.delete_yes:
        print(f"Delete these {len(files)} files? [y/n] ", end="", flush=True)
        answer = sys.stdin.readline()
        if answer.strip().lower() == "y":
            break
        if not answer or answer.strip().lower() == "n":
            print("Aborted")
            return 0
    for path in files:
        Path(path).unlink(missing_ok=True)
    print(f"Deleted {len(files)} files")
    return 0


def _sum(outcomes: Sequence[Outcome]) -> Counts:
    return sum((outcome.counts for outcome in outcomes), Counts())


def _gone(base: Path) -> frozenset[str]:
    """Return the packages built below `base` that are no longer in the workspace."""
    lost = {
        name
        for name, record in open_journal(base).records.items()
        if record.source and is_removed_package(Path(record.source))
    }
    # A package may have been moved within the workspace.
    return frozenset(lost - discover(Path.cwd(), ["."], os.environ).packages.keys() if lost else ())


def _package_of(path: str, base: Path) -> str:
    """Return the folder directly below `base` that contains a result: usually that of a package.

    It is '' for `base` itself, which may be unreadable.
    """
    return next(iter(Path(path).relative_to(base).parts), "")
