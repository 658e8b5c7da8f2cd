"""Packages that have only a Cargo.toml."""

from tests.conftest import Tree
from tests.unit.workspace.test_plain_packages import walked


def test_a_cargo_manifest_describes_a_package(tree: Tree) -> None:
    manifest = (
        "[package]\nname = 'node'\nversion = '1.2.0'\n[workspace]\n[dependencies]\na = '1'\n"
        "b = { package = 'c', path = '../c' }\nnode = '*'\n[target.'cfg(unix)'.build-dependencies]\nd = '1'\n"
        "[dev-dependencies]\ne = '1'\n"
    )
    root = tree(
        {"x/Cargo.toml": manifest, "x/member/Cargo.toml": "[package]\nname = 'm'\nversion.workspace = true\n"}
    )
    packages = walked(root).packages
    assert {name: (p.type, p.manifest.version) for name, p in packages.items()} == {
        "node": ("cargo", "1.2.0"),
        "m": ("cargo", ""),
    }
    assert [dependency.name for dependency in packages["node"].manifest.dependencies] == ["a", "c", "d", "e"]


def test_a_cargo_workspace_manifest_is_not_a_package(tree: Tree) -> None:
    root = tree(
        {"x/Cargo.toml": "[workspace]\nmembers = ['y']\n", "x/y/Cargo.toml": "[package]\nname = 'y'\n"}
    )
    assert list(walked(root).packages) == ["y"]
