"""What an editor proposes for the word before the cursor."""

import pytest

from forge.base.distributions import EMBEDDED
from forge.plugins.lsp.completion import MOST, complete
from tests.plugins.lsp.conftest import Pointer


def proposed(workspace: Pointer, file: str, text: str) -> list[str]:
    """Return the proposals at the mark '|' of a text."""
    before, _, after = text.partition("|")
    path = workspace.path(file)
    workspace.index.open(path, before + after)
    line, column = before.count("\n"), len(before.rpartition("\n")[2])
    found = complete(workspace.index, path, line, column)
    assert (found.span.line, found.span.end) == (line, column)
    return [each.label for each in found.items]


def is_embedded(label: str) -> bool:
    """Tell whether a label names an interface that forge brings along, or the start of its name."""
    package, separator, _ = label.replace("::", "/").partition("/")
    return bool(separator) and (EMBEDDED / package).is_dir()


@pytest.mark.parametrize(
    ("file", "text", "labels"),
    [
        ("nav/msg/A.msg", "Pat|", ["Path"]),
        ("nav/msg/A.msg", "shapes/|", ["shapes/Box", "shapes/Point"]),
        ("nav/msg/A.msg", "shapes/P| x", ["shapes/Point"]),
        ("nav/msg/A.msg", "sha|", ["shapes/", "shapes/Box", "shapes/Point"]),
        ("nav/msg/A.msg", "uint1|\nint8 x\n", ["uint16"]),
        ("nav/msg/A.msg", "int8 x|", []),
        ("nav/msg/A.msg", "# Pat|", []),
        ("nav/msg/A.msg", "bool x |", ["true", "false"]),
        ("nav/msg/A.msg", "bool X = t|", ["true"]),
        ("nav/msg/A.msg", "uint8 ON=1\nuint8 OFF=0\nint8 X=4\nuint8 state O|", ["ON", "OFF"]),
        ("nav/msg/A.msg", "uint8 ON=1\nMissing[ state |", []),
        ("nav/srv/A.srv", "uint8 ON=1\nuint8 x\n---\nuint8 OFF=1\nuint8 y |", ["OFF"]),
        ("nav/msg/A.idl", "module nav { module msg { struct A { uint1|", ["uint16"]),
        ("nav/msg/A.idl", "  shapes::|", ["shapes::msg::Box", "shapes::msg::Point"]),
        ("nav/msg/A.idl", "  Pat|", ["nav::msg::Path"]),
        ("nav/msg/A.idl", '#include "shapes/msg/P|', ["shapes/msg/Point.idl"]),
        ("nav/msg/A.idl", "#include <shapes/|>", ["shapes/msg/Box.idl", "shapes/msg/Point.idl"]),
        ("nav/msg/A.idl", '  #include "Pat|"', ["nav/msg/Path.idl"]),
        ("nav/msg/A.idl", '#include "nav/msg/Path.idl"|', []),
        ("nav/package.xml", "<package>\n  <depend>shapes|</depend>", ["shapes"]),
        ("nav/package.xml", "<package>\n  <depend>std_m|</depend>", ["std_msgs"]),
        ("nav/package.xml", "<package>\n  <exec_|", ["exec_depend"]),
        ("nav/package.xml", "<export><build_type>ament_p|", ["ament_python"]),
        ("nav/package.xml", "<member_of_group>|", ["rosidl_interface_packages"]),
        ("nav/package.xml", "<version>1|", []),
        ("nav/package.xml", "words|", []),
    ],
)
def test_matching_words_are_proposed(workspace: Pointer, file: str, text: str, labels: list[str]) -> None:
    own = (label for label in proposed(workspace, file, text) if not is_embedded(label))
    assert list(own) == labels


def test_a_type_of_another_package_is_found_by_its_name(workspace: Pointer) -> None:
    found = proposed(workspace, "nav/msg/A.msg", "Poin|")
    assert "shapes/Point" in found
    assert "geometry_msgs/Point" in found


def test_build_types_of_other_distributions_are_proposed(workspace: Pointer, plugin: str) -> None:
    assert proposed(workspace, "nav/package.xml", "<export><build_type>we|") == [plugin]


def test_a_constant_is_inserted_as_its_value(workspace: Pointer) -> None:
    path = workspace.path("nav/msg/A.msg")
    workspace.index.open(path, "uint8 ON=7\nuint8 state ")
    (item,) = complete(workspace.index, path, 1, 12).items
    assert (item.label, item.text, item.detail) == ("ON", "7", "= 7")


def test_packages_that_the_manifest_declares_come_first(workspace: Pointer) -> None:
    found = proposed(workspace, "nav/msg/A.msg", "s|")
    packages = [label for label in found if label.endswith("/")]
    assert packages[:2] == ["shapes/", "std_msgs/"]


def test_the_number_of_proposals_is_limited(workspace: Pointer) -> None:
    path = workspace.path("nav/msg/A.msg")
    for number in range(MOST):
        workspace.index.open(workspace.path(f"nav/msg/Zone{number}.msg"), "int8 x\n")
    workspace.index.open(path, "Zone")
    found = complete(workspace.index, path, 0, 1)
    assert (len(found.items), found.complete) == (MOST, True)
    workspace.index.open(workspace.path("nav/msg/Zones.msg"), "int8 x\n")
    found = complete(workspace.index, path, 0, 1)
    assert (len(found.items), found.complete) == (MOST, False)


def test_nothing_is_proposed_after_a_complete_declaration(workspace: Pointer) -> None:
    path = workspace.path("nav/msg/A.msg")
    workspace.index.open(path, "int8 x\nint8 y ")
    assert complete(workspace.index, path, 1, 7).items == ()
    assert "Path" in [each.label for each in complete(workspace.index, path, 9, 0).items]
