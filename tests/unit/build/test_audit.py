"""The audit: the output of strace, and the comparison with tracked inputs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from forge.build.audit.accesses import Access, Accesses, AccessKind, parent_processes, read_accesses
from forge.build.audit.comparison import SOURCES, Disk, Tracked, explain, findings, report
from forge.build.audit.ignored_inputs import ROWS, Machine
from forge.build.audit.tracked import counts_as_source
from forge.build.tasks import StepKind

PAGE = Path(__file__).parents[3] / "docs/explanation/change-detection.md"
MACHINE = Machine("/home/me", "/scratch", frozenset({"/home/me/tool/bin"}), frozenset({"/checkout"}))
DISK = Disk(lambda path: path, lambda path: path, lambda _: False)
TRACKED = Tracked(
    folders={"/ws/src/a": SOURCES, "/ws/build/a": "its build folder"},
    files=frozenset({"/vendor/known.h", "/ws/install/b/b.h"}),
    names=frozenset({"/vendor"}),
    prefixes={"/ws/install/b": "names in its needs' prefixes"},
    parents=frozenset({"/", "/ws", "/vendor"}),
    owners={"/ws/install/c/c.h": "c"},
    is_source=counts_as_source,
)


def seen(text: str, cwd: str = "/work") -> list[tuple[str, str, str]]:
    """Return path, kind and program of each access that a trace tells of, without what was made."""
    lines = text.strip().splitlines()
    found = read_accesses(lines, cwd, parent_processes(lines)).found
    return [(path, kind.value, program) for (path, kind), program in found.items()]


def test_a_call_in_two_halves_is_one() -> None:
    assert seen(
        '7  openat(AT_FDCWD</work>, "/x/a", O_RDONLY <unfinished ...>\n'
        '8  access("/x/b", R_OK) = 0\n'
        "7  <... openat resumed>) = 3</x/a>"
    ) == [("/x/b", "looked at", ""), ("/x/a", "read", "")]


def test_files_created_before_they_were_read_are_not_inputs() -> None:
    lines = [
        '7  openat(AT_FDCWD</w>, "/scratch/x.s", O_RDWR|O_CREAT|O_EXCL, 0600) = 3</scratch/x.s>',
        '8  openat(AT_FDCWD</w>, "/scratch/x.s", O_RDONLY) = 3</scratch/x.s>',
        '8  openat(AT_FDCWD</w>, "/state", O_RDONLY) = 3</state>',
        '8  rename("/state.new", "/state") = 0',
        '8  mkdir("/scratch/d", 0700) = 0',
    ]
    accesses = read_accesses(lines, "/w", {})
    assert [path for path, _ in accesses.found] == ["/state"]
    assert accesses.made == {"/scratch/x.s", "/state", "/scratch/d"}


@pytest.mark.parametrize(
    ("path", "kind", "program"),
    [
        ("/vendor/other.yaml", AccessKind.READ, "python3"),
        ("/elsewhere/new.h", AccessKind.MISSED, "cc1plus"),
        ("/ws/install/b/extra.h", AccessKind.READ, "cc1"),
        ("/ws/install/c/c.h", AccessKind.READ, "cc1"),
        ("/ws/src/c/c.h", AccessKind.READ, "cc1"),
        ("/usr/share/data/x.yaml", AccessKind.READ, "python3"),
        ("/usr/lib/x86_64-linux-gnu/libz.a", AccessKind.READ, "ld"),
        ("/usr/lib/x86_64-linux-gnu/libz.so", AccessKind.READ, "ld"),
        ("/home/me/.config/tool.ini", AccessKind.READ, "tool"),
        ("/home/me/tool/data/x", AccessKind.MISSED, "tool"),
        ("/scratch/left/over", AccessKind.MISSED, "tool"),
        ("/scratch/left", AccessKind.READ, "tool"),
        ("/opt/vendor/bin/generator", AccessKind.RAN, "generator"),
        ("/opt/vendor/include/x.h", AccessKind.MISSED, "cc1"),
    ],
)
def test_untracked_accesses_have_no_explanation(path: str, kind: AccessKind, program: str) -> None:
    assert explain(Access(path, kind, program), TRACKED, MACHINE, DISK) == ""


@pytest.mark.parametrize(
    ("path", "kind", "program", "row"),
    [
        ("/ws/.git/HEAD", AccessKind.READ, "cmake", "git"),
        ("/ws/src/a/.git", AccessKind.FOLDER, "git", "git"),
        ("/home/me/anything", AccessKind.READ, "git", "git"),
        ("/proc/cpuinfo", AccessKind.READ, "python3", "the kernel and devices"),
        ("/etc/localtime", AccessKind.READ, "python3", "settings of the machine"),
        ("/usr/lib/libfoo.so.1", AccessKind.LOADED, "ld", "shared libraries that the tools themselves load"),
        ("/lib/x86_64-linux-gnu/libc.so.6", AccessKind.READ, "ld", "the C and C++ runtime"),
        ("/usr/lib/x86_64-linux-gnu/crti.o", AccessKind.READ, "ld", "the C and C++ runtime"),
        ("/bin/sh", AccessKind.RAN, "sh", "the shell and the usual small programs"),
        ("/usr/include/foo.h", AccessKind.MISSED, "cc1", "which files there are in the system's own folders"),
        (
            "/opt/FooConfig.cmake",
            AccessKind.MISSED,
            "cmake",
            "which files there are in the system's own folders",
        ),
        (
            "/home/me/tool/lib/cmake",
            AccessKind.LISTED,
            "cmake",
            "which files there are in the system's own folders",
        ),
        ("/home/me/.cmake/packages/a", AccessKind.MISSED, "cmake", "settings in the home directory"),
        ("/scratch/cc1234.s", AccessKind.MISSED, "cc", "names in the temporary folder"),
        (
            "/ws/install/b/lib/__pycache__/x.pyc",
            AccessKind.READ,
            "python3",
            "bytecode and what editors leave",
        ),
        ("/ws/src/a/__pycache__/x.pyc", AccessKind.READ, "python3", "bytecode and what editors leave"),
    ],
)
def test_deliberately_ignored_accesses_are_listed_in_the_table(
    path: str, kind: AccessKind, program: str, row: str
) -> None:
    assert explain(Access(path, kind, program), TRACKED, MACHINE, DISK) == row
    assert row in {each.what for each in ROWS}


def test_the_report_lists_untracked_paths_with_hints() -> None:
    accesses = Accesses(
        {
            ("/x/calib.yaml", AccessKind.READ): "python3",
            ("/ws/install/c/c.h", AccessKind.READ): "cat",
            **{(f"/x/inc/{name}", AccessKind.MISSED): "cc1" for name in "abcd"},
        },
        frozenset(),
    )
    found = findings("a", StepKind.BUILD, accesses, TRACKED, (MACHINE, DISK))
    assert report(found, 2) == (
        "a: read /ws/install/c/c.h (build step, by cat)",
        "  hint: add <depend>c</depend> to package.xml",
        "a: read /x/calib.yaml (build step, by python3)",
        "  hint: add_custom_command(... DEPENDS FILE) lets forge track it",
        "a: looked for 4 names in /x/inc, such as a (build step, by cc1)",
        "  hint: forge cannot detect new files there; after adding one, rebuild with --force",
        "audit: 1 of 2 packages uses 6 paths that forge does not track",
    )


def test_the_documentation_lists_every_ignored_kind_of_input() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## What is not tracked")[2]
    first = [line[2:] for line in section.splitlines() if re.match(r"\| (?!not tracked)\S", line)]
    missing = [row.what for row in ROWS if not any(cell.startswith(row.what) for cell in first)]
    assert missing == []
