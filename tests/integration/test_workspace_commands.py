"""`forge list`, `graph` and `info` on small workspaces."""

import json
import os
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.testable import cmake_package


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


def test_list_supports_topological_order_and_single_columns(forge: Forge, workspace: Path) -> None:
    assert forge("list", "-t", "-n", cwd=workspace).out == "a\np\nb\nc\n"
    assert forge("list", "-p", "--packages-up-to", "b", cwd=workspace).out == "src/a\nsrc/b\n"
    assert forge("list", "-n", "-p", cwd=workspace).code == 2


def test_embedded_packages_are_shown_only_on_request(forge: Forge, workspace: Path) -> None:
    assert "ament_cmake" in forge("list", "-n", "--embedded", cwd=workspace).out.split()
    assert "ament_cmake" in forge("graph", "--embedded", cwd=workspace).out.split()
    assert "name: ament_cmake\n" in forge("info", "--embedded", cwd=workspace).out


def test_a_broken_manifest_is_a_warning_for_list(forge: Forge, workspace: Path) -> None:
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


def test_every_command_reports_a_cycle(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("a", "<depend>b</depend>"),
            "b/package.xml": manifest_text("b", "<depend>a</depend>"),
        }
    )
    for command in ("list", "graph", "info", "build"):
        ran = forge(command, cwd=root)
        assert ran.code == 2
        assert "error: dependency cycle: a -> b -> a" in ran.err


def test_arguments_are_trimmed_and_numbers_validated(forge: Forge, workspace: Path) -> None:
    assert forge("list", "-n", "--packages-select", " a", cwd=workspace).out == "a\n"
    assert forge("list", "-n", "--packages-above-depth", "1", "a", cwd=workspace).out == "a\nb\n"
    ran = forge("list", "--packages-above-depth", "a", cwd=workspace)
    assert (ran.code, "expects a number first, not 'a'" in ran.err) == (2, True)
    ran = forge("list", "--packages-select-regex", "(", cwd=workspace)
    assert (ran.code, "'(' is not a valid regular expression" in ran.err) == (2, True)


def test_strict_makes_an_unknown_name_an_error(forge: Forge, workspace: Path) -> None:
    assert forge("list", "--packages-skip", "aa", cwd=workspace).code == 0
    ran = forge("list", "--packages-skip", "aa", "--strict", cwd=workspace)
    assert (ran.code, "did you mean 'a'?" in ran.err) == (2, True)


def test_ignored_packages_are_treated_as_absent(forge: Forge, workspace: Path) -> None:
    assert forge("graph", "--packages-ignore", "b", "p", cwd=workspace).out == "a  + \nc   +\n"
    assert forge("list", "-n", "--packages-ignore-regex", "[ab]", cwd=workspace).out == "c\np\n"


def test_warnings_of_manifests_name_their_file(forge: Forge, tree: Tree) -> None:
    root = tree({"src/arm/package.xml": manifest_text("Arm"), "src/Leg/package.xml": manifest_text("Leg")})
    lines = forge("list", cwd=root).err.splitlines()
    assert [line.partition(":")[0] for line in lines if "warning:" in line] == [
        "src/Leg/package.xml",
        "src/arm/package.xml",
    ]


def test_list_and_graph_can_print_json(forge: Forge, workspace: Path) -> None:
    rows = json.loads(forge("list", "--json", "--packages-select", "a", cwd=workspace).out)
    assert rows == [{"name": "a", "path": "src/a", "type": "ros.ament_cmake"}]
    graph = json.loads(forge("graph", "--json", "--packages-skip", "b", cwd=workspace).out)
    assert [row["name"] for row in graph["packages"]] == ["a", "p", "c"]
    assert graph["dependencies"] == [{"from": "c", "to": "a", "categories": ["run"], "direct": False}]


def test_a_graph_can_show_deselected_packages(forge: Forge, workspace: Path) -> None:
    skip = ("--packages-skip", "b")
    plain = forge("graph", "--dot", *skip, cwd=workspace).out
    assert '  "c" -> "a" [color="#ff0000", style="dashed"];\n' in plain
    grey = forge("graph", "--dot", "--dot-include-skipped", *skip, cwd=workspace).out
    assert '  "b"[color = "gray" fontcolor = "gray"];\n' in grey
    assert '  "c" -> "b" [color="#ff000077"];\n' in grey
    framed = forge("graph", "--dot", "--dot-cluster", "--legend", cwd=workspace).out
    assert '    label = "z";\n    "c";\n  }\n' in framed
    assert '    _legend_run -> _legend_test [label="test dep.", color="#d2b48c"];\n' in framed


def test_graph_clusters_include_folders_outside_the_workspace(
    forge: Forge, workspace: Path, tmp_path: Path
) -> None:
    (tmp_path / "other/far/d").mkdir(parents=True)
    (tmp_path / "other/far/d/package.xml").write_text(manifest_text("d"))
    paths = ("--base-paths", "src/z", str(tmp_path / "other"))
    framed = forge("graph", "--dot", "--dot-cluster", *paths, cwd=workspace).out
    common = Path(os.path.commonpath([workspace, tmp_path]))
    for name, folder in (("c", workspace / "src/z"), ("d", tmp_path / "other/far")):
        assert f'    label = "{folder.relative_to(common)}";\n    "{name}";\n  }}\n' in framed


def test_older_graph_options_still_work(forge: Forge, workspace: Path) -> None:
    matrix = forge("graph", "--legend", cwd=workspace).out
    assert forge("list", "-g", "--topological-graph-legend", cwd=workspace).out == matrix
    dot = forge("graph", "--dot", cwd=workspace).out
    assert forge("list", "--topological-graph-dot", cwd=workspace).out == dot
    assert forge("list", "--topological-graph-density", cwd=workspace).code == 2


def test_duplicate_packages_are_listed_and_rejected_only_when_both_are_built(
    forge: Forge, workspace: Path
) -> None:
    (workspace / "src/a2").mkdir()
    (workspace / "src/a2/package.xml").write_text(manifest_text("a"))
    ran = forge("list", "--packages-select", "a", cwd=workspace)
    assert ran.out == "a\tsrc/a\t(ros.ament_cmake)\na\tsrc/a2\t(ros.ament_cmake)\n"
    assert "warning: two packages are named 'a': 'src/a' and 'src/a2'" in ran.err
    assert forge("info", "a", cwd=workspace).out.count("name: a\n") == 2
    assert forge("graph", "--packages-select", "a", "b", cwd=workspace).out == "a  + *\na   +*\nb    +\n"
    dot = forge("graph", "--dot", "--packages-select", "a", "b", cwd=workspace).out
    assert '  "a_1" [label = "a"];\n' in dot
    ran = forge("build", "--dry-run", "--packages-select", "a", cwd=workspace)
    assert (ran.code, "two packages are named 'a'" in ran.err) == (2, True)
    assert forge("build", "--dry-run", "--packages-select", "p", cwd=workspace).code == 0


BROKEN = "<package format='3'><name>{name}</name><!-- no maintainer --></package>"


@pytest.fixture
def with_broken(tree: Tree) -> Path:
    """Return a workspace in which 'user' needs 'broken', 'good' needs nothing, and a folder has no name."""
    return tree(
        {
            **cmake_package("good"),
            **cmake_package("user", needs="<depend>broken</depend>"),
            "src/b/package.xml": BROKEN.format(name="broken"),
            "src/nameless/package.xml": "<package",
        }
    )


@pytest.mark.parametrize(
    "options",
    [
        ("--packages-select", "good"),
        ("--packages-up-to", "good"),
        ("--packages-select-regex", "go"),
        ("--packages-skip", "broken", "user", "nameless"),
        ("--packages-skip-regex", "brok", "us", "name"),
        ("--packages-ignore", "broken", "nameless"),
        ("--packages-ignore-regex", "b", "n"),
        ("--packages-above", "good"),
        ("--packages-select", "good", "broken", "--packages-skip", "broken"),
    ],
)
def test_a_broken_manifest_stops_only_its_dependents(
    forge: Forge, with_broken: Path, options: tuple[str, ...]
) -> None:
    ran = forge("build", *options, cwd=with_broken)
    assert ran.code == 0, ran.err
    assert (with_broken / "install/good").is_dir()
    assert "error" not in ran.err
    for command in ("test", "doctor", "deps", "info", "list", "graph", "clean packages -y"):
        assert "error: " not in forge(*command.split(), *options, cwd=with_broken).err


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--packages-select", "broken"),
        ("--packages-select", "user"),
        ("--packages-up-to", "user"),
        ("--packages-above", "broken"),
        ("--packages-skip", "good"),
        ("--packages-select-regex", "bro"),
    ],
)
def test_a_broken_manifest_stops_its_dependents_with_a_hint(
    forge: Forge, with_broken: Path, options: tuple[str, ...]
) -> None:
    ran = forge("build", *options, cwd=with_broken)
    assert ran.code == 2
    assert "src/b/package.xml:1:1: error: element 'version' is missing" in ran.err
    remedy = "'--packages-ignore broken', or an empty file 'src/b/COLCON_IGNORE'"
    assert f"hint: to leave the package out: {remedy}" in ran.err
    assert "no package named" not in ran.err


@pytest.mark.parametrize(
    ("folder", "option", "names"),
    [
        ("src/b/src", "--packages-up-to", "a\nb\n"),
        ("src/b", "--packages-select", "b\n"),
        ("src/a", "--packages-above", "a\nb\nc\n"),
        ("src/p", "--packages-skip", "a\nb\nc\n"),
    ],
)
def test_a_dot_selects_the_package_of_the_current_folder(
    forge: Forge, workspace: Path, folder: str, option: str, names: str
) -> None:
    (workspace / folder).mkdir(exist_ok=True)
    assert forge("list", "-n", option, ".", cwd=workspace / folder).out == names


def test_a_dot_outside_of_packages_is_an_error(forge: Forge, workspace: Path) -> None:
    for folder in (workspace, workspace / "src/z"):
        ran = forge("build", "--packages-up-to", ".", cwd=folder)
        assert ran.code == 2
        assert ran.err.endswith("hint: '.' is the package around the current folder, which is in none\n")
