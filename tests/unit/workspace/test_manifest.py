"""package.xml to Manifest."""

from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Manifest
from tests.packages import manifest_text

PATH = Path("src/a/package.xml")


def parse(text: str) -> Manifest:
    return parse_manifest(text.encode(), PATH, {"ROS_VERSION": "2"})


def problems(text: str) -> list[str]:
    with pytest.raises(WorkspaceError) as error:
        parse(text)
    return [problem.render().splitlines()[0] for problem in error.value.problems]


def test_the_last_matching_build_type_is_used_with_a_warning() -> None:
    manifest = parse(
        manifest_text("a").replace(
            "<export>",
            '<export><build_type condition="$ROS_VERSION == 1">catkin</build_type>'
            "<build_type>cmake</build_type>",
        )
    )
    assert manifest.build_type == "ament_cmake"
    assert "several build types" in manifest.warnings[0].message


def test_all_structural_errors_are_reported_together() -> None:
    text = """<package format="3">
  <name>1 robot</name>
  <version>1.2</version>
  <descripton>typo</descripton>
  <maintainer>nobody</maintainer>
  <license> </license>
  <author email="no address">x</author>
  <depend><b/></depend>
  <depend colour="red">x</depend>
  <run_depend>y</run_depend>
  <export/><export/>
</package>"""
    assert problems(text) == [
        f"{PATH}:4:3: error: unknown element 'descripton'",
        f"{PATH}:8:11: error: element 'depend' must contain only text",
        f"{PATH}:9:3: error: element 'depend' has an unknown attribute 'colour'",
        f"{PATH}:10:3: error: element 'run_depend' is not part of format 3",
        f"{PATH}:1:1: error: element 'description' is missing",
        f"{PATH}:11:12: error: element 'export' appears more than once",
        f"{PATH}:2:3: error: invalid package name '1 robot'",
        f"{PATH}:3:3: error: version '1.2' does not consist of three numbers separated by dots",
        f"{PATH}:5:3: error: element 'maintainer' needs an attribute 'email'",
        f"{PATH}:6:3: error: element 'license' is empty",
        f"{PATH}:7:3: error: invalid email address 'no address'",
    ]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["<depend>a</depend>"], "package 'a' depends on itself"),
        (["<depend>b</depend>", "<exec_depend>b</exec_depend>"], "<depend>b</depend> repeats <exec_depend>"),
        (["<depend>b</depend>", "<depend>b</depend>"], "<depend>b</depend> appears twice"),
        (['<depend condition="$X = 1">b</depend>'], "cannot parse the condition '$X = 1' at column 4"),
        (
            ["<group_depend>g</group_depend>", "<member_of_group>g</member_of_group>"],
            "the package depends on group 'g' and is a member of it",
        ),
    ],
)
def test_semantic_errors_are_reported(lines: list[str], message: str) -> None:
    assert message in problems(manifest_text("a", *lines))[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<package>", "not well-formed XML: no element found"),
        ("<pkg/>", "the root element is 'pkg', not 'package'"),
        ('<package format="9"/>', "unknown package format '9'"),
        ('<!DOCTYPE p [<!ENTITY a "b">]><package/>', "document type declarations are not allowed"),
        ("", "not well-formed XML"),
    ],
)
def test_files_that_are_not_manifests_are_rejected(text: str, message: str) -> None:
    assert message in problems(text)[0]


def test_empty_and_unknown_elements_are_warnings() -> None:
    manifest = parse(manifest_text("Robot", "<depend> </depend>"))
    assert [warning.message for warning in manifest.warnings] == [
        "package name 'Robot' does not follow the convention of lower-case names",
        "element 'depend' is empty",
    ]
