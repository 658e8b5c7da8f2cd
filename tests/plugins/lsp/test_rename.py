"""Renaming types, fields and constants."""

import pytest

from forge.base.errors import InterfaceError
from forge.plugins.lsp.diagnostics import diagnose
from forge.plugins.lsp.rename import Renaming, renamable, rename
from tests.plugins.lsp.conftest import Pointer


def apply(workspace: Pointer, renaming: Renaming) -> None:
    """Do what an editor does: the edits from the end of each file, then the moves."""
    for edit in sorted(renaming.edits, key=lambda edit: (edit.span.line, edit.span.start), reverse=True):
        lines = edit.path.read_text(encoding="utf-8").splitlines()
        line = lines[edit.span.line]
        lines[edit.span.line] = line[: edit.span.start] + edit.text + line[edit.span.end :]
        edit.path.write_text("\n".join((*lines, "")), encoding="utf-8")
    for old, new in renaming.moves:
        old.rename(new)
    for path in {edit.path for edit in renaming.edits} | {path for move in renaming.moves for path in move}:
        workspace.index.refresh(path)


def words(workspace: Pointer, file: str) -> str:
    return workspace.path(file).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "word"),
    [("nav/msg/Path.msg", "Point"), ("shapes/msg/Box.idl", "Point"), ("shapes/msg/Point.msg", "# A place")],
)
def test_a_type_is_renamed_with_its_file_and_its_uses(workspace: Pointer, file: str, word: str) -> None:
    apply(workspace, rename(*workspace.at(file, word), "Spot"))
    assert words(workspace, "nav/msg/Path.msg") == "shapes/Spot[] points\nstring name\n"
    assert words(workspace, "nav/srv/Plan.srv").startswith("shapes/Spot goal\n")
    assert '#include "shapes/msg/Spot.idl"' in words(workspace, "shapes/msg/Box.idl")
    assert "shapes::msg::Spot corner;" in words(workspace, "shapes/msg/Box.idl")
    assert '"msg/Spot.msg"' in words(workspace, "shapes/CMakeLists.txt")
    assert words(workspace, "shapes/msg/Spot.msg").startswith("# A place.")
    assert not workspace.path("shapes/msg/Point.msg").exists()
    for path in workspace.path("").rglob("*.*"):
        assert diagnose(workspace.index, path) == ()


@pytest.mark.parametrize(
    ("cmake", "remark"),
    [
        ("rosidl_generate_interfaces(shapes\n  msg/Point.msg)  # Point\n", ""),
        ("rosidl_generate_interfaces(shapes\n  ${CMAKE_CURRENT_SOURCE_DIR}/msg/Point.msg)\n", ""),
        (
            "rosidl_generate_interfaces(shapes\n  ${HERE}/msg/Point.msg)\n",
            "not changed: shapes/CMakeLists.txt:2 may also mean 'Point.msg'",
        ),
        (
            "rosidl_generate_interfaces(shapes dir:msg/../msg/Point.msg)\n",
            "not changed: shapes/CMakeLists.txt:1 may also mean 'Point.msg'",
        ),
        (
            "foreach(name Box Point)\n  list(APPEND files msg/${name}.msg)\nendforeach()\n",
            "not changed: shapes/CMakeLists.txt:1 may also mean 'Point.msg'",
        ),
        (
            "include(cmake/files.cmake)\nrosidl_generate_interfaces(shapes ${files})\n",
            "not changed: shapes/cmake/files.cmake:1 may also mean 'Point.msg'",
        ),
        (
            "rosidl_generate_interfaces(shapes ${FROM_ELSEWHERE})\n",
            "not changed: 'shapes/CMakeLists.txt' does not name 'Point.msg' literally",
        ),
        ("file(GLOB files msg/*.msg)\nrosidl_generate_interfaces(shapes ${files})\n", ""),
    ],
)
def test_a_rename_warns_of_unchanged_cmake_lines(workspace: Pointer, cmake: str, remark: str) -> None:
    files = {"CMakeLists.txt": cmake}
    if "include(" in cmake:
        files["cmake/files.cmake"] = "set(files ${CMAKE_CURRENT_LIST_DIR}/../msg/Point.msg)\n"
    for name, text in files.items():
        path = workspace.path(f"shapes/{name}")
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        workspace.index.refresh(path)
    assert rename(*workspace.at("nav/msg/Path.msg", "Point"), "Spot").remark == remark


def test_renaming_an_idl_file_renames_its_structs(workspace: Pointer) -> None:
    apply(workspace, rename(*workspace.at("nav/action/Drive.action", "shapes/Box"), "Crate"))
    text = words(workspace, "shapes/msg/Crate.idl")
    assert "module Crate_Constants {" in text
    assert "struct Crate {" in text
    assert "  msg/Crate.idl)" in words(workspace, "shapes/CMakeLists.txt")
    assert diagnose(workspace.index, workspace.path("shapes/msg/Crate.idl")) == ()
    assert words(workspace, "nav/action/Drive.action").startswith("shapes/Crate[2] boxes\n")


@pytest.mark.parametrize(
    ("file", "word", "new", "line"),
    [
        ("shapes/msg/Point.msg", "x  #", "right", "float64 right  # to the right [m]"),
        ("shapes/msg/Point.msg", "FLAT", "LEVEL", "uint8 LEVEL=2  # no height"),
        ("shapes/msg/Box.idl", "corner", "edge", "      shapes::msg::Point edge;"),
        ("nav/srv/Plan.srv", "ok", "goal", "bool goal"),
    ],
)
def test_a_member_is_renamed(workspace: Pointer, file: str, word: str, new: str, line: str) -> None:
    apply(workspace, rename(*workspace.at(file, word), new))
    assert line in words(workspace, file).splitlines()


@pytest.mark.parametrize(
    ("file", "word", "new", "message"),
    [
        ("shapes/msg/Point.msg", "x  #", "y", "'y' is already declared in 'shapes/msg/Point'"),
        ("shapes/msg/Point.msg", "x  #", "X", "invalid field name 'X'"),
        ("shapes/msg/Point.msg", "x  #", "class", "field name 'class' is a keyword of Python and C++"),
        ("shapes/msg/Point.msg", "FLAT", "flat", "invalid constant name 'flat'"),
        ("nav/msg/Path.msg", "Point", "point", "invalid interface name 'point'"),
        ("nav/msg/Path.msg", "Point", "Box", "'shapes/msg/Box' already exists"),
        ("nav/msg/Path.msg", "Point", "BOX", "'BOX' and 'Box' would both be generated into 'box'"),
        ("nav/package.xml", "shapes", "forms", "there is no name of a type, field or constant here"),
    ],
)
def test_an_invalid_new_name_is_rejected(
    workspace: Pointer, file: str, word: str, new: str, message: str
) -> None:
    with pytest.raises(InterfaceError) as error:
        rename(*workspace.at(file, word), new)
    assert error.value.problems[0].message == message


def test_a_type_outside_the_workspace_is_not_renamed(workspace: Pointer) -> None:
    workspace.index.open(workspace.path("nav/msg/Path.msg"), "std_msgs/Header header\n")
    with pytest.raises(InterfaceError, match=r"'std_msgs/msg/Header' is not part of the workspace"):
        rename(*workspace.at("nav/msg/Path.msg", "Header"), "Head")
    with pytest.raises(InterfaceError, match=r"'std_msgs/msg/Header' is not part of the workspace"):
        renamable(*workspace.at("nav/msg/Path.msg", "Header"))


def test_prepare_rename_returns_the_name_under_the_cursor(workspace: Pointer) -> None:
    found = renamable(*workspace.at("nav/msg/Path.msg", "Point"))
    assert found
    assert (found.name, found.span.start, found.span.end) == ("Point", 7, 12)
    whole = renamable(*workspace.at("nav/srv/Plan.srv", "---"))
    assert whole
    assert (whole.name, whole.span.start, whole.span.end) == ("Plan", 0, 3)
    assert renamable(*workspace.at("nav/msg/Path.msg", "] points")) is None
    assert renamable(*workspace.at("shapes/msg/Box.idl", "module msg")) is None
    typedef = "module shapes { module msg { typedef long number; struct Box { number x; }; }; };"
    workspace.index.open(workspace.path("shapes/msg/Box.idl"), typedef)
    assert renamable(*workspace.at("shapes/msg/Box.idl", "number")) is None
    assert renamable(*workspace.at("shapes/msg/Box.idl", "number x")) is None
    assert renamable(*workspace.at("nav/package.xml", "shapes")) is None
