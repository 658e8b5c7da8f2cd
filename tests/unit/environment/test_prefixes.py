from pathlib import Path

import pytest

from forge.environment.prefixes import (
    Underlays,
    find_underlays,
    provider,
)
from tests.conftest import Tree
from tests.installs import Made, make_install

OWN = Path("/nowhere/install")


def paths(*folders: Path) -> str:
    return ":".join(map(str, folders))


def test_underlays_are_ordered_lowest_first_and_prefixes_highest_first(tmp_path: Path) -> None:
    low = make_install(tmp_path / "low", [Made("base")], merged=True).install
    high = make_install(tmp_path / "high", [Made("library"), Made("tool")]).install
    variables = {
        "COLCON_PREFIX_PATH": paths(high, low),
        "AMENT_PREFIX_PATH": paths(high / "tool", low),
        "CMAKE_PREFIX_PATH": paths(high / "tool", high / "library"),
    }
    found = find_underlays(variables, OWN)
    assert found.chain == (low, high)
    assert found.prefixes == (high / "tool", low, high / "library")


def test_an_ament_prefix_is_mapped_to_the_root_with_setup_scripts(tree: Tree) -> None:
    root = tree(
        {
            "humble/local_setup.bash": "",
            "ws/.colcon_install_layout": "isolated\n",
            "ws/p/share/p/package.xml": "",
            "bare/share/p/package.xml": "",
        }
    )
    variables = {"AMENT_PREFIX_PATH": paths(root / "ws/p", root / "bare", root / "humble")}
    found = find_underlays(variables, OWN)
    assert found.chain == (root / "humble", root / "ws")
    assert found.prefixes == (root / "ws/p", root / "bare", root / "humble")


@pytest.mark.parametrize(
    "evidence",
    [
        "share/ament_index/resource_index/packages/Lib",
        "share/Lib/package.xml",
        "share/Lib/cmake/LibConfig.cmake",
        "share/Lib/cmake/lib-config.cmake",
        "lib/cmake/Lib/LibConfig.cmake",
    ],
)
def test_a_manifest_or_cmake_config_identifies_a_provider(evidence: str, tree: Tree) -> None:
    root = tree({f"low/{evidence}": "", f"high/{evidence}": "", "other/share/Other/package.xml": ""})
    sourced = Underlays(prefixes=(root / "other", root / "high", root / "low"))
    assert provider("Lib", sourced, ()) == root / "high"
    assert provider("Missing", sourced, ()) is None
    in_system = provider("Lib", Underlays(), (root / "high",))
    assert in_system == (None if "ament_index" in evidence else root / "high")
