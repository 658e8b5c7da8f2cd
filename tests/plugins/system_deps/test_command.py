"""`forge deps` prints the system dependencies of a workspace as commands to paste."""

import hashlib
import io
import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from forge.base.own_environment import extra_command
from forge.plugins.system_deps.system import system_of
from forge.toolchain.python_modules import os_release
from tests.conftest import Forge, Ran, Tree
from tests.installs import Made, make_install
from tests.packages import manifest_text

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


pytest.importorskip("rosdep2", reason="needs rosdep: pip install rosdep")


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
    """Run `forge deps` without this machine's rosdep data."""
    env = {"ROS_HOME": str(root / "none")}
    return forge("deps", "--rosdep-file", "keys.yaml", "--os", system, *argv, cwd=root, env=env)


def test_mistyped_distributions_are_reported(forge: Forge, root: Path) -> None:
    assert deps(forge, root, "--rosdistro", "humbel").err.startswith(
        "warning: unknown ROS distribution 'humbel'\nhint: did you mean 'humble'?\n"
    )
    for name in ("jazzy", "zenith"):
        assert "unknown ROS distribution" not in deps(forge, root, "--rosdistro", name).err


def test_printed_commands_name_the_packages_that_need_each_key(forge: Forge, root: Path) -> None:
    ran = deps(forge, root)
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[0] == "# libfoo-dev, needed by a, b"
    assert lines[1] == "# python3-foo-pip (pip: foo), needed by a"
    assert lines[2] == "sudo apt-get install libfoo-dev"
    assert lines[3].endswith(" -m pip install foo")
    assert lines[4] == (
        "# nav2_msgs, needed by a: ROS package; source an installation that contains it, "
        "or choose a distribution with --rosdistro"
    )
    assert lines[5:] == ["# odd-one is unknown, needed by b"]


def test_package_names_follow_the_system(forge: Forge, root: Path) -> None:
    assert "sudo dnf install foo-devel\n" in deps(forge, root, system="openEuler:24.03").out
    assert "apt-get install libfoo-dev libfoo-tools\n" in deps(forge, root, system="debian:bookworm").out
    assert "# libfoo-dev is unknown" in deps(forge, root, system="debian:trixie").out


def test_dependency_kinds_and_packages_can_be_selected(forge: Forge, root: Path) -> None:
    assert "sphinx-of-foo" in deps(forge, root, "--dependency-types", "doc").out
    assert "nav2_msgs" not in deps(forge, root, "-t", "build", "test").out
    assert "nav2_msgs" not in deps(forge, root, "--packages-up-to", "b").out
    assert "roscpp-core" in forge("deps", cwd=root, env={"ROS_VERSION": "1"}).out
    wrong = deps(forge, root, "-t", "biuld")
    assert (wrong.code, wrong.err) == (
        2,
        "error: unknown dependency type 'biuld'\nhint: did you mean 'build'?\n",
    )


def test_installed_dependencies_can_be_listed(forge: Forge, root: Path) -> None:
    everything = deps(forge, root, "--all").out
    assert "# b (the workspace), needed by a\n" in everything
    assert "# std_msgs (forge), needed by a\n" in everything
    assert "# nothing (apt: nothing to install), needed by a\n" in everything
    assert "std_msgs" not in deps(forge, root).out


def test_the_underlays_of_the_build_are_used(forge: Forge, root: Path) -> None:
    """Remembered ones as well; and with their generators, the embedded interfaces cannot be used."""
    below = make_install(root / "below", [Made("nav2_msgs"), Made("rosidl_cmake")], merged=True).install
    make_install(root, [], underlays=(below,))
    out = deps(forge, root).out
    assert "nav2_msgs" not in out
    assert "# std_msgs, needed by a: ROS package" in out


def test_dependencies_can_be_printed_as_json(forge: Forge, root: Path) -> None:
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


def test_an_invalid_database_is_rejected(forge: Forge, root: Path) -> None:
    missing = forge("deps", "--rosdep-file", "gone.yaml", cwd=root)
    assert missing.code == 2
    assert missing.err == "gone.yaml: error: cannot read the rosdep file: no such file or directory\n"
    (root / "bad.yaml").write_text("a: [\n", encoding="utf-8")
    assert (
        "bad.yaml:2:1: error: not well-formed YAML"
        in forge("deps", "--rosdep-file", "bad.yaml", cwd=root).err
    )


def test_a_missing_database_lists_keys_and_a_hint(
    forge: Forge, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = {"ROS_HOME": str(root / "none")}
    ran = forge("deps", "--os", "ubuntu:jammy", cwd=root, env=env)
    assert ran.code == 0
    assert "# libfoo-dev is unknown, needed by a, b\n" in ran.out
    assert ran.err == (
        "warning: cannot look up 4 dependencies for ubuntu:jammy: this machine has no rosdep database\n"
        "hint: run `sudo rosdep init` and `rosdep update`, or give a file with names to '--rosdep-file'\n"
    )
    monkeypatch.setitem(sys.modules, "rosdep2", None)
    ran = forge("deps", "--os", "ubuntu:jammy", "--rosdistro", "humble", cwd=root, env=env)
    assert ran.code == 0
    assert "# libfoo-dev is unknown, needed by a, b\n" in ran.out
    assert "sudo apt-get install ros-humble-nav2-msgs\n" in ran.out
    assert ran.err == (
        "warning: cannot look up 4 dependencies for ubuntu:jammy: rosdep is not installed beside forge\n"
        f"hint: run `{extra_command('rosdep')}`, `sudo rosdep init` and `rosdep update`\n"
    )
    ran = deps(forge, root)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == f"error: '--rosdep-file' needs rosdep\nhint: run: {extra_command('rosdep')}\n"


def test_a_system_missing_from_the_database_is_reported(forge: Forge, root: Path) -> None:
    ran = deps(forge, root, "-t", "test", system="void")
    assert ran.out == "# odd-one is unknown, needed by b\n"
    assert ran.err == (
        "warning: cannot look up 1 dependency: rosdep's data has no names for void\n"
        "hint: list the names of a similar system, for example with '--os ubuntu:noble'\n"
    )


def test_dependencies_installed_on_this_machine_are_left_out(forge: Forge, tree: Tree) -> None:
    """These tests run in pytest: it is installed."""
    root = tree(
        {
            "keys.yaml": "k: {any: {pip: {packages: [PyTest, surely-not-installed]}}}\n",
            "src/a/package.xml": manifest_text("a", "<depend>k</depend>"),
        }
    )
    text = (root / "keys.yaml").read_text().replace("any", system_of(os_release()).name)
    (root / "keys.yaml").write_text(text)
    out = forge("deps", "--rosdep-file", "keys.yaml", cwd=root).out
    assert out.splitlines()[-1].endswith("-m pip install surely-not-installed")


def test_unreadable_packages_are_reported(forge: Forge, tree: Tree) -> None:
    ran = forge("deps", cwd=tree({"src/a/package.xml": "<package>"}))
    assert ran.code == 2
    assert "src/a/package.xml:" in ran.err
    ran = forge("deps", cwd=tree({"src/a/package.xml": "", "src/a/COLCON_IGNORE": ""}))
    assert (ran.code, ran.out) == (2, "")
    assert "no packages found below" in ran.err


def test_a_workspace_without_dependencies_is_reported(forge: Forge, tree: Tree) -> None:
    ran = forge("deps", cwd=tree({"src/a/package.xml": manifest_text("a")}))
    assert (ran.code, ran.out) == (0, "# nothing is missing\n")


def test_printed_commands_are_safe_for_any_name(forge: Forge, tree: Tree) -> None:
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


def test_system_package_names_of_ros_packages_depend_on_the_distribution(forge: Forge, root: Path) -> None:
    """Without data of the distribution their names follow from the rule for them."""
    named = "# nav2_msgs (apt: ros-jazzy-nav2-msgs), needed by a\n"
    assert named in deps(forge, root, "--rosdistro", "jazzy").out
    assert (
        "sudo apt-get install libfoo-dev ros-jazzy-nav2-msgs\n"
        in deps(forge, root, "--rosdistro", "jazzy").out
    )
    assert "sudo dnf install foo-devel ros-jazzy-nav2-msgs\n" in (
        deps(forge, root, "--rosdistro", "jazzy", system="openEuler:24.03").out
    )
    arch = deps(forge, root, "--rosdistro", "jazzy", system="arch").out
    assert "# nav2_msgs, needed by a: ROS package; source an installation that contains it\n" in arch
    env = {"ROS_DISTRO": "humble", "ROS_HOME": str(root / "none")}
    argv = ("deps", "--os", "ubuntu:jammy")
    assert " ros-humble-nav2-msgs\n" in forge(*argv, cwd=root, env=env).out
    assert " ros-jazzy-nav2-msgs\n" in forge(*argv, "--rosdistro", "jazzy", cwd=root, env=env).out


def test_conditions_are_evaluated_for_the_distribution(forge: Forge, tree: Tree) -> None:
    condition = '<depend condition="$ROS_DISTRO == humble">old_msgs</depend>'
    root = tree({"keys.yaml": "{}", "src/a/package.xml": manifest_text("a", condition)})
    assert "ros-humble-old-msgs" in deps(forge, root, "--rosdistro", "humble").out
    assert deps(forge, root, "--rosdistro", "jazzy").out == "# nothing is missing\n"


def test_distribution_data_determines_released_packages(forge: Forge, root: Path) -> None:
    """As `rosdep update` stores it: for each distribution the systems that it is built for."""
    cache = root / "home/rosdep/sources.cache"
    cache.mkdir(parents=True)
    url = "https://example.org/humble/distribution.yaml"
    (cache / "index").write_text(f"yaml {url} humble\n", encoding="utf-8")
    released = {"ubuntu": {"jammy": {"apt": {"packages": ["ros-humble-nav2-msgs"]}}}, "_is_ros": True}
    stored = cache / f"{hashlib.sha1(url.encode()).hexdigest()}.pickle"
    stored.write_bytes(pickle.dumps({"nav2_msgs": released}, 2))
    env = {"ROS_HOME": str(root / "home"), "ROS_DISTRO": "humble"}
    jammy = forge("deps", "--os", "ubuntu:jammy", cwd=root, env=env)
    assert "sudo apt-get install ros-humble-nav2-msgs\n" in jammy.out
    noble = forge("deps", "--os", "ubuntu:noble", cwd=root, env=env)
    assert (
        "# nav2_msgs, needed by a: not released for humble on ubuntu:noble; source an installation that "
        "contains it, or add its source code to the workspace\n"
    ) in noble.out
    assert " ros-jazzy-nav2-msgs\n" in (
        forge("deps", "--os", "ubuntu:jammy", "--rosdistro", "jazzy", cwd=root, env=env).out
    )


def test_invalid_rosdep_data_is_reported(forge: Forge, root: Path) -> None:
    cache = root / "home/rosdep/sources.cache"
    cache.mkdir(parents=True)
    (cache / "index").write_text("yaml https://example.org/x.yaml\n", encoding="utf-8")
    name = hashlib.sha1(b"https://example.org/x.yaml").hexdigest()
    (cache / f"{name}.pickle").write_bytes(b"torn")
    env = {"ROS_HOME": str(root / "home")}
    ran = forge("deps", "--rosdep-file", "keys.yaml", "--os", "ubuntu:jammy", cwd=root, env=env)
    assert ran.code == 2
    assert ran.err.startswith("error: rosdep cannot read its data: ")
    assert ran.err.endswith("\nhint: run 'rosdep update'\n")


@pytest.fixture
def installable(tree: Tree) -> Path:
    """Return a workspace that needs a package of this system, and programs that only log their arguments."""
    log = '#!/bin/sh\necho "${0##*/} $*" >> "$LOG"\nexit ${FAIL-0}\n'
    programs = ("apt-get", "dnf", "pacman", "zypper", "apk", "emerge")
    return tree(
        {
            "bin/sudo": '#!/bin/sh\nexec "$@"\n',
            **{f"bin/{program}": log for program in programs},
            "keys.yaml": json.dumps({"k": {system_of(os_release()).name: ["surely-not-installed"]}}),
            "src/a/package.xml": manifest_text("a", "<depend>k</depend>"),
        }
    )


def install(forge: Forge, root: Path, *argv: str, **env: str) -> Ran:
    variables = {
        "PATH": f"{root}/bin:/usr/bin:/bin",
        "LOG": str(root / "log"),
        "ROS_HOME": str(root / "none"),
        **env,
    }
    return forge("deps", "--install", "--rosdep-file", "keys.yaml", *argv, cwd=root, env=variables)


@pytest.mark.parametrize("answer", ["y\n", "no\n", ""])
def test_installation_shows_the_commands_and_asks_for_confirmation(
    forge: Forge, installable: Path, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    runs = answer == "y\n"
    ran = install(forge, installable)
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[0].startswith("# k (")
    assert lines[1].endswith(" surely-not-installed")
    assert lines[2] == "Run this command? [y/N] " + ("" if runs else "nothing was installed")
    assert (installable / "log").exists() is runs
    if runs:
        logged = (installable / "log").read_text()
        assert lines[1].removeprefix("sudo ") == logged.strip()


def test_yes_skips_the_confirmation(forge: Forge, installable: Path) -> None:
    ran = install(forge, installable, "-y")
    assert ran.code == 0
    assert "[y/N]" not in ran.out
    logged = (installable / "log").read_text()
    assert logged.startswith(("apt-get install -y ", "dnf install -y ", "zypper install -y ")) or (
        system_of(os_release()).manager not in {"apt", "dnf", "zypper"}
    )


def test_a_failing_command_stops_the_installation(forge: Forge, installable: Path) -> None:
    ran = install(forge, installable, "-y", FAIL="100")
    assert ran.code == 2
    assert "surely-not-installed' failed with exit code 100\n" in ran.err
    (installable / "bin/sudo").unlink()
    for program in ("apt-get", "dnf", "pacman", "zypper", "apk", "emerge"):
        (installable / "bin" / program).unlink()
    ran = install(forge, installable, "-y", PATH=str(installable / "bin"))
    assert ran.code == 2
    assert ran.err.startswith("error: cannot run '")


def test_nothing_is_installed_while_a_package_is_unknown(forge: Forge, installable: Path) -> None:
    (installable / "src/a/package.xml").write_text(
        manifest_text("a", "<depend>k</depend>", "<depend>odd-one</depend>", "<depend>odd_msgs</depend>")
    )
    ran = install(forge, installable, "-y")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == (
        "error: no package is known for 'odd-one', needed by a\n"
        "error: no package is known for 'odd_msgs', needed by a\n"
        "hint: nothing was installed; name packages in a '--rosdep-file', "
        "or ignore with '--skip-keys odd-one odd_msgs'\n"
    )
    assert not (installable / "log").exists()
    assert install(forge, installable, "-y", "--skip-keys", "odd-one", "odd_msgs").code == 0
    assert (installable / "log").exists()
    nothing = install(forge, installable, "--skip-keys", "odd-one", "odd_msgs", "k")
    assert (nothing.code, nothing.out) == (0, "# nothing is missing\n")


@pytest.mark.parametrize("option", [("--os", "ubuntu:jammy"), ("--json",)])
def test_installation_is_only_for_this_machine(forge: Forge, root: Path, option: tuple[str, ...]) -> None:
    ran = forge("deps", "--install", *option, cwd=root)
    assert (ran.code, ran.err) == (2, f"error: '--install' and '{option[0]}' exclude each other\n")
