"""`forge clean` with the files that other plugins write."""

import json

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.plugins.compile_commands.test_compile_commands import library

GROUP = "<member_of_group>rosidl_interface_packages</member_of_group>"


def test_interface_pages_in_the_build_folder_are_removed_with_it(forge: Forge, tree: Tree) -> None:
    root = tree({"src/p/package.xml": manifest_text("p", GROUP), "src/p/msg/A.msg": "int8 x\n"})
    assert forge("interface", "docs", cwd=root).code == 0
    assert (root / "build").is_dir()
    assert forge("clean", "workspace", "--yes", cwd=root).code == 0
    assert not (root / "build").exists()


@pytest.mark.needs("cmake", "ninja", "g++")
def test_compile_commands_of_removed_packages_are_removed(forge: Forge, built: Tree) -> None:
    root = built({**library("a"), **library("b")})
    assert forge("clean", "packages", "a", "-y", cwd=root).code == 0
    (entry,) = json.loads((root / "build/compile_commands.json").read_text())
    assert entry["file"].endswith("/b.cpp")


@pytest.mark.needs("cmake", "ninja", "g++")
def test_the_code_quality_report_of_gitlab_is_removed(forge: Forge, tree: Tree) -> None:
    root = tree(library("a"))
    (root / "src/a/a.cpp").write_text("#warning old\n", encoding="utf-8")
    assert forge("build", cwd=root, env={"GITLAB_CI": "true", "CI_PROJECT_DIR": str(root)}).code == 0
    assert (root / "log/gl-code-quality-report.json").is_file()
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert not (root / "log").exists()
