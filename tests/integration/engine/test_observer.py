"""What the observer logs of real tools is what strace sees of them in the same run."""

import os
import re
import shlex
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

from forge.engine.observation import (
    KINDS_FOR_TESTS,
    LOG_VARIABLE,
    ObservedStep,
    begin_log,
    end_log,
    observe,
    read_log,
)
from forge.engine.observer import compile_library
from tests.conftest import Tree

CALL = re.compile(r"^(\d+) +(\w+)\((.*)\) += (-?\d+)(?: (E\w+))?")
UNFINISHED = re.compile(r"^(\d+) +(.*) <unfinished \.\.\.>$")
RESUMED = re.compile(r"^(\d+) +<\.\.\. \w+ resumed>(.*)$")
AT = re.compile(r"(?:AT_FDCWD|\d+)<([^>]*)>, \"((?:[^\"\\]|\\.)*)\"(.*)")
PLAIN = re.compile(r"\"((?:[^\"\\]|\\.)*)\"(.*)")

OF_THE_C_LIBRARY = re.compile(
    r"/etc/(ld\.so\.(cache|preload)|nsswitch\.conf|passwd|group|host\.conf|resolv\.conf)$"
    r"|/(locale|gconv|locale-langpack|i18n)/|/locale\.alias$|/usr/share/zoneinfo/|/etc/localtime$"
    r"|gconv-modules|/sys/|/proc/|/dev/|/(etc/)?selinux|/etc/(gnutls|crypto-policies|pki)|/malloc\.conf$"
)
"""What the C library opens by itself: its settings, locales, character sets and time zones."""

LIBRARY = re.compile(r"\.so(\.[\d.]+)?$|/(glibc-hwcaps|tls|haswell|x86_64|avx512_1)(/|$)|/lib/lib$|/bin/lib$")
"""What the dynamic linker looks for; the libraries that it has found are logged."""


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = compile_library(tmp_path_factory.mktemp("observer"), os.environ)
    assert found is not None
    return found


def traced(argv: list[str], folder: Path, library: Path) -> tuple[ObservedStep, dict[str, set[str]]]:
    """Run a command below strace and the observer; return what each has seen."""
    log, trace = folder.parent / "log/observed", folder.parent / "trace"
    begin_log(log)
    calls = "trace=%file,%process,getdents64"
    preload = ("-E", f"LD_PRELOAD={library}", "-E", f"{LOG_VARIABLE}={log}")
    command = ("strace", "-f", "-y", "-qq", "-s", "4096", "-e", calls, "-o", str(trace), *preload, *argv)
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    lines = trace.read_text(errors="surrogateescape").splitlines()
    roots = frozenset({int(lines[0].split()[0])})
    return read_log(log, roots, kinds=KINDS_FOR_TESTS), _seen_by_strace(
        lines, str(folder), str(log), str(library)
    )


def _in_order_of_their_beginnings(lines: list[str]) -> list[str]:
    """Whole calls: a child is at work before its parent's `vfork` returns."""
    calls: list[str] = []
    begun: dict[str, int] = {}
    for line in lines:
        if match := UNFINISHED.match(line):
            begun[match[1]] = len(calls)
            calls.append(line.removesuffix(" <unfinished ...>"))
        elif (match := RESUMED.match(line)) and match[1] in begun:
            calls[begun.pop(match[1])] += match[2]
        else:
            calls.append(line)
    return calls


def _seen_by_strace(lines: list[str], folder: str, *own: str) -> dict[str, set[str]]:
    found: dict[str, set[str]] = defaultdict(set)
    folders: dict[str, str] = {}
    for line in _in_order_of_their_beginnings(lines):
        match = CALL.match(line)
        if not match:
            continue
        pid, call, words, result, error = match.groups()
        here = folders.get(pid, folder)
        if call == "getdents64":
            found["listed"].add(words.partition("<")[2].rpartition(">")[0])
            continue
        if call in {"clone", "clone3", "fork", "vfork"}:
            folders.setdefault(result, here)
            continue
        if call == "chdir" and result == "0" and (match := PLAIN.match(words)):
            folders[pid] = os.path.join(here, match[1])
            continue
        at = AT.match(words) or PLAIN.match(words)
        if at is None:
            continue
        *place, name, rest = at.groups()
        path = os.path.join(place[0] if place else here, name)
        path = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
        if not name or path in own or OF_THE_C_LIBRARY.search(path):
            continue
        if error in {"ENOENT", "ENOTDIR"} and not LIBRARY.search(path):
            found["missing"].add(path)
        elif error is None and call in {"open", "openat", "creat"}:
            if "O_DIRECTORY" in rest or os.path.isdir(path):
                continue
            writes = re.search(r"O_(WRONLY|RDWR|CREAT|TRUNC)", rest)
            found["written" if writes else "read"].add(path)
        elif error is None and call == "execve":
            found["executed"].add(os.path.realpath(path))
    return found


FILES = {
    "p/a.c": """#include <stdio.h>
#include "a.h"
#if __has_include("b.h")
#endif
int main(void) { return X; }
""",
    "p/a.h": "#define X 0\n",
    "p/b.cpp": "#include <vector>\n#include <string>\nstd::vector<std::string> v;\nint main() {}\n",
    "p/CMakeLists.txt": """cmake_minimum_required(VERSION 3.18)
project(p C CXX)
file(GLOB x *.txt)
file(READ data.txt d)
add_executable(a a.c)
add_library(b SHARED b.cpp)
execute_process(COMMAND cat data.txt OUTPUT_VARIABLE o)
add_custom_command(
  OUTPUT gen.h COMMAND sh -c "cat ${CMAKE_SOURCE_DIR}/data.txt > gen.h && echo x > side.txt" VERBATIM)
add_custom_target(g ALL DEPENDS gen.h)
install(TARGETS a b)
install(FILES data.txt DESTINATION share)
""",
    "p/data.txt": "data\n",
    "p/Makefile": """all: out.txt
out.txt: data.txt $(wildcard *.c)
\tcat data.txt | tr a b > out.txt
\tcp out.txt copy.txt
""",
    "p/pkg/__init__.py": "",
    "p/pkg/data.txt": "x",
    "p/setup.py": """from setuptools import setup
setup(name='pkg', version='1', packages=['pkg'], package_data={'': ['*.txt']})
""",
    "p/x.pc": "Name: x\nDescription: x\nVersion: 1\nCflags: -Ix\n",
    "p/s.sh": """for f in d*.txt; do while read line; do echo $line; done < $f; done >> all.txt
. ./inc.sh
[ -e nope/x ] || echo no
""",
    "p/inc.sh": """mkdir -p made/deep && mv all.txt made/deep/ && ln -s all.txt made/deep/link
rm -rf made/deep
""",
    "p/r.pl": """open(F, '<', 'data.txt'); print <F>;
opendir(D, '.'); print readdir(D); print -e 'none'; system('cat a.h');
""",
    "p/p.py": """import json, os, subprocess
print(os.listdir('.'), open('a.h').read())
subprocess.run(['cat', 'a.c'])
""",
    "p/g.sh": """git init -q . && git add a.c && git -c user.name=x -c user.email=x@x commit -qm x
git status --short
""",
    "p/crate/Cargo.toml": '[package]\nname = "crate"\nversion = "0.1.0"\nedition = "2021"\n',
    "p/crate/src/main.rs": 'fn main() { println!("{}", include_str!("../../data.txt")); }\n',
    "p/crate/build.rs": 'fn main() { std::fs::read("../data.txt").unwrap(); }\n',
}
COMMANDS = {
    "gcc": "gcc a.c -o a",
    "g++ with a depfile": "g++ -MD -MF b.d -c b.cpp -o b.o",
    "g++ linking": "g++ b.cpp -o b -lm",
    "clang": "clang++ -c b.cpp -o b.o",
    "cmake": "cmake -B build -G Ninja",
    "ninja": "sh -c 'cmake -B build -G Ninja && ninja -C build && cmake --install build --prefix out'",
    "make of cmake": "sh -c 'cmake -B build -G \"Unix Makefiles\" && make -C build'",
    "make": "make",
    "setuptools": f"{sys.executable} setup.py -q bdist_wheel",
    "pkg-config": "env PKG_CONFIG_PATH=. pkg-config --cflags x",
    "git": "sh g.sh",
    "tar": "sh -c 'tar czf x.tgz a.c pkg && mkdir out && tar xzf x.tgz -C out'",
    "sh": "sh s.sh",
    "bash": "bash s.sh",
    "perl": "perl r.pl",
    "python": f"{sys.executable} p.py",
    "an empty environment": "env -i /bin/sh -c '/bin/cat a.c > b.txt'",
    "find": "find . -name '*.txt' -exec cat {} ;",
    "cargo": "cargo build -q --offline --manifest-path crate/Cargo.toml",
}


@pytest.mark.needs("strace", "gcc", "clang++", "cmake", "ninja", "pkg-config", "git", "cargo")
@pytest.mark.parametrize("name", COMMANDS)
def test_the_observer_sees_what_strace_sees(name: str, tree: Tree, library: Path) -> None:
    folder = tree(FILES) / "p"
    step, strace = traced(shlex.split(COMMANDS[name]), folder, library)
    seen = observe(step.processes, step.blind)
    assert not seen.blind
    real = {
        kind: {_real(path) for path in getattr(seen, kind)}
        for kind in ("read", "written", "listed", "missing", "executed", "loaded")
    }
    searched = (each for process in step.processes for each in process.records if each[1] == "l")
    real["listed"] |= {_real(path) for _, _, path in searched}
    inputs = real["read"] | real["written"] | real["executed"] | real["loaded"]
    unseen = {path for path in strace["read"] if _real(path) not in inputs and not LIBRARY.search(path)}
    assert not unseen
    assert {path for path in strace["written"] if _real(path) not in real["written"]} == set()
    assert {
        path
        for path in strace["listed"]
        if path not in real["listed"] | real["written"] | seen.folders and not OF_THE_C_LIBRARY.search(path)
    } == set()
    assert {path for path in strace["executed"] if path not in real["executed"]} == set()
    covered = real["missing"] | real["written"] | {_real(path) for path in seen.folders}
    missed = [path for path in strace["missing"] if not _is_covered(path, covered)]
    assert missed == []


def _real(path: str) -> str:
    return os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))


def _is_covered(path: str, missing: set[str]) -> bool:
    """Tell if a path, or a folder of it, was missing."""
    while path != "/":
        if path in missing:
            return True
        path = os.path.dirname(path)
    return False


def test_a_server_that_outlives_its_step_keeps_running(tmp_path: Path, library: Path) -> None:
    """Neither does it fail, nor does the removed log grow."""
    log = tmp_path / "log/observed"
    begin_log(log)
    code = "import os\ninput()\nfor n in range(50_000): os.path.exists(f'/none{n}')\nprint('ok')"
    environment = {**os.environ, "LD_PRELOAD": str(library), LOG_VARIABLE: str(log)}
    with subprocess.Popen(
        (sys.executable, "-c", code),
        env=environment,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as server:
        while not read_log(log, frozenset({server.pid})).processes:
            pass
        with log.open("rb") as kept:
            end_log(log)
            begin_log(log)
            assert server.communicate("go\n")[0] == "ok\n"
            assert os.fstat(kept.fileno()).st_blocks * 512 < 4 << 20
    assert server.returncode == 0
