"""What a build asks of the system, counted by strace: it may not grow unnoticed.

Counts are the same on every machine, as times are not. What one package costs is the difference between
workspaces of twenty and of ten packages: what starting costs, and the version of Python, do not matter. Calls
are forge's own; of the programs that it starts, each start counts.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.bench.workspaces import write_ament_workspace
from tests.snippets import surroundings

pytestmark = pytest.mark.needs("strace", "cmake", "ninja", "g++")

KINDS = {
    "stat": "newfstatat stat lstat statx access faccessat faccessat2 readlink",
    "open": "open openat",
    "start": "execve",
}
KIND = {call: kind for kind, calls in KINDS.items() for call in calls.split()}
CALL = re.compile(r'^(\d+) +(\w+)\((?:AT_FDCWD, |\d+, )?"([^"]*)"?(.*)')
UNFINISHED, RESUMED = " <unfinished ...>", " resumed>"

NOTHING_CHANGED = {
    "files read": 2,
    "folders listed": 5,
    "stat calls": 60,
}
"""Per package of 5 source files in 3 folders and 28 installed ones: each is looked at about once."""

LINE_CHANGED = {"files read": 415, "folders listed": 60, "stat calls": 3150}
"""What forge itself asks beyond a build of nothing when a line has changed.

Most files are modules that only a build imports. Installed files that are compared twice are read twice. Of
the folders 36 are the prefix of before, compared with the new one and removed. Many of the stat calls are for
files of the system that the compilers were observed to read, and for those that they looked for in vain,
which may be links whose target is missing. Below one more folder there are about 16 more.
"""

ONE_LINE = {"cmake": 2, "ninja": 1, "cc1plus": 1, "c++": 3}
"""Programs for a changed line: build and install; one object, its library, the program that links that."""

ALL_PROGRAMS = 17
"""With what those start: `as`, `ld` and its wrapper, shells of ninja and of `compile_cxx.sh`, and forge."""


class Counts:
    """The system calls of one command, and the programs that it and all below it started."""

    def __init__(self, trace: str) -> None:
        calls = [call for call in map(CALL.match, _whole(trace)) if call and call[2] in KIND]
        started = [call for call in calls if KIND[call[2]] == "start" and "= -1" not in call[4]]
        self.programs = Counter(Path(call[3]).name for call in started)
        self.configured = sum(
            Path(call[3]).name == "cmake" and not re.search(r"--(build|install)", call[4]) for call in started
        )
        others = {call[1] for call in started[1:]}
        self.of = Counter(_kind(call) for call in calls if call[1] not in others)

    def __sub__(self, other: Counts) -> dict[str, int]:
        """Return how much more of each kind there is."""
        return {kind: self.of[kind] - other.of[kind] for kind in NOTHING_CHANGED}


def _kind(call: re.Match[str]) -> str:
    if KIND[call[2]] == "start":
        return "start"
    if call[3].startswith(("/proc/", "/sys/")):
        return "the state of the machine"  # it is asked the oftener the longer it takes
    if KIND[call[2]] == "stat":
        return "stat calls" if call[3] else "open files looked at"
    return "folders listed" if "O_DIRECTORY" in call[4] else "files read"


def _whole(trace: str) -> Iterator[str]:
    """Yield a line for each call: one during which another process called is written in two halves."""
    begun: dict[str, str] = {}
    for line in trace.splitlines():
        process = line.partition(" ")[0]
        if line.endswith(UNFINISHED):
            begun[process] = line.removesuffix(UNFINISHED)
        elif RESUMED in line:
            yield begun.pop(process, "") + line.partition(RESUMED)[2]
        else:
            yield line


def counted(workspace: Path, variables: Mapping[str, str]) -> Counts:
    trace = workspace.with_suffix(".trace")
    # '?': a call that this machine does not have is no fault.
    strace = ("strace", "-f", "-qq", "-s", "4096", "-o", trace, "-e", f"trace=?{',?'.join(KIND)}")
    argv = (*strace, sys.executable, "-m", "forge", "build")
    subprocess.run(argv, cwd=workspace, env=dict(variables), check=True, capture_output=True)
    return Counts(trace.read_text(encoding="utf-8", errors="replace"))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, str]]:
    """Return two built workspaces of ten and of twenty packages, and the environment of their builds."""
    root = tmp_path_factory.mktemp("counts")
    variables = surroundings(root)
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    # CMake looks below the prefix of each folder of PATH, and forge at where it may look.
    variables["PATH"] = f"{Path(sys.executable).parent}:/usr/bin:/bin"
    places = []
    for packages in (10, 20):
        places.append(write_ament_workspace(root / f"of_{packages}", packages))
        for _ in range(2):  # the second build settles what the first left to it
            argv = (sys.executable, "-m", "forge", "build")
            subprocess.run(argv, cwd=places[-1], env=variables, check=True, capture_output=True)
    return places[0], places[1], variables


def test_an_up_to_date_build_starts_no_process_and_stats_each_file_once(
    built: tuple[Path, Path, dict[str, str]],
) -> None:
    small, large, variables = built
    few, many = counted(small, variables), counted(large, variables)
    assert sum(many.programs.values()) == 1
    more = {kind: count / 10 for kind, count in (many - few).items()}
    assert all(more[kind] <= NOTHING_CHANGED[kind] for kind in more), more


def test_one_changed_line_starts_only_necessary_processes(
    built: tuple[Path, Path, dict[str, str]],
) -> None:
    small, _, variables = built
    nothing = counted(small, variables)
    source = small / "src/bench_0009/src/library.cpp"
    source.write_text(source.read_text(encoding="utf-8") + "// a word\n", encoding="utf-8")
    counts = counted(small, variables)
    assert counts.configured == 0
    assert {name: counts.programs[name] for name in ONE_LINE} == ONE_LINE, counts.programs
    assert sum(counts.programs.values()) <= ALL_PROGRAMS, counts.programs
    more = counts - nothing
    assert all(more[kind] <= LINE_CHANGED[kind] for kind in more), more
