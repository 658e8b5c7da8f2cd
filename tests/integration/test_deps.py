"""`forge deps` prints the system dependencies of a workspace as commands to paste."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING

import pytest

from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Ran, Tree

DATABASE = """
libfoo-dev:
  debian: {bookworm: [libfoo-dev, libfoo-tools], '*': null}
  openeuler: [foo-devel]
  ubuntu: {jammy: {apt: {packages: [libfoo-dev]}}}
python3-foo-pip:
  ubuntu: {pip: {packages: [foo]}}
  openeuler: {'24.03': {pip: {packages: [foo]}}}
nothing:
  ubuntu: []
"""


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a workspace that needs a little of everything."""
    return tree(
        {
            "keys.yaml": DATABASE,
            "src/a/package.xml": manifest_text(
                "a",
                "<depend>libfoo-dev</depend>",
                "<depend>b</depend>",
                "<exec_depend>python3-foo-pip</exec_depend>",
                "<exec_depend>nav2_msgs</exec_depend>",
                "<depend>std_msgs</depend>",
                "<depend>nothing</depend>",
                '<depend condition="$ROS_VERSION == 1">roscpp-core</depend>',
                "<doc_depend>sphinx-of-foo</doc_depend>",
            ),
            "src/b/package.xml": manifest_text(
                "b", "<build_depend>libfoo-dev</build_depend>", "<test_depend>odd-one</test_depend>"
            ),
        }
    )


def deps(forge: Forge, root: Path, *argv: str, system: str = "ubuntu:jammy") -> Ran:
    """Run it far from this machine's own rosdep."""
    env = {"ROSDEP_SOURCE_PATH": str(root / "none"), "ROS_HOME": str(root / "none")}
    return forge("deps", "--rosdep-file", "keys.yaml", "--os", system, *argv, cwd=root, env=env)


def test_lines_to_paste_name_the_packages_that_need_each_key(forge: Forge, root: Path) -> None:
    ran = deps(forge, root)
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[0] == "# libfoo-dev, needed by a, b"
    assert lines[1] == "# python3-foo-pip (pip: foo), needed by a"
    assert lines[2] == "sudo apt-get install libfoo-dev"
    assert lines[3].endswith(" -m pip install foo")
    assert lines[4:] == [
        "# nav2_msgs, needed by a: ROS package; source an installation that contains it",
        "# odd-one is unknown, needed by b",
    ]


def test_names_are_those_of_the_system(forge: Forge, root: Path) -> None:
    assert "sudo dnf install foo-devel\n" in deps(forge, root, system="openEuler:24.03").out
    assert "apt-get install libfoo-dev libfoo-tools\n" in deps(forge, root, system="debian:bookworm").out
    assert "# libfoo-dev is unknown" in deps(forge, root, system="debian:trixie").out


def test_kinds_and_packages_can_be_chosen(forge: Forge, root: Path) -> None:
    assert "sphinx-of-foo" in deps(forge, root, "--dependency-types", "doc").out
    assert "nav2_msgs" not in deps(forge, root, "-t", "build", "test").out
    assert "nav2_msgs" not in deps(forge, root, "--packages-up-to", "b").out
    assert "roscpp-core" in forge("deps", cwd=root, env={"ROS_VERSION": "1"}).out
    wrong = deps(forge, root, "-t", "biuld")
    assert (wrong.code, wrong.err) == (
        2,
        "error: unknown dependency type 'biuld'\nhint: did you mean 'build'?\n",
    )


def test_what_is_there_is_named_only_when_asked(forge: Forge, root: Path) -> None:
    everything = deps(forge, root, "--all").out
    assert "# b (the workspace), needed by a\n" in everything
    assert "# std_msgs (forge), needed by a\n" in everything
    assert "# nothing (apt: nothing to install), needed by a\n" in everything
    assert "std_msgs" not in deps(forge, root).out


def test_as_json(forge: Forge, root: Path) -> None:
    found = json.loads(deps(forge, root, "--json").out)
    assert found["system"] == "ubuntu:jammy"
    by_key = {need["key"]: need for need in found["needs"]}
    assert by_key["libfoo-dev"] == {
        "key": "libfoo-dev",
        "users": ["a", "b"],
        "provider": None,
        "manager": "apt",
        "names": ["libfoo-dev"],
        "missing": True,
    }
    assert by_key["b"]["provider"] == "the workspace"
    assert by_key["odd-one"]["manager"] is None


def test_a_file_that_is_no_database(forge: Forge, root: Path) -> None:
    missing = forge("deps", "--rosdep-file", "gone.yaml", cwd=root)
    assert missing.code == 2
    assert missing.err == "gone.yaml: error: cannot read the rosdep file: no such file or directory\n"
    (root / "bad.yaml").write_text("a: [\n", encoding="utf-8")
    assert (
        "bad.yaml:2:1: error: not well-formed YAML"
        in forge("deps", "--rosdep-file", "bad.yaml", cwd=root).err
    )


def test_without_a_database_keys_are_listed_with_the_way_to_get_one(forge: Forge, root: Path) -> None:
    env = {"ROSDEP_SOURCE_PATH": str(root / "none"), "ROS_HOME": str(root / "none")}
    ran = forge("deps", "--os", "ubuntu:jammy", cwd=root, env=env)
    assert ran.code == 0
    assert "# libfoo-dev is unknown, needed by a, b\n" in ran.out
    assert ran.err == (
        "warning: cannot look up 4 dependencies for ubuntu:jammy: this machine has no rosdep database\n"
        "hint: run `pip install 'ros-forge[rosdep]'`, `sudo rosdep init` and `rosdep update`, "
        "or give a file with names to '--rosdep-file'\n"
    )


def test_a_system_that_no_database_has_names_for(forge: Forge, root: Path) -> None:
    ran = deps(forge, root, "-t", "test", system="void")
    assert ran.out == "# odd-one is unknown, needed by b\n"
    assert ran.err == (
        "warning: cannot look up 1 dependency: rosdep's data has no names for void\n"
        "hint: list the names of a similar system, for example with '--os ubuntu:noble'\n"
    )


def test_what_this_machine_has_is_left_out(forge: Forge, tree: Tree) -> None:
    """These tests run in pytest: it is installed."""
    root = tree(
        {
            "keys.yaml": "k: {any: {pip: {packages: [PyTest, surely-not-installed]}}}\n",
            "src/a/package.xml": manifest_text("a", "<depend>k</depend>"),
        }
    )
    from forge.doctor.system_deps.system import os_release, system_of  # noqa: PLC0415

    text = (root / "keys.yaml").read_text().replace("any", system_of(os_release()).name)
    (root / "keys.yaml").write_text(text)
    out = forge("deps", "--rosdep-file", "keys.yaml", cwd=root).out
    assert out.splitlines()[-1].endswith("-m pip install surely-not-installed")


def test_what_cannot_be_read_is_not_said_to_need_nothing(forge: Forge, tree: Tree) -> None:
    ran = forge("deps", cwd=tree({"src/a/package.xml": "<package>"}))
    assert ran.code == 2
    assert "src/a/package.xml:" in ran.err
    ran = forge("deps", cwd=tree({"src/a/package.xml": "", "src/a/COLCON_IGNORE": ""}))
    assert (ran.code, ran.out) == (2, "")
    assert "no packages found below" in ran.err


def test_a_workspace_that_needs_nothing(forge: Forge, tree: Tree) -> None:
    ran = forge("deps", cwd=tree({"src/a/package.xml": manifest_text("a")}))
    assert (ran.code, ran.out) == (0, "# nothing is missing\n")


def test_what_is_printed_can_be_given_to_a_shell_whatever_names_are(forge: Forge, tree: Tree) -> None:
    """Names come from files that others wrote: none of them may become a command or an option."""
    evil = "x\ntouch made\n"
    database = {
        "k": {"ubuntu": ["a; touch made", "$(touch made)", "--option"]},
        "l": {"ubuntu": {"source": {"packages": [evil]}}},
    }
    root = tree(
        {
            "keys.yaml": json.dumps(database),
            "src/a/package.xml": manifest_text("a", "<depend>k</depend>", "<depend>l</depend>"),
        }
    )
    ran = deps(forge, root, "--all")
    assert ran.code == 0, ran.err
    out = ran.out
    assert "'a; touch made'" in out
    assert "--option" not in "".join(line for line in out.splitlines() if not line.startswith("#"))
    harmless = "sudo() { :; }\n"
    subprocess.run(["sh", "-c", harmless + out], cwd=root, check=True)
    assert not (root / "made").exists()
