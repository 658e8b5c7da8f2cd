"""Warn of packages that have changed since their last build, or were built without tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from forge.base.errors import GroupedProblems, Location, Problem
from forge.base.layout import FILE_TABLE, Layout
from forge.base.text import listed
from forge.build.inputs.fingerprints import FileTable, fingerprint_tree
from forge.build.journal import open_journal
from forge.build.records import read_record
from forge.plugins.explain.changes import changed_sources
from forge.toolchain.cmake_variables import was_built_without_tests
from forge.workspace.load import LoadedWorkspace
from forge.workspace.model import CMAKE_TYPES


def changed_since_build(
    needs: Mapping[str, Sequence[str]], loaded: LoadedWorkspace, layout: Layout
) -> tuple[Problem, ...]:
    """Return warnings for packages that changed since their last build.

    Tests use that build, except Python tests, which run in the source folder, and symbolic links, which lead
    there.
    """
    records = open_journal(layout.build).records
    table = FileTable(layout.build / FILE_TABLE)
    python = {name for name, package in loaded.packages.items() if "python" in package.build_type}
    used = {
        need
        for name, wanted in needs.items()
        for need in wanted
        if need not in python or (need != name and not layout.symlink)
    }
    problems = []
    for name in sorted(used):
        record, package = records.get(name), loaded.packages.get(name)
        if package is None or package.embedded or record is None:
            continue
        if not record.complete and name in needs:  # packages that are not tested do not matter
            continue
        home = str(loaded.workspace.root / package.path)
        if not record.complete:
            message = f"the last build of '{name}' failed or was stopped, so that tests use outdated files"
            many = "the last builds of {} failed or were stopped, so that tests use outdated files"
        else:
            fingerprint, sources = fingerprint_tree(home, table, record.sources)
            if fingerprint.digest == record.sources.digest:
                continue
            last = read_record(layout.build_dir(name)) if record.began else None
            what = changed_sources(home, sources, last, table)
            message = f"'{name}' has changed since its last build, so that tests use outdated files: {what}"
            many = "{} have changed since their last build, so that tests use outdated files"
        command = layout.command("build")
        problems.append(
            Problem(message, Location(package.path), command, GroupedProblems(many, name, command))
        )
    return tuple(problems)


def built_without_tests(names: Sequence[str], loaded: LoadedWorkspace, layout: Layout) -> tuple[Problem, ...]:
    """Return a warning for the packages that were built without tests."""
    here = (name for name in names if loaded.packages[name].build_type in CMAKE_TYPES)
    without = [name for name in here if was_built_without_tests(layout.build_dir(name))]
    if not without:
        return ()
    message = f"{listed(without)} {'was' if len(without) == 1 else 'were'} built without tests"
    hint = "build without -DBUILD_TESTING=OFF and '--no-test-dependencies' to test"
    return (Problem(message, hint=f"{hint} {'it' if len(without) == 1 else 'them'}"),)
