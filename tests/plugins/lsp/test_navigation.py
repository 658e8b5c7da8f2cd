"""Definitions and references of types, fields and packages."""

import os

import pytest

from forge.base.distributions import EMBEDDED
from forge.plugins.lsp.navigation import definition, references
from forge.plugins.lsp.text import Place
from tests.plugins.lsp.conftest import Pointer

_IN_BOX = ("shapes/msg/Box.idl:0:21-26", "shapes/msg/Box.idl:7:6-24")


def shown(workspace: Pointer, place: Place | None) -> str:
    """Return a place as FILE:LINE:START-END, relative to src."""
    assert place
    file = place.path.relative_to(workspace.index.root / "src").as_posix()
    return f"{file}:{place.span.line}:{place.span.start}-{place.span.end}"


@pytest.mark.parametrize(
    ("file", "word", "place"),
    [
        ("nav/msg/Path.msg", "Point", "shapes/msg/Point.msg:0:0-0"),
        ("nav/srv/Plan.srv", "Path", "nav/msg/Path.msg:0:0-0"),
        ("nav/action/Drive.action", "shapes/Box", "shapes/msg/Box.idl:6:11-14"),
        ("nav/msg/Path.msg", "points", "nav/msg/Path.msg:0:15-21"),
        ("shapes/msg/Box.idl", "Point", "shapes/msg/Point.msg:0:0-0"),
        ("shapes/msg/Box.idl", "shapes::msg", "shapes/msg/Point.msg:0:0-0"),
        ("shapes/msg/Box.idl", "SIDES", "shapes/msg/Box.idl:4:18-23"),
        ("nav/package.xml", "shapes", "shapes/package.xml:2:8-14"),
    ],
)
def test_go_to_definition_finds_the_declaration(workspace: Pointer, file: str, word: str, place: str) -> None:
    assert shown(workspace, definition(*workspace.at(file, word))) == place


def test_definitions_outside_the_workspace_are_found(workspace: Pointer) -> None:
    header = workspace.path("nav/msg/Path.msg")
    workspace.index.open(header, "std_msgs/Header header\nmissing/Type x\n")
    found = definition(workspace.index, header, 0, 3)
    assert found is not None
    assert found.path == EMBEDDED / "std_msgs/msg/Header.msg"
    assert definition(workspace.index, header, 1, 3) is None
    package = definition(*workspace.at("nav/package.xml", "std_msgs"))
    assert package is not None
    assert package.path == EMBEDDED / "std_msgs/package.xml"


@pytest.mark.parametrize(
    ("file", "word", "places"),
    [
        (
            "nav/msg/Path.msg",
            "Point",
            ["nav/msg/Path.msg:0:0-12", "nav/srv/Plan.srv:0:0-12", *_IN_BOX],
        ),
        ("shapes/msg/Point.msg", "# A place", ["nav/msg/Path.msg:0:0-12", "nav/srv/Plan.srv:0:0-12"]),
        ("shapes/msg/Box.idl", "Box {", ["nav/action/Drive.action:0:0-10"]),
        ("shapes/package.xml", "shapes", ["nav/package.xml:7:10-16"]),
        ("shapes/msg/Point.msg", "x  #", []),
        ("nav/package.xml", "Apache", []),
    ],
)
def test_references_are_found_in_the_whole_workspace(
    workspace: Pointer, file: str, word: str, places: list[str]
) -> None:
    found = references(*workspace.at(file, word), declaration=False)
    assert [shown(workspace, each) for each in found][: len(places) or None] == places


@pytest.mark.parametrize(
    ("file", "word", "place"),
    [
        ("nav/msg/Path.msg", "Point", "shapes/msg/Point.msg:0:0-0"),
        ("nav/srv/Plan.srv", "ok", "nav/srv/Plan.srv:3:5-7"),
        ("nav/package.xml", "nav", "nav/package.xml:2:8-11"),
    ],
)
def test_references_include_the_declaration_on_request(
    workspace: Pointer, file: str, word: str, place: str
) -> None:
    found = references(*workspace.at(file, word), declaration=True)
    assert place in [shown(workspace, each) for each in found]


_TYPEDEFS = """module shapes {
  module msg {
    typedef double three[3];
    typedef three triple;
    struct Cube {
      three sides;
      sequence<triple, 2> more;
      @default (value=three) string name;
    };
  };
};
"""


@pytest.mark.parametrize(
    ("word", "place", "uses"),
    [
        ("three[3]", "2:19-24", ["3:12-17", "5:6-11"]),
        ("three triple", "2:19-24", ["3:12-17", "5:6-11"]),
        ("three sides", "2:19-24", ["3:12-17", "5:6-11"]),
        ("triple,", "3:18-24", ["6:15-21"]),
        ("module", None, []),
        ("double", None, []),
        ("typedef double", None, []),
    ],
)
def test_a_typedef_is_found_in_its_file(
    workspace: Pointer, word: str, place: str | None, uses: list[str]
) -> None:
    workspace.index.open(workspace.path("shapes/msg/Cube.idl"), _TYPEDEFS)
    workspace.index.open(workspace.path("nav/msg/Path.msg"), "shapes/Cube cube\n")
    at, file = workspace.at("shapes/msg/Cube.idl", word), "shapes/msg/Cube.idl:"
    found = definition(*at)
    assert (shown(workspace, found) if found else None) == (f"{file}{place}" if place else None)
    assert [shown(workspace, each) for each in references(*at, declaration=False)] == [
        f"{file}{use}" for use in uses
    ]
    whole = [f"{file}{use}" for use in ((place, *uses) if place else uses)]
    assert [shown(workspace, each) for each in references(*at, declaration=True)] == whole


def test_files_are_read_once(workspace: Pointer) -> None:
    for path in workspace.path("").glob("*/msg/*.msg"):
        path.unlink()
    found = definition(*workspace.at("nav/msg/Path.msg", "Point"))
    assert shown(workspace, found) == "shapes/msg/Point.msg:0:0-0"
    assert len(references(*workspace.at("nav/msg/Path.msg", "Point"), declaration=False)) == 4


def test_references_follow_unsaved_edits(workspace: Pointer) -> None:
    workspace.index.open(workspace.path("nav/srv/Plan.srv"), "---\n")
    workspace.index.open(workspace.path("nav/msg/Path.msg"), "shapes/Point[] points\nshapes/Point last\n")
    found = references(*workspace.at("nav/msg/Path.msg", "Point"), declaration=False)
    assert [shown(workspace, each) for each in found][:2] == [
        "nav/msg/Path.msg:0:0-12",
        "nav/msg/Path.msg:1:0-12",
    ]
    assert not any("Plan" in str(each.path) for each in found)


def test_files_that_were_changed_are_read_again(workspace: Pointer) -> None:
    path = workspace.path("shapes/msg/Point.msg")
    path.write_text("int8 changed\n", encoding="utf-8")
    os.utime(path, (1, 1))
    workspace.index.refresh_changed()
    assert workspace.index.text(path) == "int8 changed\n"
    path.unlink()
    workspace.index.refresh_changed()
    assert workspace.index.readings.get(path) is None
    assert definition(*workspace.at("nav/msg/Path.msg", "Point")) is None


def test_definitions_are_updated_when_their_package_is_renamed(workspace: Pointer) -> None:
    manifest = workspace.path("shapes/package.xml")
    workspace.index.open(manifest, workspace.index.text(manifest).replace("shapes", "forms"))
    path = workspace.path("nav/msg/Path.msg")
    workspace.index.open(path, "forms/Point[] points\nshapes/Point other\n")
    assert shown(workspace, definition(workspace.index, path, 0, 7)) == "shapes/msg/Point.msg:0:0-0"
    assert definition(workspace.index, path, 1, 8) is None
