"""A build that fails leaves what was installed before."""

import stat
from pathlib import Path

import pytest

from forge.base.files import remove_tree
from forge.base.layout import BACKUP_DIR, Layout
from forge.build.observed_writes import append
from forge.build.prefix import PrefixExchange, leftover_backups, tidy, written_log
from tests.installs import Made, make_install

BIG = "x" * 100_000


def kept(tmp_path: Path, *, merged: bool = False) -> tuple[Layout, Path, Path]:
    """Install a package, and put it aside but for a file that others installed; return two of its files."""
    files = {"bin/small": "small", "lib/large": BIG}
    layout = make_install(tmp_path, [Made("walker", files=files)], merged=merged)
    prefix = layout.prefix("walker")
    small, large = prefix / "bin/small", prefix / "lib/large"
    names = [str(path) for path in (small, large, prefix / "never/there")]
    PrefixExchange("walker", layout).begin(names, [str(large)] if merged else ())
    return layout, small, large


@pytest.mark.parametrize("merged", [False, True], ids=["isolated", "merged"])
def test_the_last_successful_install_survives_a_kill(tmp_path: Path, *, merged: bool) -> None:
    """The files of the killed build are no state to return to."""
    layout, small, large = kept(tmp_path, merged=merged)
    assert not small.exists()
    assert large.exists() == merged
    small.parent.mkdir(parents=True)
    small.write_text("half")
    PrefixExchange("walker", layout).begin([str(small)])
    assert not small.exists()
    PrefixExchange("walker", layout).roll_back()
    assert (small.read_text(), large.read_text()) == ("small", BIG)
    assert (layout.prefix("walker") / "share/walker/package.dsv").is_file()
    tidy(layout)
    assert not (layout.install / BACKUP_DIR).exists()


def test_a_kill_while_files_are_moved_loses_no_file(tmp_path: Path) -> None:
    """Half of them are aside: all of them are good."""
    layout, small, _ = kept(tmp_path, merged=True)
    (layout.install / BACKUP_DIR / "walker").rename(layout.install / BACKUP_DIR / "walker.part")
    (layout.install / BACKUP_DIR / "walker.part/share/walker/package.sh").unlink()
    script = layout.install / "share/walker/package.sh"
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text("still there")
    PrefixExchange("walker", layout).begin([str(small)])
    assert not script.exists()
    PrefixExchange("walker", layout).roll_back()
    assert (small.read_text(), script.read_text()) == ("small", "still there")


def test_files_modified_in_place_are_restored_after_a_failure(tmp_path: Path) -> None:
    """Such as a file that others installed, too, which therefore stays where it is."""
    layout, small, large = kept(tmp_path, merged=True)
    with large.open("a") as stream:
        stream.write("more")
    PrefixExchange("walker", layout).roll_back()
    assert (small.read_text(), large.read_text()) == ("small", BIG)
    assert (layout.prefix("walker") / "share/walker/package.dsv").is_file()


def test_a_failed_first_install_leaves_no_package(tmp_path: Path) -> None:
    """A first build that fails leaves nothing, and takes nothing with it that is no folder."""
    layout = make_install(tmp_path, [])
    prefix = layout.prefix("walker")
    PrefixExchange("walker", layout).begin([])
    (prefix / "share").mkdir(parents=True)
    (prefix / "share/file").touch()
    append(str(written_log("walker", layout)), b"W" + bytes(prefix / "share/file"))
    PrefixExchange("walker", layout).roll_back()
    assert not prefix.exists()
    prefix.write_text("mine")
    PrefixExchange("walker", layout).begin([])
    PrefixExchange("walker", layout).roll_back()
    assert prefix.read_text() == "mine"


def test_a_kill_during_cleanup_changes_no_files(tmp_path: Path) -> None:
    """What is left of them is not taken for the last good state."""
    layout, small, _ = kept(tmp_path)
    PrefixExchange("walker", layout).commit()
    small.parent.mkdir(parents=True)
    small.write_text("new")
    (layout.install / BACKUP_DIR / "walker.trash/bin").mkdir(parents=True)
    assert leftover_backups("walker", layout) == [layout.install / BACKUP_DIR / "walker.trash"]
    PrefixExchange("walker", layout).begin([])
    PrefixExchange("walker", layout).roll_back()
    assert small.read_text() == "new"
    PrefixExchange("walker", layout).begin([])
    PrefixExchange("walker", layout).commit()
    tidy(layout)
    assert not (layout.install / BACKUP_DIR).exists()


def test_a_prefix_that_cannot_be_renamed_is_moved_entry_by_entry(tmp_path: Path) -> None:
    """One that was killed while it did so has all it needs."""
    layout, small, large = kept(tmp_path)
    aside = layout.install / BACKUP_DIR / "walker"
    large.parent.mkdir(parents=True)
    (aside / "lib/large").rename(large)
    aside.rename(aside.with_name("walker.part"))
    PrefixExchange("walker", layout).begin([])
    PrefixExchange("walker", layout).roll_back()
    assert (small.read_text(), large.read_text()) == ("small", BIG)


def test_read_only_folders_are_removed_as_well(tmp_path: Path) -> None:
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
