"""The search order of definitions."""

from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.errors import InterfaceError, Location
from forge.interfaces.model import TypeName
from forge.interfaces.read.sources import Library, contradictions, read_folder, read_runtime, read_source
from tests.conftest import Tree
from tests.generated import reads_idl

INDEX = "share/ament_index/resource_index/rosidl_interfaces"


def fields(library: Library, name: str) -> list[str]:
    parsed = library.find(TypeName(*name.split("/")))
    assert parsed
    return [field.name for field in getattr(parsed.interface, "fields", ())]


def test_folders_are_read_in_order_of_kind_and_name(tree: Tree) -> None:
    folder = tree(
        {"srv/A.srv": "---", "msg/B.msg": "", "msg/A.msg": "", "action/A.action": "", "msg/README.md": ""}
    )
    assert [source.relative for source in read_folder("p", folder)] == [
        "msg/A.msg",
        "msg/B.msg",
        "srv/A.srv",
        "action/A.action",
    ]


def test_a_folder_without_definitions_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InterfaceError, match="no interface definitions found in"):
        read_folder("p", tmp_path)
    with pytest.raises(InterfaceError, match="no interface definitions found in"):
        read_folder("p", tmp_path / "missing")


def test_unreadable_definitions_are_reported_with_their_path(tree: Tree) -> None:
    folder = tree({"msg/A.txt": "", "msg/Dir.msg/x": ""})
    with pytest.raises(InterfaceError, match=r"A\.txt: error: not an interface definition"):
        read_source("p", folder, "msg/A.txt")
    with pytest.raises(InterfaceError, match=r"B\.msg: error: cannot read the definition: no such file"):
        read_source("p", folder, "msg/B.msg")
    (folder / "msg/Latin.msg").write_bytes("int8 a\n# caf\xe9\n".encode("latin-1"))
    with pytest.raises(InterfaceError, match=r"Latin\.msg:2: error: the file is not valid UTF-8"):
        read_source("p", folder, "msg/Latin.msg")


def test_definitions_are_searched_in_includes_then_prefixes_then_embedded(tree: Tree) -> None:
    root = tree(
        {
            "included/msg/String.msg": "int8 included",
            "one/share/std_msgs/msg/String.msg": "int8 one",
            "two/share/std_msgs/msg/String.msg": "int8 two",
        }
    )
    prefixes = (root / "one", root / "two")
    assert fields(Library(), "std_msgs/msg/String") == ["data"]
    assert fields(Library(prefixes=prefixes), "std_msgs/msg/String") == ["one"]
    assert fields(Library({"std_msgs": root / "included"}, prefixes), "std_msgs/msg/String") == ["included"]


def test_a_package_is_never_combined_from_several_folders(tree: Tree) -> None:
    prefix = tree({"share/std_msgs/msg/String.msg": "int8 mine"})
    assert Library(prefixes=(prefix,)).find(TypeName("std_msgs", "msg", "Header")) is None


def test_only_packages_with_interfaces_are_listed(tree: Tree) -> None:
    prefix = tree(
        {f"{INDEX}/mine": "", f"{INDEX}/.hidden": "", f"{INDEX}/gone": "", "share/mine/srv/A.srv": "---"}
    )
    found = Library(prefixes=(prefix,)).packages()
    assert found["mine"] == prefix / "share/mine"
    assert found["std_msgs"] == EMBEDDED / "std_msgs"
    assert not {"ament_cmake", ".hidden", "gone"} & found.keys()


def test_requests_and_responses_are_hidden_and_idl_files_listed(tree: Tree) -> None:
    folder = tree(
        {"srv/A.srv": "---", "srv/A_Request.msg": "", "srv/A.idl": "", "msg/B.idl": "", "msg/C_D.msg": ""}
    )
    library = Library({"p": folder}, embedded=None)
    assert list(map(str, library.names_in("p"))) == ["p/msg/B", "p/srv/A"]
    assert {str(name) for name in library.names()} == {"p/msg/B", "p/srv/A"}


def test_definitions_in_nested_folders_are_found(tree: Tree) -> None:
    folder = tree({"msg/deep/more/A.msg": "int8 deep", "msg/B.msg": "A a", "msg/B.idl": "", "test/C.msg": ""})
    library = Library({"p": folder}, embedded=None)
    assert list(map(str, library.names_in("p"))) == ["p/msg/A", "p/msg/B"]
    assert fields(library, "p/msg/A") == ["deep"]
    assert [source.relative for source in read_folder("p", folder)] == ["msg/B.msg", "msg/deep/more/A.msg"]


@reads_idl
def test_installed_interfaces_are_those_in_the_index(tree: Tree) -> None:
    """Files that another version has left are none of it; generated .idl files are not the source."""
    listed = ("deep/A.msg", "msg/A.idl", "srv/S.srv", "srv/S_Request.msg", "msg/Own.idl", "msg/gone.msg")
    own = "module p { module msg { struct Own { long x; }; }; };"
    prefix = tree(
        {
            f"{INDEX}/p": "\n".join(listed),
            **{f"share/p/{path}": "int8 old" for path in ("msg/Left.msg", "msg/A.idl", "srv/S_Request.msg")},
            "share/p/deep/A.msg": "int8 fresh",
            "share/p/srv/S.srv": "---",
            "share/p/msg/Own.idl": own,
        }
    )
    library = Library(prefixes=(prefix,), embedded=None)
    assert list(map(str, library.names_in("p"))) == ["p/msg/A", "p/msg/Own", "p/srv/S"]
    assert fields(library, "p/msg/A") == ["fresh"]
    assert fields(library, "p/msg/Own") == ["x"]


@reads_idl
def test_an_ignored_idl_file_is_reported_with_the_overriding_file(tree: Tree) -> None:
    """Unless it says the same, or was generated."""
    idl = "module p { module msg { struct A { short a; }; }; };\n"
    for other in ({"msg/A.idl": idl}, {"msg/A.idl": "no IDL"}):
        folder = tree({"msg/A.msg": "int8 a", **other})
        (problem,) = contradictions(read_folder("p", folder))
        assert problem.location == Location(folder / "msg/A.idl")
        assert f"'p/msg/A' is ignored, because '{folder}/msg/A.msg' is another one" in problem.message
    for other in (
        {"msg/A.idl": f"// generated from A.msg\n{idl}"},
        {"msg/A.idl": idl, "msg/A.msg": "int16 a"},
    ):
        assert not [*contradictions(read_folder("p", tree(other)))]


def test_runtime_files_depend_on_the_language() -> None:
    assert "rosidl_runtime_cpp/bounded_vector.hpp" in {file.path for file in read_runtime("cpp")}
    assert "forge_rosidl/messages.py" in {file.path for file in read_runtime("python")}
    assert list(read_runtime("idl")) == []
