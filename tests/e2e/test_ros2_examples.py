"""The examples that need rclcpp or rclpy: what holds of them on a machine without any ROS."""

import re
import shutil
from pathlib import Path

import pytest

from forge.workspace.manifest import parse_manifest
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, Manifest
from tests.conftest import Forge
from tests.snippets import ROOT, shell

EXAMPLES = ROOT / "examples_ws"
SOURCES = EXAMPLES / "ros2/src"
NODES = sorted(path.name for path in SOURCES.iterdir())
SHARED = sorted(path.name for path in (EXAMPLES / "src").iterdir())


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """Copy the sources of both workspaces and return the folder of the outer one."""
    folder = tmp_path / "examples_ws"
    results = shutil.ignore_patterns("build", "install", "log")
    shutil.copytree(EXAMPLES / "src", folder / "src")
    shutil.copytree(EXAMPLES / "ros2", folder / "ros2", ignore=results)
    return folder


def code(package: str, *patterns: str) -> str:
    """Return the text of a package's files that fit one of the patterns."""
    paths = [path for pattern in patterns for path in sorted((SOURCES / package).rglob(pattern))]
    return "".join(path.read_text(encoding="utf-8") for path in paths)


def manifest_of(package: str) -> Manifest:
    path = SOURCES / package / "package.xml"
    return parse_manifest(path.read_bytes(), path, {})


def programs(package: str) -> set[str]:
    """Return the names of what a package installs for `ros2 run`."""
    targets = re.findall(r"(?:add_executable\(|EXECUTABLE )(\w+)", code(package, "CMakeLists.txt"))
    scripts = re.findall(r'"(\w+) = [\w.]+:\w+"', code(package, "setup.py"))
    return {*targets, *scripts}


def components(package: str) -> set[str]:
    """Return the classes that a package registers as components."""
    return set(re.findall(r'PLUGIN "([\w:]+)"', code(package, "CMakeLists.txt")))


def text_of_launch(path: Path) -> str:
    """Return a launch file with the name of its package in place of the constant."""
    text = path.read_text(encoding="utf-8")
    for constant in re.findall(r'^PACKAGE = ("\w+")$', text, re.MULTILINE):
        text = text.replace("package=PACKAGE", f"package={constant}")
    return text


def test_the_ros2_workspace_includes_the_outer_packages(forge: Forge, workspace: Path) -> None:
    """The nodes speak interfaces and use a library that were written without any ROS."""
    listed = forge("list", "--names-only", cwd=workspace / "ros2")
    assert listed.out.split() == sorted([*NODES, *SHARED])
    assert listed.err == ""


def test_a_build_without_ros_lists_missing_packages_first(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--dry-run", cwd=workspace / "ros2")
    assert ran.code == 0
    warnings = " ".join(line for line in ran.err.splitlines() if ": warning: " in line)
    assert {"rclcpp", "rclcpp_action", "rclcpp_components", "rclcpp_lifecycle"} <= {
        *re.findall(r"'(\w+)'", warnings)
    }


def test_packages_that_need_rclpy_only_at_runtime_are_built(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--packages-select", "example_py", cwd=workspace / "ros2")
    assert ran.code == 0
    assert "'example_py' needs 'rclpy'" in ran.err
    assert (workspace / "ros2/install/example_py/lib/example_py/node_02").is_file()


def test_the_demo_reports_missing_ros_immediately(workspace: Path) -> None:
    output = shell('PATH=/usr/bin:/bin sh ros2/demo.sh; echo "ended with $?"', workspace)
    assert output == "source a ROS 2 first: these nodes need rclcpp and rclpy\nended with 2\n"
    assert not (workspace / "ros2/build").exists()


@pytest.mark.parametrize("package", NODES)
def test_manifests_declare_the_packages_that_the_build_looks_for(package: str) -> None:
    """Each find_package of CMakeLists.txt is a dependency, and each one to build with is looked for."""
    manifest = manifest_of(package)
    found = set(re.findall(r"find_package\((\w+)", code(package, "CMakeLists.txt")))
    assert manifest.name == package
    assert found == set(manifest.names(BUILD_KINDS))


@pytest.mark.parametrize("package", NODES)
def test_included_and_imported_packages_are_declared(package: str) -> None:
    manifest = manifest_of(package)
    included = set(re.findall(r'#include "(\w+)/', code(package, "*.cpp", "*.hpp")))
    imported = set(re.findall(r"^(?:from|import) (\w+)", code(package, "*.py"), re.MULTILINE))
    own = {package, "pathlib", "setuptools", "time"}
    assert (included | imported) - own <= set(manifest.names(BUILD_KINDS | RUN_KINDS))


@pytest.mark.parametrize("path", sorted(SOURCES.rglob("*.launch.*")), ids=lambda path: path.name)
def test_launch_files_start_existing_programs(path: Path) -> None:
    started = re.findall(r'(?:package|pkg)="(\w+)",?\s+exec(?:utable)?="(\w+)"', text_of_launch(path))
    assert started
    for package, program in started:
        if package in NODES:
            assert program in programs(package)
        else:
            assert package in manifest_of("robot_startup").names(RUN_KINDS)


def test_the_component_launch_file_loads_registered_classes() -> None:
    path = SOURCES / "robot_startup/launch/example_composition.launch.py"
    loaded = re.findall(r'package="(\w+)",\s+plugin="([\w:]+)"', text_of_launch(path))
    assert loaded
    for package, plugin in loaded:
        assert plugin in components(package)
    registered = re.findall(r"RCLCPP_COMPONENTS_REGISTER_NODE\(([\w:]+)\)", code(loaded[0][0], "*.cpp"))
    assert set(registered) == components(loaded[0][0])
