"""`forge info` on small workspaces."""

import json
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return a workspace in which c needs b needs a."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>"),
            "src/z/c/package.xml": manifest_text("c", "<exec_depend>b</exec_depend>"),
        }
    )


def test_the_manifest_is_printed(forge: Forge, workspace: Path) -> None:
    assert forge("info", "c", cwd=workspace).out == (
        "path: src/z/c\n  type: ros.ament_cmake\n  name: c\n"
        "  dependencies:\n    build: \n    run: b\n    test: \n"
        "  metadata:\n    maintainers: ['The tests <tests@example.com>']\n    version: 0.1.0\n"
    )
    assert "path: ../../a\n" in forge("info", "a", cwd=workspace / "src/z/c").out


def test_unknown_names_are_errors_only_if_no_package_is_known(forge: Forge, workspace: Path) -> None:
    ran = forge("info", "cc", "b", cwd=workspace)
    assert ran.code == 0
    assert ran.err == "warning: package 'cc' is not in the workspace\nhint: did you mean 'c'?\n"
    assert forge("info", "cc", cwd=workspace).code == 2


def test_json_describes_the_workspace_and_its_packages(forge: Forge, workspace: Path) -> None:
    said = json.loads(forge("info", "--json", "b", cwd=workspace).out)
    assert (said["workspace"], said["underlays"]) == (str(workspace), [])
    assert said["python"].keys() == {"path", "version", "origin"}
    (package,) = said["packages"]
    assert package["dependencies"] == {"build": ["a"], "run": ["a"], "test": []}


def test_platforms_of_cross_builds_are_printed(forge: Forge, tree: Tree) -> None:
    files = {f"install/{folder}/.colcon_install_layout": "isolated\n" for folder in ("", "aarch64-linux-gnu")}
    root = tree({"src/a/package.xml": manifest_text("a"), **files})
    assert "  built for other platforms: aarch64-linux-gnu\n" in forge("info", cwd=root).out
