"""What is measured of public repositories: which packages, and their types beside rosbags."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from tests.generated import catalog_of, embedded_catalog, generate, importable
from tests.upstream import types_check
from tests.upstream.figures import Compatibility, Repository, with_repository
from tests.upstream.scope import interface_packages

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Tree

GENERATE = "rosidl_generate_interfaces(${PROJECT_NAME} msg/A.msg)"


def package(folder: str, script: str, *needs: str) -> dict[str, str]:
    """Return the files of an ament_cmake package, named as its folder."""
    name = folder.rpartition("/")[2].removeprefix("org+")
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    manifest = (
        f'<package format="3"><name>{name}</name><version>1.0.0</version><description>d</description>'
        f'<maintainer email="a@example.com">A</maintainer><license>Apache-2.0</license>{depends}'
        "<export><build_type>ament_cmake</build_type></export></package>"
    )
    return {f"{folder}/package.xml": manifest, f"{folder}/CMakeLists.txt": script}


def test_interface_packages_are_found_by_their_checkouts(tree: Tree) -> None:
    """A client library counts if CMake asks for it. Packages outside of checkouts, as data, do not."""
    root = tree(
        {
            **package("here/org+robot/robot_msgs", GENERATE, "std_msgs", "rclcpp"),
            **package("here/org+robot/robot_common", ""),
            **package("here/org+robot/robot_node", f"find_package(rclcpp REQUIRED)\n{GENERATE}"),
            **package("ws/src/org+arm_msgs", GENERATE),
            **package("ws/src/schema", GENERATE),
        }
    )
    (root / "ws/src/robot").symlink_to(root / "here/org+robot")
    assert interface_packages(root / "ws", "jazzy") == {
        root / "here/org+robot": ["robot_msgs"],
        root / "ws/src/org+arm_msgs": ["arm_msgs"],
    }


MESSAGE = "uint8[] data\nfloat32 x 1.5\nbyte b\nstring<=4 s\n"
SERVICE = """
#include "reading_msgs/msg/Reading.idl"

module reading_msgs { module srv {
  struct Save_Request { int32 id; sequence<reading_msgs::msg::Reading> readings; };
  struct Save_Response { boolean done; };
}; };
"""
WRONG = "rosbags reads other values"


@pytest.mark.parametrize(
    ("installed", "faults"),
    [
        ({}, {}),
        (
            {"msg/Reading.msg": MESSAGE.replace("float32 x 1.5", "int32 x")},
            {"Reading": WRONG, "Save_Request": WRONG},
        ),
        ({"srv/Save.idl": SERVICE.replace("int32 id", "float id")}, {"Save_Request": WRONG}),
    ],
)
def test_types_are_compared_with_those_that_rosbags_reads(
    installed: dict[str, str],
    faults: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    texts = {
        "msg/Reading.msg": MESSAGE,
        "srv/Read.srv": "---\nwstring name\n",
        "srv/Save.idl": SERVICE,
    }
    generate(tmp_path, embedded_catalog("builtin_interfaces"))
    generate(tmp_path, catalog_of("reading_msgs", texts))
    for path, text in {**texts, **installed}.items():
        file = tmp_path / "share/reading_msgs" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with importable(tmp_path):
        assert types_check.main(["reading_msgs"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["types"] == {"reading_msgs": 3}
    assert report["faults"] == {f"reading_msgs/msg/{name}": fault for name, fault in faults.items()}
    assert report["unread"] == {}


def test_a_new_row_leaves_other_distributions_and_notes() -> None:
    before = Compatibility(
        repositories=(Repository("org/robot", "a", {"humble": (1, 2), "rolling": (2, 2)}, 7, ("why",)),)
    )
    row = Repository("org/robot", "b", {"humble": (2, 2)}, 6)
    merged = Repository("org/robot", "b", {"humble": (2, 2), "rolling": (2, 2)}, 7, ("why",))
    assert with_repository(before, row).repositories == (merged,)
    other = Repository("org/arm", "c", {"jazzy": (1, 1)}, 1)
    assert with_repository(before, other).repositories == (other, *before.repositories)
