"""--rosdistro: the ROS distribution whose interfaces forge brings along."""

import json
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree

MANIFEST = """<package format="3"><name>a</name><version>1.0.0</version><description>d</description>
<maintainer email="m@example.com">m</maintainer><license>MIT</license>
<depend condition="$ROS_DISTRO >= jazzy">service_msgs</depend>
<export><build_type>cmake</build_type></export></package>"""


@pytest.fixture
def root(tree: Tree) -> Path:
    lists = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\n"
    return tree({"src/a/package.xml": MANIFEST, "src/a/CMakeLists.txt": lists})


def told(forge: Forge, root: Path, **env: str) -> object:
    return json.loads(forge("info", "--json", cwd=root, env=env).out)["rosdistro"]


def test_the_environment_overrides_forge_toml_the_last_build_and_humble(forge: Forge, root: Path) -> None:
    assert told(forge, root) == "humble"
    assert "  ROS distribution: humble\n" in forge("info", cwd=root).out
    state = {"python": "python3", "underlays": [], "rosdistro": "kilted"}
    (root / "install").mkdir()
    (root / "install/.forge.json").write_text(json.dumps(state))
    assert told(forge, root) == "kilted"
    (root / "forge.toml").write_text('[build]\nrosdistro = "rolling"\n')
    assert told(forge, root) == "rolling"
    assert told(forge, root, ROS_DISTRO="jazzy") == "jazzy"


def test_an_overlay_uses_the_distribution_of_its_underlay(forge: Forge, root: Path) -> None:
    """Also if the underlay is known only from the last build, which was for another distribution."""
    underlay = root / "underlay"
    underlay.mkdir()
    state = {"python": "python3", "underlays": [], "rosdistro": "jazzy"}
    (underlay / ".forge.json").write_text(json.dumps(state))
    (underlay / ".colcon_install_layout").write_text("isolated\n")
    assert told(forge, root, COLCON_PREFIX_PATH=str(underlay)) == "jazzy"
    assert "service_msgs" in plan(forge, root, COLCON_PREFIX_PATH=str(underlay))
    assert "service_msgs" not in plan(forge, root, COLCON_PREFIX_PATH=str(underlay), ROS_DISTRO="humble")
    (root / "install").mkdir(exist_ok=True)
    own = {"python": "python3", "underlays": [str(underlay)], "rosdistro": "humble"}
    (root / "install/.forge.json").write_text(json.dumps(own))
    assert told(forge, root) == "jazzy"


def plan(forge: Forge, root: Path, *argv: str, **env: str) -> str:
    return forge("build", "--dry-run", *argv, cwd=root, env=env).out


def test_conditions_of_manifests_are_evaluated_for_the_distribution(forge: Forge, root: Path) -> None:
    assert "service_msgs" not in plan(forge, root)
    assert "service_msgs" in plan(forge, root, "--rosdistro", "jazzy")
    assert "service_msgs" in plan(forge, root, ROS_DISTRO="kilted")
    assert "service_msgs" not in plan(forge, root, "--rosdistro", "humble", ROS_DISTRO="kilted")
    (root / "forge.toml").write_text('[build]\nrosdistro = "rolling"\n')
    assert "service_msgs" in plan(forge, root)
    assert "service_msgs" not in plan(forge, root, ROS_DISTRO="humble")


def test_a_distribution_without_embedded_interfaces_is_rejected(forge: Forge, root: Path) -> None:
    result = forge("build", "--rosdistro", "kiltd", cwd=root)
    assert result.code == 2
    assert result.err == (
        "error: --rosdistro: unknown ROS distribution 'kiltd'\nhint: did you mean 'kilted'?\n"
    )


@pytest.mark.parametrize(("distribution", "number"), [("humble", 0), ("iron", 0), ("jazzy", 1)])
def test_interfaces_are_shown_for_the_distribution(
    forge: Forge, root: Path, distribution: str, number: int
) -> None:
    shown = forge("interface", "show", "sensor_msgs/msg/Range", cwd=root, env={"ROS_DISTRO": distribution})
    assert shown.out.count("float32 variance") == number


def test_an_unknown_type_names_the_distributions_that_have_it(forge: Forge, root: Path) -> None:
    (root / "msg").mkdir()
    (root / "msg/A.msg").write_text("nav_msgs/Goals goals\n")
    argv = ("interface", "generate", ".", "--package", "a", "--output", "out", "--lang", "json")
    result = forge(*argv, cwd=root)
    hint = (
        "hint: 'nav_msgs/Goals' exists in Jazzy and later, this workspace is for Humble: --rosdistro jazzy\n"
    )
    assert result.code == 2
    assert "error: unknown type 'nav_msgs/Goals'" in result.err
    assert result.err.endswith(hint)
    assert forge("interface", "show", "nav_msgs/msg/Goals", cwd=root).err.endswith(hint)
    assert forge(*argv, "--rosdistro", "kilted", cwd=root).code == 0
    gone = forge("interface", "show", "geometry_msgs/msg/Pose2D", "--rosdistro", "rolling", cwd=root).err
    assert (
        "'geometry_msgs/Pose2D' exists up to Kilted, this workspace is for Rolling: --rosdistro kilted"
        in gone
    )
    missing = forge("interface", "package", "type_description_interfaces", cwd=root)
    assert "'type_description_interfaces' exists in Jazzy and later" in missing.err


def test_a_missing_package_names_the_distributions_that_have_it(forge: Forge, root: Path) -> None:
    (root / "src/a/package.xml").write_text(MANIFEST.replace("service_msgs", "type_description_interfaces"))
    planned = forge("build", "--dry-run", cwd=root, env={"ROS_DISTRO": "jazzy"})
    assert "type_description_interfaces" in planned.out
    text = MANIFEST.replace("$ROS_DISTRO >= jazzy", "$ROS_DISTRO == humble")
    text = text.replace("service_msgs", "type_description_interfaces")
    (root / "src/a/package.xml").write_text(text)
    (root / "src/a/CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.18)\nproject(a)\n"
        "find_package(type_description_interfaces REQUIRED)\n"
    )
    refused = forge("build", cwd=root).err
    assert (
        "'a' needs 'type_description_interfaces', which the chosen ROS distribution does not have" in refused
    )
    assert "this workspace is for Humble: --rosdistro jazzy" in refused
