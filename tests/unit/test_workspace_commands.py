"""`forge list`, `graph` and `info` on small workspaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return a workspace in which c needs b needs a, and p stands alone."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a", "<buildtool_depend>ament_cmake</buildtool_depend>"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>"),
            "src/z/c/package.xml": manifest_text("c", "<exec_depend>b</exec_depend>"),
            "src/p/package.xml": manifest_text(
                "p", "<test_depend>python3-x</test_depend>", build_type="ament_python"
            ),
        }
    )


def test_list_prints_name_path_and_type_sorted(forge: Forge, workspace: Path) -> None:
    ran = forge("list", cwd=workspace)
    assert ran.out == (
        "a\tsrc/a\t(ros.ament_cmake)\nb\tsrc/b\t(ros.ament_cmake)\n"
        "c\tsrc/z/c\t(ros.ament_cmake)\np\tsrc/p\t(ros.ament_python)\n"
    )
    assert (ran.code, ran.err) == (0, "")


def test_list_in_topological_order_and_in_parts(forge: Forge, workspace: Path) -> None:
    assert forge("list", "-t", "-n", cwd=workspace).out == "a\np\nb\nc\n"
    assert forge("list", "-p", "--packages-up-to", "b", cwd=workspace).out == "src/a\nsrc/b\n"
    assert forge("list", "-n", "-p", cwd=workspace).code == 2


def test_embedded_packages_show_only_when_asked_for(forge: Forge, workspace: Path) -> None:
    assert "ament_cmake" in forge("list", "-n", "--embedded", cwd=workspace).out.split()
    assert "ament_cmake" in forge("graph", "--embedded", cwd=workspace).out.split()
    assert "name: ament_cmake\n" in forge("info", "--embedded", cwd=workspace).out


def test_a_broken_manifest_is_a_warning_to_a_listing(forge: Forge, workspace: Path) -> None:
    (workspace / "src/b/package.xml").write_text("<package/>")
    ran = forge("list", "-n", cwd=workspace)
    assert ran.out == "a\nc\np\n"
    assert ran.err.startswith("src/b/package.xml:1:1: warning: element 'name' is missing")


def test_graph_marks_direct_and_indirect_dependents(forge: Forge, workspace: Path) -> None:
    assert forge("graph", cwd=workspace).out == "a  + *.\np   +  \nb    +*\nc     +\n"
    dense = forge("graph", "--density", "--legend", cwd=workspace).out
    assert dense.startswith("+ marks the package itself\n")
    assert "dependency density 50.00 %\n\n" in dense
    assert forge("graph", "--density", "--packages-select", "a", cwd=workspace).out.startswith(
        "dependency density 0.00 %"
    )


def test_graph_for_graphviz_colours_edges_by_category(forge: Forge, workspace: Path) -> None:
    assert forge("graph", "--dot", cwd=workspace).out.splitlines() == [
        "digraph graphname {",
        '  "c";',
        '  "b";',
        '  "p";',
        '  "a";',
        '  "c" -> "b" [color="#ff0000"];',
        '  "b" -> "a" [color="#0000ff:#ff0000"];',
        "}",
    ]


def test_info_says_what_the_manifest_says(forge: Forge, workspace: Path) -> None:
    assert forge("info", "c", cwd=workspace).out == (
        "path: src/z/c\n  type: ros.ament_cmake\n  name: c\n"
        "  dependencies:\n    build: \n    run: b\n    test: \n"
        "  metadata:\n    maintainers: ['The tests <tests@example.com>']\n    version: 0.1.0\n"
    )
    ran = forge("info", "cc", "b", cwd=workspace)
    assert ran.code == 0
    assert ran.err == "warning: package 'cc' is not in the workspace\nhint: did you mean 'c'?\n"
    assert forge("info", "cc", cwd=workspace).code == 2


def test_a_cycle_is_an_error_of_every_command(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("a", "<depend>b</depend>"),
            "b/package.xml": manifest_text("b", "<depend>a</depend>"),
        }
    )
    for command in ("list", "graph", "info", "build"):
        ran = forge(command, cwd=root)
        assert ran.code == 2
        assert "error: the packages depend on each other in a circle: a -> b -> a" in ran.err
