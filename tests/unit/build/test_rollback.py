"""A build that fails leaves what was installed before."""

from __future__ import annotations

import signal
import stat
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from forge.base.files import remove_tree
from forge.base.layout import BACKUP_DIR
from forge.build import rollback
from tests.installs import Made, make_install
from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout
    from tests.conftest import Forge

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
def test_an_install_that_fails_half_way_changes_nothing(
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
def test_what_cannot_be_configured_stays_as_it_was(forge: Forge, tmp_path: Path) -> None:
    """Who sources the workspace meanwhile still has the package."""
    write(tmp_path, package_xml=manifest_text("walker", build_type="cmake"), CMakeLists_txt=CMAKE)
    write(tmp_path, words="one", last="one")
    assert forge("build", cwd=tmp_path).code == 0
    before = installed(tmp_path)
    write(tmp_path, more_cmake='message(FATAL_ERROR "no")\n')
    assert forge("build", cwd=tmp_path).code == 1
    assert installed(tmp_path) == before


@pytest.mark.needs("cmake")
def test_an_interrupted_install_changes_nothing(forge: Forge, tmp_path: Path) -> None:
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


def kept(tmp_path: Path, *, merged: bool = False) -> tuple[Layout, Path, Path]:
    """Install a package, and put it aside but for a file that others installed; return two of its files."""
    files = {"bin/small": "small", "lib/large": BIG}
    layout = make_install(tmp_path, [Made("walker", files=files)], merged=merged)
    prefix = layout.prefix("walker")
    small, large = prefix / "bin/small", prefix / "lib/large"
    names = [str(path) for path in (small, large, prefix / "never/there")]
    rollback.back_up("walker", layout, names, [str(large)] if merged else ())
    return layout, small, large


@pytest.mark.parametrize("merged", [False, True], ids=["isolated", "merged"])
def test_after_a_kill_the_last_good_state_is_kept(tmp_path: Path, *, merged: bool) -> None:
    """What the killed build left is nobody's good state."""
    layout, small, large = kept(tmp_path, merged=merged)
    assert not small.exists()
    assert large.exists() == merged
    small.parent.mkdir(parents=True)
    small.write_text("half")
    rollback.back_up("walker", layout, [str(small)])
    assert not small.exists()
    rollback.restore("walker", layout)
    assert (small.read_text(), large.read_text()) == ("small", BIG)
    assert (layout.prefix("walker") / "share/walker/package.dsv").is_file()
    rollback.tidy(layout)
    assert not (layout.install / BACKUP_DIR).exists()


def test_a_kill_while_files_move_loses_none(tmp_path: Path) -> None:
    """Half of them are aside: all of them are good."""
    layout, small, _ = kept(tmp_path, merged=True)
    (layout.install / BACKUP_DIR / "walker").rename(layout.install / BACKUP_DIR / "walker.part")
    (layout.install / BACKUP_DIR / "walker.part/share/walker/package.sh").unlink()
    script = layout.install / "share/walker/package.sh"
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text("still there")
    rollback.back_up("walker", layout, [str(small)])
    assert not script.exists()
    rollback.restore("walker", layout)
    assert (small.read_text(), script.read_text()) == ("small", "still there")


def test_what_was_written_in_place_is_not_taken_for_good(tmp_path: Path) -> None:
    """A large file that others installed, too, is linked: then the package looks not installed."""
    layout, small, large = kept(tmp_path, merged=True)
    with large.open("a") as stream:
        stream.write("more")
    rollback.restore("walker", layout)
    assert small.read_text() == "small"
    assert not (layout.prefix("walker") / "share/walker/package.dsv").exists()


def test_a_package_that_was_not_there_is_not_there_again(tmp_path: Path) -> None:
    """A first build that fails leaves nothing, and takes nothing with it that is no folder."""
    layout = make_install(tmp_path, [])
    prefix = layout.prefix("walker")
    rollback.back_up("walker", layout, [])
    (prefix / "share").mkdir(parents=True)
    rollback.restore("walker", layout)
    assert not prefix.exists()
    prefix.write_text("mine")
    rollback.back_up("walker", layout, [])
    rollback.restore("walker", layout)
    assert prefix.read_text() == "mine"


def test_a_kill_while_old_files_are_removed_changes_nothing(tmp_path: Path) -> None:
    """What is left of them is not taken for the last good state."""
    layout, small, _ = kept(tmp_path)
    rollback.drop("walker", layout)
    small.parent.mkdir(parents=True)
    small.write_text("new")
    (layout.install / BACKUP_DIR / "walker.trash/bin").mkdir(parents=True)
    assert rollback.leftover_backups("walker", layout) == [layout.install / BACKUP_DIR / "walker.trash"]
    rollback.back_up("walker", layout, [])
    rollback.restore("walker", layout)
    assert small.read_text() == "new"
    rollback.back_up("walker", layout, [])
    rollback.drop("walker", layout)
    rollback.tidy(layout)
    assert not (layout.install / BACKUP_DIR).exists()


def test_a_prefix_that_cannot_be_moved_as_a_whole_is_moved_entry_by_entry(tmp_path: Path) -> None:
    """One that was killed while it did so has all it needs."""
    layout, small, large = kept(tmp_path)
    aside = layout.install / BACKUP_DIR / "walker"
    large.parent.mkdir(parents=True)
    (aside / "lib/large").rename(large)
    aside.rename(aside.with_name("walker.part"))
    rollback.back_up("walker", layout, [])
    rollback.restore("walker", layout)
    assert (small.read_text(), large.read_text()) == ("small", BIG)


def test_folders_that_may_not_be_written_to_go_as_well(tmp_path: Path) -> None:
    """A package may install such; where links lead nothing happens."""
    outside = tmp_path / "outside"
    outside.mkdir(mode=0o500)
    (outside / "x").touch()
    locked = tmp_path / "prefix/share/locked"
    locked.mkdir(parents=True)
    (locked / "x").touch()
    (locked / "link").symlink_to(outside)
    locked.chmod(0o500)
    remove_tree(str(tmp_path / "prefix"))
    assert not (tmp_path / "prefix").exists()
    assert stat.S_IMODE(outside.stat().st_mode) == 0o500
    assert (outside / "x").exists()
