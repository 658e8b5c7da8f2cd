"""Compiler launchers: what is chosen, what CMake is told, what caches and distcc report."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import SelectionError
from forge.base.layout import COMPILATIONS_FILE, Layout
from forge.build.recipes.context import BuildContext
from forge.build.recipes.initial_cache import initial_cache
from forge.build.up_to_date import relevant_environment
from forge.execution.opening import open_job_pool
from forge.execution.options import JobOptions
from forge.toolchain.compiler_launchers.choice import LAUNCHERS, chosen, launcher_variables
from forge.toolchain.compiler_launchers.launcher_stats import (
    HostPool,
    LauncherSummary,
    open_launcher_stats,
    read_hosts,
)
from forge.toolchain.resources import processors
from tests.packages import manifest_text

if TYPE_CHECKING:
    from forge.execution.job_pool import JobPool
    from tests.conftest import Forge, Tree

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject(one CXX)\nadd_library(one one.cpp)\n"
PACKAGE = {
    "src/one/package.xml": manifest_text("one", build_type="cmake"),
    "src/one/CMakeLists.txt": CMAKE,
    "src/one/one.cpp": "int one() { return 1; }\n",
}


def context_of(launcher: Path | None) -> BuildContext:
    return BuildContext(
        root=Path("/ws"),
        layout=Layout(Path("/ws/build"), Path("/ws/install"), None),
        python=Path("/usr/bin/python3"),
        site_packages="lib/python3.11/site-packages",
        wheels=(),
        generator=(),
        launcher=launcher,
    )


@pytest.mark.parametrize(("word", "name"), [(None, ""), ("none", ""), ("ccache", "ccache"), ("recc", "recc")])
def test_a_launcher_is_chosen_by_its_name(word: str | None, name: str) -> None:
    assert chosen(word) == name


def test_a_variable_may_name_no_other() -> None:
    with pytest.raises(SelectionError, match="FORGE_COMPILER_LAUNCHER: unknown compiler launcher 'cache'"):
        chosen("cache")


def test_a_launcher_that_is_not_there_is_one_mistake_with_its_remedy(forge: Forge, tree: Tree) -> None:
    ran = forge("build", "--compiler-launcher", "recc", cwd=tree(PACKAGE))
    assert ran.code == 2
    assert ran.err.splitlines() == [
        "error: compiler launcher 'recc' not found on PATH",
        f"hint: {LAUNCHERS['recc'].hint}",
    ]


def test_a_workspace_that_compiles_nothing_needs_no_launcher(forge: Forge, tree: Tree) -> None:
    files = {
        "src/one/package.xml": manifest_text("one", build_type="ament_python"),
        "src/one/setup.py": "from setuptools import setup\nsetup(name='one', version='1.0.0', packages=[])\n",
    }
    ran = forge("build", "--compiler-launcher", "recc", "--dry-run", cwd=tree(files))
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.parametrize(
    ("where", "files", "env"),
    [
        ("forge.toml", {"forge.toml": '[build]\ncompiler-launcher = "recc"\n'}, {}),
        ("a variable", {}, {"FORGE_COMPILER_LAUNCHER": "recc"}),
    ],
)
def test_a_file_or_a_variable_asks_for_a_launcher_and_an_option_for_none(
    forge: Forge, tree: Tree, where: str, files: dict[str, str], env: dict[str, str]
) -> None:
    root = tree({**PACKAGE, **files})
    assert "'recc' not found" in forge("build", "--dry-run", cwd=root, env=env).err, where
    assert forge("build", "--dry-run", "--compiler-launcher", "none", cwd=root, env=env).code == 0


def test_cmake_is_told_of_each_language_that_a_launcher_understands() -> None:
    assert launcher_variables(Path("/usr/bin/ccache")) == (
        ("CMAKE_C_COMPILER_LAUNCHER", "/usr/bin/ccache"),
        ("CMAKE_CXX_COMPILER_LAUNCHER", "/usr/bin/ccache"),
        ("CMAKE_CUDA_COMPILER_LAUNCHER", "/usr/bin/ccache"),
    )
    assert dict(launcher_variables(Path("/usr/bin/distcc")))["CMAKE_CUDA_COMPILER_LAUNCHER"] == ""
    assert {value for _, value in launcher_variables(None)} == {""}


def test_the_initial_cache_sets_a_launcher_and_takes_back_one_of_before() -> None:
    text = initial_cache(context_of(Path("/opt/my tools/distcc")), Path("manifest.cmake"))
    assert 'set(CMAKE_CXX_COMPILER_LAUNCHER "/opt/my tools/distcc" CACHE STRING' in text
    assert "unset(CMAKE_CUDA_COMPILER_LAUNCHER CACHE)" in text
    assert "unset(CMAKE_CXX_COMPILER_LAUNCHER CACHE)" in initial_cache(
        context_of(None), Path("manifest.cmake")
    )


@pytest.mark.parametrize(
    ("text", "hosts", "slots"),
    [
        ("", 0, 0),
        ("localhost\nlocalhost/3\n", 0, 0),
        ("127.0.0.1\n", 1, 4),
        ("red/8,lzo\nblue:4000/3\n[::1]:4000/7\n", 3, 18),
        ("old/6:4001,lzo,cpp\n", 1, 6),
        ("someone@red/5:/opt/bin/distccd,lzo\n@blue:/opt/9/distccd\n", 2, 9),
    ],
)
def test_hosts_are_read_as_distcc_lists_them(text: str, hosts: int, slots: int) -> None:
    assert read_hosts(text) == HostPool(hosts, slots)


@pytest.mark.needs("distcc")
@pytest.mark.parametrize(
    ("said", "here"),
    [
        ("red/8,lzo localhost/3 blue:4000/3 --randomize", 3),
        ("localhost red [::1]:4000/7 old/6:4001", 2),
        ("someone@red/5:/opt/bin/distccd --localslots=9 --localslots_cpp=12 blue,lzo,cpp", 0),
        ("# a comment\nred/2 # another\nblue/3", 0),
    ],
)
def test_forge_counts_slots_as_distcc_does(said: str, here: int, tmp_path: Path) -> None:
    """`distcc -j` has those of the word localhost among them, which are no more processors than we have."""
    variables = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "DISTCC_HOSTS": said}
    counted = subprocess.run(["distcc", "-j"], env=variables, capture_output=True, check=True, text=True)
    stats = open_launcher_stats(Path("/usr/bin/distcc"), tmp_path, tmp_path, variables)
    assert (stats.host_pool.slots, stats.problem) == (int(counted.stdout) - here, None)


@pytest.mark.needs("distcc")
@pytest.mark.parametrize("said", ["", "localhost/4", "red/x"])
def test_a_distcc_without_hosts_is_a_problem(said: str, tmp_path: Path) -> None:
    variables = {"HOME": str(tmp_path), "DISTCC_HOSTS": said}
    stats = open_launcher_stats(Path("/usr/bin/distcc"), tmp_path, tmp_path, variables)
    assert stats.host_pool == HostPool()
    assert stats.problem
    assert "distcc reports no remote hosts" in stats.problem.message


def test_a_distcc_that_does_not_answer_has_no_hosts(tmp_path: Path) -> None:
    stats = open_launcher_stats(tmp_path / "distcc", tmp_path, tmp_path, {})
    assert stats.host_pool == HostPool()
    assert stats.problem


@pytest.mark.parametrize("name", ["icecc", "recc"])
def test_launchers_without_statistics_add_no_slots(name: str, tmp_path: Path) -> None:
    stats = open_launcher_stats(tmp_path / name, tmp_path, tmp_path, {})
    assert (stats.host_pool, stats.problem, stats.finish()) == (HostPool(), None, ())


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (
            LauncherSummary("ccache", compilations=140, from_cache=120),
            "ccache: 120 of 140 compilations from the cache",
        ),
        (
            LauncherSummary("sccache", compilations=1, from_cache=0),
            "sccache: 0 of 1 compilation from the cache",
        ),
        (LauncherSummary("distcc", hosts=2, slots=8), "distcc: 2 hosts with 8 slots"),
        (LauncherSummary("distcc", hosts=1, slots=1), "distcc: 1 host with 1 slot"),
    ],
)
def test_an_outcome_is_one_line(outcome: LauncherSummary, words: str) -> None:
    assert outcome.words == words


def compile_by(ccache: Path, variables: dict[str, str], *argv: str) -> None:
    subprocess.run([ccache, "g++", *argv], env=variables, check=False, stderr=subprocess.DEVNULL)


@pytest.mark.needs("ccache", "g++")
def test_only_compilations_of_this_build_are_counted(tmp_path: Path) -> None:
    """Others use the same cache meanwhile: their compilations are not in the log of this build."""
    ccache = Path("/usr/bin/ccache")
    (tmp_path / "one.cpp").write_text("int one() { return 1; }\n")
    (tmp_path / "wrong.cpp").write_text("int wrong( {\n")
    (tmp_path / COMPILATIONS_FILE).write_text("# left by a build that was killed\ndirect_cache_hit\n")
    others = {"PATH": "/usr/bin:/bin", "CCACHE_DIR": str(tmp_path / "cache")}
    launcher_stats = open_launcher_stats(ccache, tmp_path, tmp_path, others)
    ours = {**others, **launcher_stats.variables}
    one = str(tmp_path / "one.cpp")
    for variables in (ours, others, ours):
        compile_by(ccache, variables, "-c", one, "-o", str(tmp_path / "one.o"))
    compile_by(ccache, ours, "-c", str(tmp_path / "wrong.cpp"), "-o", str(tmp_path / "wrong.o"))
    compile_by(ccache, ours, "-E", one, "-o", str(tmp_path / "one.i"))
    assert launcher_stats.finish() == (LauncherSummary("ccache", compilations=3, from_cache=1),)
    assert not (tmp_path / COMPILATIONS_FILE).exists()


@pytest.mark.needs("ccache")
def test_a_build_without_compilations_has_nothing_to_tell(tmp_path: Path) -> None:
    launcher_stats = open_launcher_stats(
        Path("/usr/bin/ccache"), tmp_path, tmp_path, {"CCACHE_DIR": str(tmp_path)}
    )
    assert launcher_stats.finish() == ()


@pytest.mark.needs("ccache")
def test_what_the_user_told_ccache_stays(tmp_path: Path) -> None:
    """A base folder in its file or a variable, even an empty one; a log of the user's own is not counted."""
    log = tmp_path / "their.log"
    log.write_text("# theirs\ndirect_cache_hit\n")
    (tmp_path / "ccache.conf").write_text(f"base_dir = /elsewhere\nstats_log = {log}\n")
    launcher_stats = open_launcher_stats(
        Path("/usr/bin/ccache"), tmp_path, tmp_path, {"CCACHE_DIR": str(tmp_path)}
    )
    assert launcher_stats.variables == {}
    assert launcher_stats.finish() == ()
    assert log.exists()
    own = {"CCACHE_DIR": str(tmp_path / "no"), "CCACHE_BASEDIR": ""}
    told = open_launcher_stats(Path("/usr/bin/ccache"), tmp_path, tmp_path, own).variables
    assert told == {"CCACHE_STATSLOG": str(tmp_path / COMPILATIONS_FILE)}


@pytest.mark.needs("ccache", "distcc")
def test_distcc_behind_ccache_counts(tmp_path: Path) -> None:
    variables = {
        "PATH": "/usr/bin:/bin",
        "CCACHE_DIR": str(tmp_path),
        "CCACHE_PREFIX": "distcc",
        "DISTCC_HOSTS": "red/8 blue/2",
    }
    launcher_stats = open_launcher_stats(Path("/usr/bin/ccache"), tmp_path, tmp_path, variables)
    assert launcher_stats.host_pool == HostPool(hosts=2, slots=10)
    assert launcher_stats.finish() == (LauncherSummary("distcc", hosts=2, slots=10),)


def budget_of(host_pool: HostPool, jobs: int | None = None, **variables: str) -> JobPool:
    options = JobOptions(jobs=jobs)
    return open_job_pool(
        options, context_of(None), variables, compiles=False, remote_slots=host_pool.slots, warn=print
    )


def test_slots_of_remote_hosts_are_added_to_our_processors() -> None:
    budget = budget_of(HostPool(hosts=2, slots=10))
    assert (budget.jobs, budget.local) == (processors() + 10, processors())
    budget.close()


@pytest.mark.parametrize(
    ("jobs", "variables"),
    [(3, {}), (None, {"MAKEFLAGS": "-j3"}), (None, {"CMAKE_BUILD_PARALLEL_LEVEL": "3"})],
)
def test_who_says_how_many_jobs_is_believed(jobs: int | None, variables: dict[str, str]) -> None:
    budget = budget_of(HostPool(hosts=2, slots=10), jobs, **variables)
    assert (budget.jobs, budget.local) == (3, 3)
    budget.close()


def test_other_hosts_are_no_reason_to_build_anew() -> None:
    said = {"DISTCC_HOSTS": "red", "CCACHE_DIR": "/cache", "CCACHE_PREFIX": "distcc", "DISTUTILS_DEBUG": "1"}
    assert dict(relevant_environment(said)) == {"DISTUTILS_DEBUG": "1"}


@pytest.mark.needs("g++", "cmake", "ninja")
def test_icecc_runs_the_compiler_and_is_not_queried(forge: Forge, tree: Tree) -> None:
    """The launcher itself is a shell script that starts the compiler: what counts is forge's own part."""
    root = tree({**PACKAGE, "bin/icecc": '#!/bin/sh\necho "$1" >> "$OUT"\nexec "$@"\n'})
    env = {"PATH": f"{root / 'bin'}:{os.environ['PATH']}", "OUT": str(root / "compilers")}
    ran = forge("build", "--compiler-launcher", "icecc", cwd=root, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert (root / "compilers").is_file()
    assert "icecc" not in ran.out


@pytest.mark.needs("sccache", "g++", "cmake", "ninja")
def test_the_counts_of_sccache_grow_by_those_of_a_build(forge: Forge, tree: Tree) -> None:
    root = tree(PACKAGE)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = str(listening.getsockname()[1])
    env = {"SCCACHE_DIR": str(root / "cache"), "SCCACHE_SERVER_PORT": port, "SCCACHE_IDLE_TIMEOUT": "20"}
    try:
        said = [build_anew(forge, root, env) for _ in range(2)]
    finally:
        stop = ["sccache", "--stop-server"]
        subprocess.run(stop, env={**os.environ, **env}, check=False, capture_output=True)
    assert said == [f"  sccache: {hits} of 1 compilation from the cache" for hits in (0, 1)]


def build_anew(forge: Forge, root: Path, env: dict[str, str]) -> str:
    """Build from nothing by sccache and return what is said of it."""
    for folder in ("build", "install"):
        shutil.rmtree(root / folder, ignore_errors=True)
    ran = forge("build", "--compiler-launcher", "sccache", cwd=root, env=env)
    assert ran.code == 0, ran.err
    return next(line for line in ran.out.splitlines() if "sccache" in line)
