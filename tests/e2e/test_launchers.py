"""Builds of real packages with ccache and distcc."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT, surroundings

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "ninja", "make", "g++")]

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} CXX)
add_library({name} SHARED {sources})
install(TARGETS {name})
"""
SOURCE = "#include <string>\nstd::string {name};\n"
PATIENCE = 60


def package(name: str, files: int = 1) -> dict[str, str]:
    """Return a package with as many sources."""
    names = [f"{name}_{number}" for number in range(files)]
    return {
        f"src/{name}/package.xml": manifest_text(name, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": CMAKE.format(
            name=name, sources=" ".join(f"{one}.cpp" for one in names)
        ),
        **{f"src/{name}/{one}.cpp": SOURCE.format(name=one) for one in names},
    }


def installed(root: Path) -> dict[str, bytes]:
    base = root / "install"
    return {
        str(path.relative_to(base)): path.read_bytes() for path in sorted(base.rglob("*")) if path.is_file()
    }


def built_plainly(forge: Forge, root: Path, *names: str) -> dict[str, bytes]:
    """Return what is installed when packages are built once more, from nothing and without a launcher."""
    for name in names:
        shutil.rmtree(root / "build" / name)
        shutil.rmtree(root / "install" / name)
    ran = forge("build", "--packages-select", *names, cwd=root)
    assert f"Summary: {len(names)} package" in ran.out
    return installed(root)


def launcher_of(root: Path, name: str) -> list[str]:
    """Return what starts the C++ compiler in a build folder: by CMake's cache, and by ninja's rules."""
    cache = (root / "build" / name / "CMakeCache.txt").read_text()
    rules = (root / "build" / name / "CMakeFiles" / "rules.ninja").read_text()
    found = [line for line in cache.splitlines() if line.startswith("CMAKE_CXX_COMPILER_LAUNCHER:")]
    return [line.partition("=")[2] for line in found] + [
        word for word in ("ccache", "distcc") if f"/{word} " in rules
    ]


@pytest.mark.needs("ccache")
def test_ccache_is_shared_between_workspaces(forge: Forge, tmp_path: Path) -> None:
    """Elsewhere all is in the cache, what includes generated headers too, and what comes is the same."""
    env = {"CCACHE_DIR": str(tmp_path / "cache")}
    words = ("--packages-up-to", "robot_motion")
    roots = tmp_path / "one", tmp_path / "another place"
    said = []
    for root in roots:
        shutil.copytree(ROOT / "examples_ws/src", root / "src")
        ran = forge("build", *words, "--compiler-launcher", "ccache", "--timings", cwd=root, env=env)
        assert ran.code == 0, ran.err
        said += [line.strip() for line in ran.out.splitlines() if "ccache" in line]
    assert said == [
        "ccache: 0 of 2 compilations from the cache",
        "ccache: 2 of 2 compilations from the cache",
    ]
    events = [
        json.loads(line) for line in (roots[1] / "log/latest_build/events.jsonl").read_text().splitlines()
    ]
    told = next(event for event in events if event["event"] == "Launcher")
    del told["time"]
    assert told == {"event": "Launcher", "launcher": "ccache", "compilations": 2, "from_cache": 2}
    page = (roots[1] / "log/latest_build/timings.html").read_text()
    assert "<p>ccache: 2 of 2 compilations from the cache.</p>" in page
    cached = installed(roots[1])
    assert built_plainly(forge, roots[1], "robot_motion") == cached


@pytest.mark.needs("ccache")
@pytest.mark.parametrize(("words", "hits"), [((), 0), (("--cache", "packages"), 1)])
def test_debug_information_without_paths_is_shared(
    forge: Forge, tree: Tree, words: tuple[str, ...], hits: int
) -> None:
    """Else a debugger would look for sources where another workspace is, or was."""
    root = tree({f"{place}/{name}": text for place in "ab" for name, text in package("one").items()})
    env = {"CCACHE_DIR": str(root / "cache")}
    words = ("--compiler-launcher", "ccache", *words, "--cmake-args", "-DCMAKE_BUILD_TYPE=Debug")
    for place, expected in (("a", 0), ("b", hits)):
        out = forge("build", *words, cwd=root / place, env=env).out
        assert f"ccache: {expected} of 1 compilation from the cache" in out
    library = (root / "b/install/one/lib/libone.so").read_bytes()
    assert str(root / "a").encode() not in library


@pytest.mark.needs("ccache")
def test_the_package_cache_does_not_depend_on_the_launcher(forge: Forge, tree: Tree) -> None:
    root = tree(package("one"))
    env = {"CCACHE_DIR": str(root / "cache"), "FORGE_CACHE_DIR": str(root / "packages")}
    ran = forge("build", "--cache", "--compiler-launcher", "ccache", cwd=root, env=env)
    assert "ccache: 0 of 1 compilation from the cache" in ran.out
    for name in ("build", "install"):
        shutil.rmtree(root / name)
    ran = forge("build", "--cache", cwd=root, env=env)
    assert "1 package came from the cache" in ran.out


@pytest.mark.needs("ccache")
def test_changing_the_launcher_rebuilds_nothing(forge: Forge, tree: Tree) -> None:
    """It does not change what is made; what is built next, for whatever reason, is built with it."""
    root = tree({**package("one"), **package("two")})
    env = {"CCACHE_DIR": str(root / "cache")}
    assert forge("build", cwd=root, env=env).code == 0
    assert launcher_of(root, "one") == []
    ran = forge("build", "--mixin", "ccache", cwd=root, env=env)
    assert "Summary: 0 packages finished, 2 packages unchanged" in ran.out
    (root / "src/one/one_0.cpp").write_text("int changed;\n")
    ran = forge("build", "--mixin", "ccache", cwd=root, env=env)
    assert "Summary: 1 package finished, 1 package unchanged" in ran.out
    assert "ccache: 0 of 1 compilation from the cache" in ran.out
    assert launcher_of(root, "one") == ["/usr/bin/ccache", "ccache"]
    assert launcher_of(root, "two") == []
    (root / "src/one/one_0.cpp").write_text("int changed_again;\n")
    assert "ccache" not in forge("build", cwd=root, env=env).out
    assert launcher_of(root, "one") == []


@pytest.mark.needs("ccache", "distcc")
def test_user_definitions_take_precedence(forge: Forge, tree: Tree) -> None:
    root = tree(package("one"))
    env = {"CCACHE_DIR": str(root / "cache")}
    own = "-DCMAKE_CXX_COMPILER_LAUNCHER=/usr/bin/ccache"
    words = ("--compiler-launcher", "distcc", "--cmake-args", own)
    ran = forge("build", *words, cwd=root, env={**env, "DISTCC_HOSTS": "127.0.0.1:1/2"})
    assert ran.code == 0, ran.err
    assert launcher_of(root, "one") == ["/usr/bin/ccache", "ccache"]


@pytest.mark.needs("ccache")
@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_a_changed_header_is_detected_for_cached_objects(forge: Forge, tree: Tree, generator: str) -> None:
    """Ccache makes paths below the workspace relative, in lists of what a source includes as well."""
    root = tree(
        {
            "src/one/package.xml": manifest_text("one", build_type="cmake"),
            "src/one/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(one CXX)\n"
            "add_subdirectory(deep)\n",
            "src/one/deep/CMakeLists.txt": "add_executable(one one.cpp)\n"
            "target_include_directories(one PRIVATE ${PROJECT_SOURCE_DIR}/include)\n"
            "install(TARGETS one DESTINATION bin)\n",
            "src/one/deep/one.cpp": '#include "number.hpp"\nint main() { return NUMBER; }\n',
            "src/one/include/number.hpp": "#define NUMBER 3\n",
        }
    )
    env = {"CCACHE_DIR": str(root / "cache")}
    words = ("--compiler-launcher", "ccache", "--cmake-args", f"-G{generator}")
    for code in (3, 3, 5):
        if code == 3:
            shutil.rmtree(root / "build", ignore_errors=True)
        (root / "src/one/include/number.hpp").write_text(f"#define NUMBER {code}\n")
        assert forge("build", *words, cwd=root, env=env).code == 0
        assert subprocess.run([root / "install/one/bin/one"], check=False).returncode == code


@pytest.mark.needs("ccache")
def test_errors_name_files_as_without_ccache(forge: Forge, tree: Tree) -> None:
    root = tree({**package("one"), "src/one/one_0.cpp": "int wrong( {\n"})
    env = {"CCACHE_DIR": str(root / "cache")}
    plain = forge("build", cwd=root, env=env)
    cached = forge("build", "--compiler-launcher", "ccache", cwd=root, env=env)
    place = f"{root}/src/one/one_0.cpp:1:13: error:"
    assert (place in plain.err, place in cached.err) == (True, True)
    assert first_error(cached) == first_error(plain)


def first_error(ran: Ran) -> list[str]:
    lines = ran.err.splitlines()
    begin = next(number for number, line in enumerate(lines) if "first error" in line)
    return [line for line in lines[begin:] if line.startswith("    ")]


@dataclass(frozen=True, slots=True)
class Server:
    """A distccd on this machine, what it logs, and where it listens."""

    process: subprocess.Popen[bytes]
    log: Path
    port: int

    @property
    def compiled(self) -> int:
        return self.log.read_text(errors="replace").count(" COMPILE_OK ")

    def end(self) -> None:
        """Kill it with the children that it keeps ready."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@contextmanager
def servers(folder: Path, count: int) -> Iterator[list[Server]]:
    """Run distccd on free ports of the loopback, as many as asked for; they end in any case."""
    running: list[Server] = []
    try:
        running += [started(folder / f"server_{number}.log") for number in range(count)]
        for server in running:
            wait_for(partial(answers, server.port), server)
        yield running
    finally:
        for server in running:
            if server.process.poll() is None:
                server.end()


def started(log: Path) -> Server:
    """Start one server. It gives up root's rights, so the log is opened for it."""
    port = free_port()
    words = ("--no-detach", "--daemon", "--log-stderr", "--log-level", "info", "--jobs", "4")
    with log.open("wb") as stderr:
        process = subprocess.Popen(
            ["distccd", *words, "--listen", "127.0.0.1", "--allow", "127.0.0.1", "--port", str(port)],
            env={"PATH": os.environ["PATH"], "TMPDIR": "/tmp"},
            cwd="/",
            stdin=subprocess.DEVNULL,
            stdout=stderr,
            stderr=stderr,
            start_new_session=True,
        )
    return Server(process, log, port)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port: int = listening.getsockname()[1]
    return port


def answers(port: int) -> bool:
    with socket.socket() as asking:
        return asking.connect_ex(("127.0.0.1", port)) == 0


def wait_for(condition: Callable[[], object], server: Server) -> None:
    """Wait until something is so; fails with the server's log when it ends, or takes too long."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, server.log.read_text()
        assert server.process.poll() is None, server.log.read_text()
        time.sleep(0.02)


@pytest.mark.needs("ccache", "distcc", "distccd")
def test_ccache_misses_go_to_distcc(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(package("one", 2))
    env = {"CCACHE_DIR": str(tmp_path / "cache"), "CCACHE_PREFIX": "distcc", "DISTCC_DIR": str(tmp_path)}
    with servers(tmp_path, 1) as (server,):
        env["DISTCC_HOSTS"] = f"127.0.0.1:{server.port}/3"
        for hits, compiled in ((0, 2), (2, 2)):
            shutil.rmtree(root / "build", ignore_errors=True)
            ran = forge("build", "--compiler-launcher", "ccache", cwd=root, env=env)
            assert [line.strip() for line in ran.out.splitlines()[-2:]] == [
                f"ccache: {hits} of 2 compilations from the cache",
                "distcc: 1 host with 3 slots",
            ]
            assert server.compiled == compiled


@pytest.mark.needs("distcc", "distccd")
def test_a_killed_distcc_server_does_not_fail_the_build(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """What comes is what a plain build makes."""
    root = tree({**package("one", 6), **package("two", 2)})
    env = {**surroundings(tmp_path), "DISTCC_DIR": str(tmp_path)}
    with servers(tmp_path, 2) as (first, second):
        env["DISTCC_HOSTS"] = f"127.0.0.1:{first.port}/1 127.0.0.1:{second.port}/1"
        argv = [sys.executable, "-m", "forge", "build", "--compiler-launcher", "distcc"]
        with subprocess.Popen(argv, cwd=root, env=env, stdout=subprocess.PIPE, text=True) as build:
            wait_for(lambda: second.compiled and first.compiled, second)
            assert build.poll() is None
            second.end()
            out, _ = build.communicate(timeout=PATIENCE)
        assert build.returncode == 0, out
        assert "distcc: 2 hosts with 2 slots" in out
        assert first.compiled > 0
        assert 0 < second.compiled < 8
    farmed = installed(root)
    assert built_plainly(forge, root, "one", "two") == farmed
