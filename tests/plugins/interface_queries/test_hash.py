"""`forge interface hash`."""

import json
import re

import pytest

from tests.conftest import Forge, Tree
from tests.generated import reads_idl
from tests.packages import manifest_text

INDEX = "share/ament_index/resource_index"


def test_hash_prints_one_line_per_type(forge: Forge) -> None:
    ran = forge("interface", "hash", "std_msgs/msg/Empty", "std_srvs/srv/Empty")
    assert [line.split()[0] for line in ran.out.splitlines()] == ["std_msgs/msg/Empty", "std_srvs/srv/Empty"]
    assert all(re.fullmatch(r"\S+ RIHS01_[0-9a-f]{64}", line) for line in ran.out.splitlines())
    ran = forge("interface", "hash", "std_srvs/srv/Empty_Event", "--json")
    assert list(json.loads(ran.out)) == ["std_srvs/srv/Empty_Event"]
    ran = forge("interface", "hash", "std_srvs/srv/Empty_Goal")
    assert (ran.code, ran.err.splitlines()[0]) == (2, "error: unknown type 'std_srvs/srv/Empty_Goal'")


def test_hash_of_a_folder_covers_derived_types(forge: Forge, tree: Tree) -> None:
    folder = tree({"msg/A.msg": "std_msgs/Header h", "srv/B.srv": "A a\n---\n"})
    ran = forge("interface", "hash", "--package", "tour", str(folder))
    names = [line.split()[0].removeprefix("tour/") for line in ran.out.splitlines()]
    assert names == ["msg/A", "srv/B", "srv/B_Event", "srv/B_Request", "srv/B_Response"]


@reads_idl
def test_hash_prints_a_json_object_and_finds_names_with_underscores(forge: Forge, tree: Tree) -> None:
    struct = "module tour {{ module msg {{ struct {} {{ long a; }}; }}; }};"
    folder = tree({"msg/A_B.idl": struct.format("A_B"), "msg/A.idl": struct.format("A")})
    ran = forge("interface", "hash", "--package", "tour", str(folder), "--json")
    found = json.loads(ran.out)
    assert list(found) == ["tour/msg/A", "tour/msg/A_B"]
    ran = forge("interface", "hash", "tour/msg/A_B", "--include", f"tour={folder}")
    assert ran.out == f"tour/msg/A_B {found['tour/msg/A_B']}\n"
    assert all(re.fullmatch(r"RIHS01_[0-9a-f]{64}", text) for text in found.values())


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "missing names of types"),
        (["--package", "tour", "a", "b"], "--package accepts only one folder of definitions"),
        (["--file", "a:msg/A.msg", "std_msgs/msg/Empty"], "missing package name for --file"),
    ],
)
def test_hash_reports_missing_definitions(forge: Forge, arguments: list[str], text: str) -> None:
    ran = forge("interface", "hash", *arguments)
    assert (ran.code, ran.err.splitlines()[0]) == (2, f"error: {text}")


@reads_idl
def test_hash_finds_types_that_only_idl_files_define(forge: Forge, tree: Tree) -> None:
    files = {
        "msg/Short.idl": "module mine { module msg { struct Short { @default (value=7) short a; }; }; };",
        "idl/Wide.idl": "module mine { module idl { struct Wide { mine::msg::Short a; wchar b; }; }; };",
    }
    listed = {f"{INDEX}/packages/mine": "", f"{INDEX}/rosidl_interfaces/mine": "\n".join(files)}
    prefix = tree({**listed, **{f"share/mine/{path}": text for path, text in files.items()}})
    hashed = forge("interface", "hash", "mine/idl/Wide", env={"AMENT_PREFIX_PATH": str(prefix)})
    assert hashed.out.startswith("mine/idl/Wide RIHS01_")


def test_types_of_the_current_workspace_need_no_sourcing(forge: Forge, tree: Tree) -> None:
    installed = {
        f"{INDEX}/packages/mine": "",
        f"{INDEX}/rosidl_interfaces/mine": "msg/Top.msg",
        "share/mine/msg/Top.msg": "int8 x\n",
    }
    root = tree(
        {
            **{f"install/mine/{path}": text for path, text in installed.items()},
            "install/.colcon_install_layout": "isolated\n",
            "src/new/package.xml": manifest_text("new"),
            "src/new/msg/A.msg": "mine/Top i\n",
        }
    )
    for words in (("mine/msg/Top",), ("--package", "new", str(root / "src/new"))):
        ran = forge("interface", "hash", *words, cwd=root / "src")
        assert (ran.code, ran.err) == (0, ""), words
    ran = forge("interface", "hash", "new/msg/A", cwd=root / "src")
    assert ran.code == 2
    assert ran.err.startswith("error: package 'new' is in this workspace, but not built\nhint: run: forge ")


def test_an_idl_file_next_to_another_definition_is_reported(forge: Forge, tree: Tree) -> None:
    idl = "module p { module msg { struct A { short a; }; }; };\n"
    root = tree({"p/msg/A.msg": "int8 a\n", "p/msg/A.idl": idl})
    ran = forge("interface", "hash", "--package", "p", "p", cwd=root)
    assert (ran.code, "p/msg/A.idl: warning: this definition of 'p/msg/A' is ignored" in ran.err) == (0, True)
