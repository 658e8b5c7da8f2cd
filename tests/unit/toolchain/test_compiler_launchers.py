"""Compiler launchers: the choice, the variables for CMake, host lists and statistics."""

from pathlib import Path

import pytest

from forge.base.errors import SelectionError
from forge.base.layout import Layout
from forge.build.recipes.context import BuildContext
from forge.build.recipes.initial_cache import initial_cache
from forge.engine.variables import relevant_environment
from forge.execution.job_pool import JobPool, open_job_pool
from forge.execution.options import JobOptions
from forge.toolchain.compiler_launchers import (
    LAUNCHERS,
    LauncherSummary,
    launcher_variables,
    selected_launcher,
)
from forge.toolchain.resources import processors
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

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


def test_an_unknown_launcher_in_the_variable_is_an_error() -> None:
    with pytest.raises(SelectionError, match="FORGE_COMPILER_LAUNCHER: unknown compiler launcher 'cache'"):
        selected_launcher("cache")


def test_a_missing_launcher_gives_one_error_with_a_hint(forge: Forge, tree: Tree) -> None:
    ran = forge("build", "--compiler-launcher", "recc", cwd=tree(PACKAGE))
    assert ran.code == 2
    assert ran.err.splitlines() == [
        "error: compiler launcher 'recc' not found on PATH",
        f"hint: {LAUNCHERS['recc']}",
    ]


def test_workspaces_without_compilation_need_no_launcher(forge: Forge, tree: Tree) -> None:
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
def test_a_launcher_from_file_or_variable_can_be_disabled_by_option(
    forge: Forge, tree: Tree, where: str, files: dict[str, str], env: dict[str, str]
) -> None:
    root = tree({**PACKAGE, **files})
    assert "'recc' not found" in forge("build", "--dry-run", cwd=root, env=env).err, where
    assert forge("build", "--dry-run", "--compiler-launcher", "none", cwd=root, env=env).code == 0


def test_cmake_gets_a_launcher_for_each_supported_language() -> None:
    assert launcher_variables(Path("/usr/bin/ccache")) == (
        ("CMAKE_C_COMPILER_LAUNCHER", "/usr/bin/ccache"),
        ("CMAKE_CXX_COMPILER_LAUNCHER", "/usr/bin/ccache"),
        ("CMAKE_CUDA_COMPILER_LAUNCHER", "/usr/bin/ccache"),
    )
    assert dict(launcher_variables(Path("/usr/bin/distcc")))["CMAKE_CUDA_COMPILER_LAUNCHER"] == ""
    assert {value for _, value in launcher_variables(None)} == {""}


def test_the_initial_cache_sets_the_launcher_and_removes_the_previous_one() -> None:
    text = initial_cache(context_of(Path("/opt/my tools/distcc")), Path("manifest.cmake"))
    assert 'set(CMAKE_CXX_COMPILER_LAUNCHER "/opt/my tools/distcc" CACHE STRING' in text
    assert "unset(CMAKE_CUDA_COMPILER_LAUNCHER CACHE)" in text
    assert "unset(CMAKE_CXX_COMPILER_LAUNCHER CACHE)" in initial_cache(
        context_of(None), Path("manifest.cmake")
    )


@pytest.mark.parametrize(
    ("summary", "words"),
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
def test_the_summary_of_a_launcher_is_one_line(summary: LauncherSummary, words: str) -> None:
    assert summary.words == words


def job_pool_of(jobs: int | None = None, **variables: str) -> JobPool:
    options = JobOptions(jobs=jobs)
    return open_job_pool(options, context_of(None), variables, compiles=False, remote_slots=10, warn=print)


def test_remote_slots_are_added_to_the_local_processors() -> None:
    job_pool = job_pool_of()
    assert (job_pool.jobs, job_pool.local) == (processors() + 10, processors())
    job_pool.close()


@pytest.mark.parametrize(
    ("jobs", "variables"),
    [(3, {}), (None, {"MAKEFLAGS": "-j3"}), (None, {"CMAKE_BUILD_PARALLEL_LEVEL": "3"})],
)
def test_an_explicit_number_of_jobs_is_used(jobs: int | None, variables: dict[str, str]) -> None:
    job_pool = job_pool_of(jobs, **variables)
    assert (job_pool.jobs, job_pool.local) == (3, 3)
    job_pool.close()


def test_changed_hosts_cause_no_rebuild() -> None:
    said = {"DISTCC_HOSTS": "red", "CCACHE_DIR": "/cache", "CCACHE_PREFIX": "distcc", "DISTUTILS_DEBUG": "1"}
    assert dict(relevant_environment(said)) == {"DISTUTILS_DEBUG": "1"}
