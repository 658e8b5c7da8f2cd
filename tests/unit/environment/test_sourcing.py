from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.base.errors import WorkspaceError
from forge.build.installation import install_package, uninstall_markers
from forge.environment.sourcing import build_environment, package_edits, workspace_environment
from tests.installs import PYTHON, Made, dsv_package, make_install
from tests.packages import package

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Tree

LIBRARY = Made("library", files={"lib/liblibrary.so": ""})


def test_packages_come_in_front_of_what_was_sourced(tmp_path: Path) -> None:
    """A build sees its own needs first, whatever the user's shell has sourced in which order."""
    layout = make_install(tmp_path, [LIBRARY, Made("other", files={"lib/libother.so": ""})])
    low, high = layout.prefix("library"), layout.prefix("other")
    variables = {"LD_LIBRARY_PATH": f"/x:{high}/lib", "HOME": "/"}
    found = build_environment([("library", low), ("other", high)], variables)
    assert found == {"LD_LIBRARY_PATH": f"{high}/lib:{low}/lib:/x", "HOME": "/"}


def test_a_package_that_says_nothing_changes_nothing(tmp_path: Path) -> None:
    """One of the system, say, or one that is not there."""
    assert build_environment([("p", tmp_path)], {"A": "1"}) == {"A": "1"}
    assert build_environment([], {"A": "1"}) == {"A": "1"}


def test_reinstalled_packages_are_read_again(tmp_path: Path) -> None:
    """Though the text of package.dsv is the same and only a file that it names is not."""
    layout = make_install(tmp_path, [dsv_package("p", "set;A;1", files={})])
    prefix = layout.prefix("p")
    assert build_environment([("p", prefix)], {}) == {"A": "1"}
    uninstall_markers("p", layout)
    assert package_edits("p", prefix) == ()
    (prefix / "share/p/local_setup.dsv").write_text("set;A;2\n")
    install_package(package("p"), layout, (), PYTHON)
    assert build_environment([("p", prefix)], {}) == {"A": "2"}


def test_scripts_that_are_gone_or_for_other_shells_do_nothing(tree: Tree) -> None:
    """As in a shell, which warns and goes on."""
    root = tree({"share/p/package.dsv": "source;gone.sh\nsource;other.bash\n", "other.bash": "exit 1\n"})
    assert build_environment([("p", root)], {"A": "1"}) == {"A": "1"}


def test_a_wrong_dsv_file_is_named(tree: Tree) -> None:
    """By its path below the prefix, and its line."""
    root = tree({"share/p/package.dsv": "source;share/p/x.dsv\n", "share/p/x.dsv": "prepend;A\n"})
    with pytest.raises(WorkspaceError, match=r"share/p/x\.dsv:1: error: invalid environment hook"):
        build_environment([("p", root)], {})


def test_a_workspace_stands_before_its_underlays(tmp_path: Path) -> None:
    """Roots and packages; sourcing it again changes nothing."""
    low = make_install(tmp_path / "low", [LIBRARY]).install
    high = make_install(tmp_path / "high", [Made("more", files={"lib/libmore.so": ""})], merged=True).install
    once = workspace_environment([low, high], {"COLCON_PREFIX_PATH": "/x"})
    assert once == {
        "COLCON_PREFIX_PATH": f"{high}:{low}:/x",
        "LD_LIBRARY_PATH": f"{high}/lib:{low}/library/lib",
    }
    assert workspace_environment([low, high], once) == once
