"""Builds and statistics with the real distcc, ccache and sccache."""

import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from forge.base.layout import COMPILATIONS_FILE
from forge.plugins.compiler_launchers.statistics import open_launcher_stats, remote_slots
from forge.toolchain.compiler_launchers import LauncherSummary
from tests.conftest import Forge, Tree
from tests.unit.toolchain.test_compiler_launchers import PACKAGE


@pytest.mark.parametrize(
    ("text", "slots"),
    [
        ("", []),
        ("localhost\nlocalhost/3\n", []),
        ("127.0.0.1\n", [4]),
        ("red/8,lzo\nblue:4000/3\n[::1]:4000/7\n", [8, 3, 7]),
        ("old/6:4001,lzo,cpp\n", [6]),
        ("someone@red/5:/opt/bin/distccd,lzo\n@blue:/opt/9/distccd\n", [5, 4]),
    ],
)
def test_distcc_host_lists_are_parsed(text: str, slots: list[int]) -> None:
    assert remote_slots(text) == slots


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
    """`distcc -j` also counts the slots of localhost, whose processors forge counts elsewhere."""
    variables = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "DISTCC_HOSTS": said}
    counted = subprocess.run(["distcc", "-j"], env=variables, capture_output=True, check=True, text=True)
    stats = open_launcher_stats(Path("/usr/bin/distcc"), tmp_path, tmp_path, variables)
    assert (stats.slots, stats.problem) == (int(counted.stdout) - here, None)


@pytest.mark.needs("distcc")
@pytest.mark.parametrize("said", ["", "localhost/4", "red/x"])
def test_distcc_without_hosts_is_an_error(said: str, tmp_path: Path) -> None:
    variables = {"HOME": str(tmp_path), "DISTCC_HOSTS": said}
    stats = open_launcher_stats(Path("/usr/bin/distcc"), tmp_path, tmp_path, variables)
    assert stats.slots == 0
    assert stats.problem
    assert "distcc reports no remote hosts" in stats.problem.message


def compile_by(ccache: Path, variables: dict[str, str], *argv: str) -> None:
    subprocess.run([ccache, "g++", *argv], env=variables, check=False, stderr=subprocess.DEVNULL)


@pytest.mark.needs("ccache", "g++")
def test_only_compilations_of_this_build_are_counted(tmp_path: Path) -> None:
    """Compilations of other builds with the same cache are not in the log of this build."""
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
def test_a_build_without_compilations_has_no_statistics(tmp_path: Path) -> None:
    launcher_stats = open_launcher_stats(
        Path("/usr/bin/ccache"), tmp_path, tmp_path, {"CCACHE_DIR": str(tmp_path)}
    )
    assert launcher_stats.finish() == ()


@pytest.mark.needs("ccache")
def test_ccache_settings_of_the_user_are_kept(tmp_path: Path) -> None:
    """A base folder in ccache's file or a variable, even an empty one. The user's log is not counted."""
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


@pytest.mark.needs("g++", "cmake", "ninja")
def test_icecc_runs_the_compiler_and_is_not_queried(forge: Forge, tree: Tree) -> None:
    """The launcher is a shell script that starts the compiler."""
    root = tree({**PACKAGE, "bin/icecc": '#!/bin/sh\necho "$1" >> "$OUT"\nexec "$@"\n'})
    env = {"PATH": f"{root / 'bin'}:{os.environ['PATH']}", "OUT": str(root / "compilers")}
    ran = forge("build", "--compiler-launcher", "icecc", cwd=root, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert (root / "compilers").is_file()
    assert "icecc" not in ran.out


@pytest.mark.needs("sccache", "g++", "cmake", "ninja")
def test_sccache_compilations_are_counted(forge: Forge, tree: Tree) -> None:
    root = tree(PACKAGE)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = str(listening.getsockname()[1])
    env = {"SCCACHE_DIR": str(root / "cache"), "SCCACHE_SERVER_PORT": port, "SCCACHE_IDLE_TIMEOUT": "20"}
    try:
        said = [rebuild(forge, root, env) for _ in range(2)]
    finally:
        stop = ["sccache", "--stop-server"]
        subprocess.run(stop, env={**os.environ, **env}, check=False, capture_output=True)
    assert said == [f"  sccache: {hits} of 1 compilation from the cache" for hits in (0, 1)]


def rebuild(forge: Forge, root: Path, env: dict[str, str]) -> str:
    """Build in empty folders with sccache; return its line in the summary."""
    for folder in ("build", "install"):
        shutil.rmtree(root / folder, ignore_errors=True)
    ran = forge("build", "--compiler-launcher", "sccache", cwd=root, env=env)
    assert ran.code == 0, ran.err
    return next(line for line in ran.out.splitlines() if "sccache" in line)
