"""The audit: the output of strace, and the comparison with tracked inputs."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from forge.build.audit.accesses import Access, Accesses, AccessKind, parent_processes, read_accesses
from forge.build.audit.comparison import SOURCES, Disk, Tracked, explain, findings, report
from forge.build.audit.ignored_inputs import ROWS, Machine
from forge.build.audit.tracked import counts_as_source, first_missing
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


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ('openat(AT_FDCWD</work>, "a.h", O_RDONLY) = 3</work/a.h>', ("/work/a.h", "read")),
        ('open("/x/a.h", O_RDONLY|O_CLOEXEC) = 3</x/a.h>', ("/x/a.h", "read")),
        ('openat(5</lib/x>, "../a.h", O_RDONLY) = 3</lib/a.h>', ("/lib/a.h", "read")),
        ('openat(AT_FDCWD</work>, "/x", O_RDONLY|O_DIRECTORY) = 3</x>', ("/x", "listed")),
        (
            'openat(AT_FDCWD</work>, "/x/b.h", O_RDONLY) = -1 ENOENT (No such file or directory)',
            ("/x/b.h", "looked for"),
        ),
        ('stat("/x/b.h/c", 0x7f) = -1 ENOTDIR (Not a directory)', ("/x/b.h/c", "looked for")),
        ('newfstatat(AT_FDCWD</work>, "/x/y", {st_mode=S_IFREG|0644, ...}, 0) = 0', ("/x/y", "looked at")),
        ('newfstatat(AT_FDCWD</work>, "/x/y", {st_mode=S_IFDIR|0755, ...}, 0) = 0', ("/x/y", "passed")),
        ('readlink("/x/y", "z", 4096) = 1', ("/x/y", "passed")),
        ('access("//x/./y", R_OK) = 0', ("/x/y", "looked at")),
        (
            'openat(AT_FDCWD</a b\\76>, "\\303\\244 \\"q\\" = 3", O_RDONLY) = 3</a b\\76/\\303\\244>',
            ('/a b>/ä "q" = 3', "read"),
        ),
    ],
)
def test_a_call_is_read(call: str, expected: tuple[str, str]) -> None:
    assert seen(f"7  {call}") == [(*expected, "")]


@pytest.mark.parametrize(
    "call",
    [
        'readlink("/x/y", 0x7f, 4096) = -1 EINVAL (Invalid argument)',
        'newfstatat(3</x>, "", {st_mode=S_IFREG|0644}, AT_EMPTY_PATH) = 0',
        'openat(AT_FDCWD</w>, "/x/log", O_WRONLY|O_APPEND) = 3</x/log>',
        'mkdir("/x", 0777) = -1 EEXIST (File exists)',
        "+++ exited with 0 +++",
        "--- SIGCHLD {si_signo=SIGCHLD} ---",
        'stat("/x", <unfinished ...>',
    ],
)
def test_a_call_that_asks_for_nothing_says_nothing(call: str) -> None:
    assert seen(f"7  {call}") == []


def test_a_call_in_two_halves_is_one() -> None:
    assert seen(
        '7  openat(AT_FDCWD</work>, "/x/a", O_RDONLY <unfinished ...>\n'
        '8  access("/x/b", R_OK) = 0\n'
        "7  <... openat resumed>) = 3</x/a>"
    ) == [("/x/b", "looked at", ""), ("/x/a", "read", "")]


def test_processes_have_the_folder_and_the_program_of_their_parent() -> None:
    """The child of a vfork is seen before the call that makes it ends."""
    assert seen(
        '7  execve("/bin/sh", ["sh"], 0x7 /* 9 vars */) = 0\n'
        '7  chdir("sub") = 0\n'
        "7  vfork( <unfinished ...>\n"
        '8  open("one", O_RDONLY) = 3\n'
        '8  execve("/bin/cat", ["cat"], 0x7 /* 9 vars */) = 0\n'
        '8  open("two", O_RDONLY) = 3\n'
        "7  <... vfork resumed>) = 8\n"
        "7  fchdir(4</other>) = 0\n"
        '7  open("three", O_RDONLY) = 3\n'
    ) == [
        ("/bin/sh", "ran", "sh"),
        ("/work/sub/one", "read", "sh"),
        ("/bin/cat", "ran", "cat"),
        ("/work/sub/two", "read", "cat"),
        ("/other/three", "read", "sh"),
    ]


def test_libraries_of_the_program_itself_are_loaded_and_others_are_read() -> None:
    found = seen(
        '7  execve("/bin/ld", ["ld"], 0x7 /* 9 vars */) = 0\n'
        '7  open("/lib/libbfd.so", O_RDONLY|O_CLOEXEC) = 3\n'
        '7  open("main.o", O_RDONLY) = 3\n'
        '7  open("/lib/libz.so", O_RDONLY) = 3\n'
    )
    assert [kind for _, kind, _ in found] == ["ran", "loaded", "read", "read"]


def test_what_was_made_before_it_was_read_is_no_input() -> None:
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
        ("/ws/src/a/sub/x.h", AccessKind.READ, "cc1"),
        ("/ws/src/a/new.h", AccessKind.MISSED, "cc1"),
        ("/ws/build/a/x.o", AccessKind.READ, "ld"),
        ("/ws/install/b/b.h", AccessKind.READ, "cc1"),
        ("/ws/install/b/new.h", AccessKind.MISSED, "cc1"),
        ("/vendor/known.h", AccessKind.READ, "cc1"),
        ("/vendor/new.h", AccessKind.MISSED, "cc1"),
        ("/vendor", AccessKind.LISTED, "cmake"),
        ("/ws", AccessKind.FOLDER, "cmake"),
    ],
)
def test_what_forge_tracks_is_explained(path: str, kind: AccessKind, program: str) -> None:
    assert explain(Access(path, kind, program), TRACKED, MACHINE, DISK)


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
def test_what_forge_does_not_track_is_not_explained(path: str, kind: AccessKind, program: str) -> None:
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
def test_what_forge_leaves_out_on_purpose_has_a_row(
    path: str, kind: AccessKind, program: str, row: str
) -> None:
    assert explain(Access(path, kind, program), TRACKED, MACHINE, DISK) == row
    assert row in {each.what for each in ROWS}


def test_a_folder_that_is_read_is_listed() -> None:
    access = Access("/home/me/tool/bin", AccessKind.READ, "cmake")
    assert explain(access, TRACKED, MACHINE, replace(DISK, is_folder=lambda _: True)) == (
        "which files there are in the system's own folders"
    )
    assert not explain(access, TRACKED, MACHINE, DISK)


def test_a_compiler_reports_what_it_reads_and_a_check_of_cmake_does_not() -> None:
    """The other headers that a compiler opens are asked for by __has_include."""
    accesses = Accesses(
        {("/usr/include/c++/12/any", AccessKind.READ): "cc1plus", ("/x/y.h", AccessKind.READ): "cc1"},
        frozenset(),
    )
    (found,) = findings("a", StepKind.BUILD, accesses, TRACKED, (MACHINE, DISK))
    assert (found.path, found.kind) == ("/x/y.h", AccessKind.SEEN)
    (found,) = findings("a", StepKind.CONFIGURE, accesses, TRACKED, (MACHINE, DISK))
    assert (found.path, found.kind) == ("/x/y.h", AccessKind.READ)


def test_what_lies_in_a_folder_that_the_build_made_is_its_own() -> None:
    accesses = Accesses(
        {("/x/d/e/f", AccessKind.READ): "cat", ("/x/other", AccessKind.READ): "cat"}, frozenset({"/x/d"})
    )
    assert [one.path for one in findings("a", StepKind.BUILD, accesses, TRACKED, (MACHINE, DISK))] == [
        "/x/other"
    ]


def test_a_name_in_a_folder_that_is_missing_depends_on_the_folder_above() -> None:
    disk = replace(DISK, first_missing=lambda _: "/vendor/include")
    assert explain(Access("/vendor/include/sub/x.h", AccessKind.MISSED, "cc1"), TRACKED, MACHINE, disk)


def test_the_first_part_that_is_missing_is_found(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "file").touch()
    assert first_missing(f"{tmp_path}/a/b/c") == f"{tmp_path}/a/b"
    assert first_missing(f"{tmp_path}/a") == ""


def test_what_lies_beside_a_file_tells_if_it_is_a_source(tmp_path: Path) -> None:
    (tmp_path / "package.xml").touch()
    (tmp_path / "data").mkdir()
    root = str(tmp_path)
    assert counts_as_source(root, f"{root}/data/compile_commands.json")
    assert not counts_as_source(root, f"{root}/compile_commands.json")
    assert not counts_as_source(root, f"{root}/.venv/lib/x.py")
    Path(root, "env").mkdir()
    Path(root, "env", "pyvenv.cfg").touch()
    assert not counts_as_source(root, f"{root}/env/lib/x.py")
    assert counts_as_source(root, root)


def test_a_link_is_where_it_leads() -> None:
    disk = replace(DISK, real=lambda path: path.replace("/link/", "/vendor/"))
    assert explain(Access("/link/known.h", AccessKind.READ, "cc1"), TRACKED, MACHINE, disk) == "recorded"


def test_a_report_says_what_and_what_to_do() -> None:
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


def test_a_report_of_nothing_is_one_line() -> None:
    assert report((), 1) == ("audit: 1 package, no unexpected inputs",)


def test_the_documentation_has_the_same_table() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## What is not tracked")[2]
    first = [line[2:] for line in section.splitlines() if re.match(r"\| (?!not tracked)\S", line)]
    missing = [row.what for row in ROWS if not any(cell.startswith(row.what) for cell in first)]
    assert missing == []
