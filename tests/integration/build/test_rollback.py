"""A build that fails leaves what was installed before."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.packages import manifest_text

CMAKE = """cmake_minimum_required(VERSION 3.18)
project(walker NONE)
install(FILES package.xml DESTINATION share/walker)
install(FILES words DESTINATION share/walker)
install(PROGRAMS words DESTINATION bin)
include(${CMAKE_CURRENT_SOURCE_DIR}/more.cmake OPTIONAL)
install(FILES last DESTINATION share/walker)
"""
BIG = "x" * 100_000


@pytest.fixture(
    params=[(), ("--merge-install",), ("--symlink-install",)], ids=["isolated", "merged", "linked"]
)
def options(request: pytest.FixtureRequest) -> tuple[str, ...]:
    """Return options of a build."""
    chosen: tuple[str, ...] = request.param
    return chosen


def write(root: Path, **texts: str) -> None:
    """Write files of the package."""
    for name, text in texts.items():
        path = root / "src/walker" / name.replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def installed(root: Path) -> dict[str, str]:
    """Return what users of the install tree see: files, and that the package is known."""
    prefix = root / "install"
    found = {str(p.relative_to(prefix)): p.read_text() for p in prefix.rglob("*") if p.is_file()}
    return {name: text for name, text in found.items() if name != ".forge.json"}


@pytest.mark.needs("cmake")
def test_a_partially_failed_install_is_rolled_back(
    forge: Forge, options: tuple[str, ...], tmp_path: Path
) -> None:
    """Files that were replaced, or are gone, come back, small and large, and the package is known."""
    write(tmp_path, package_xml=manifest_text("walker", build_type="cmake"), CMakeLists_txt=CMAKE)
    write(tmp_path, words=BIG, last="one")
    assert forge("build", *options, cwd=tmp_path).code == 0
    before = installed(tmp_path)
    assert any(name.endswith("package.fish") for name in before)
    code = 'file(REMOVE "${CMAKE_INSTALL_PREFIX}/share/walker/last")\nmessage(FATAL_ERROR "no")'
    write(tmp_path, more_cmake=f"install(CODE [[\n{code}\n]])\n")
    if "--symlink-install" not in options:  # a linked tree shows the sources as they are
        write(tmp_path, words="other", last="two")
    assert forge("build", *options, cwd=tmp_path).code == 1
    assert installed(tmp_path) == before
    assert not (tmp_path / "install/.forge_before").exists()
    (tmp_path / "src/walker/more.cmake").unlink()
    write(tmp_path, last="two")
    assert forge("build", *options, cwd=tmp_path).code == 0
    assert "two" in installed(tmp_path).values()


@pytest.mark.needs("cmake")
def test_a_failed_configure_keeps_the_installed_package(forge: Forge, tmp_path: Path) -> None:
    """A shell that sources the workspace during the build still finds the package."""
    write(tmp_path, package_xml=manifest_text("walker", build_type="cmake"), CMakeLists_txt=CMAKE)
    write(tmp_path, words="one", last="one")
    assert forge("build", cwd=tmp_path).code == 0
    before = installed(tmp_path)
    write(tmp_path, more_cmake='message(FATAL_ERROR "no")\n')
    assert forge("build", cwd=tmp_path).code == 1
    assert installed(tmp_path) == before


@pytest.mark.needs("cmake")
def test_an_interrupted_install_is_rolled_back(forge: Forge, tmp_path: Path) -> None:
    """Ctrl-C while half of the files are there."""
    write(tmp_path, package_xml=manifest_text("walker", build_type="cmake"), CMakeLists_txt=CMAKE)
    write(tmp_path, words="one", last="one")
    assert forge("build", cwd=tmp_path).code == 0
    before = installed(tmp_path)
    here = tmp_path / "here"
    sleep = f"execute_process(COMMAND ${{CMAKE_COMMAND}} -E touch {here})\nexecute_process(COMMAND sleep 60)"
    write(tmp_path, words="two", more_cmake=f"install(CODE [[\n{sleep}\n]])\n")
    argv = [sys.executable, "-m", "forge", "build"]
    with subprocess.Popen(argv, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as started:
        while not here.exists() and started.poll() is None:
            time.sleep(0.05)
        started.send_signal(signal.SIGINT)
        started.communicate()
    assert installed(tmp_path) == before
