"""The package cache with other plugins."""

import shutil

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.testable import cmake_package


@pytest.mark.parametrize(
    ("options", "variables"), [(["--cache"], {}), ([], {"FORGE_REMOTE_CACHE": "http://127.0.0.1:1"})]
)
def test_an_audit_cannot_use_a_package_cache(
    forge: Forge, tree: Tree, options: list[str], variables: dict[str, str]
) -> None:
    root = tree({"src/a/package.xml": manifest_text("a")})
    ran = forge("build", "--audit", *options, cwd=root, env=variables)
    assert ran.code == 2
    assert "--audit cannot be combined with" in ran.err
    assert not (root / "install/a").exists()


@pytest.mark.needs("cmake", "ninja")
def test_the_summary_of_github_counts_packages_from_the_cache(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), "summary.md": ""})
    env = {
        "GITHUB_ACTIONS": "true",
        "GITHUB_WORKSPACE": str(root),
        "GITHUB_STEP_SUMMARY": str(root / "summary.md"),
    }
    forge("build", "--cache", "store", cwd=root, env=env)
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    forge("build", "--cache", "store", cwd=root, env=env)
    summary = (root / "summary.md").read_text(encoding="utf-8")
    assert "Package cache: 0 restored, 1 built.\n" in summary
    assert "Package cache: 1 restored, 0 built.\n" in summary
