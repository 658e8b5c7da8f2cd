"""`forge interface diff` says what a change keeps, and serialized messages prove it."""

import json
import shutil
import subprocess
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forge.interfaces import load
from tests.conftest import Forge, Ran, Tree
from tests.generated import reads_idl
from tests.messages import messages
from tests.packages import manifest_text

BEFORE = {
    "msg/In.msg": "float64 a\nstring<=3 t\nint8 low\n",
    "msg/M.msg": "int32 x\nuint8 flag\nstring name\nfloat32[3] v\nIn in1\n"
    "int8[<=2] few\nuint8 K=1\nint16 d 4\n",
}

CASES: Mapping[str, tuple[str, str, str, str]] = {
    "nothing": ("", "", "", ""),
    "a comment": ("int32 x", "# what x is\nint32 x  # here", "", ""),
    "a unit": ("int32 x", "int32 x  # width [m]", "", "unit of 'x': none -> m"),
    "a field is new": ("uint8 flag", "uint8 flag\nbool more", "wire hash", "field 'more' is new"),
    "a field was removed": ("uint8 flag\n", "", "wire hash api", "field 'flag' was removed"),
    "a field is renamed": ("string name", "string label", "hash api", "'name' is now called 'label'"),
    "a field has moved": ("int32 x\nuint8 flag", "uint8 flag\nint32 x", "wire hash", "has moved"),
    "two types exchanged": ("int32 x\nuint8 flag", "uint8 x\nint32 flag", "wire hash api", "int32 -> uint8"),
    "a wider type": ("int32 x", "int64 x", "wire hash api", "field 'x': int32 -> int64"),
    "a type of the same size": ("int32 x", "uint32 x", "wire hash api", "field 'x': int32 -> uint32"),
    "a byte": ("uint8 flag", "byte flag", "hash api", "field 'flag': uint8 -> byte"),
    "a longer array": ("float32[3] v", "float32[4] v", "wire hash api", "float32[3] -> float32[4]"),
    "an array becomes a sequence": (
        "float32[3] v",
        "float32[] v",
        "wire hash api",
        "float32[3] -> float32[]",
    ),
    "a text gets a bound": ("string name", "string<=5 name", "wire hash", "string -> string<=5"),
    "a sequence loses its bound": ("int8[<=2] few", "int8[] few", "wire hash api", "int8[<=2] -> int8[]"),
    "a message is written out": (
        "In in1",
        "float64 a\nstring<=3 t\nint8 low",
        "hash api",
        "field 'in1' was removed",
    ),
    "an array is written out": (
        "float32[3] v",
        "float32 v0\nfloat32 v1\nfloat32 v2",
        "hash api",
        "field 'v0' is new",
    ),
    "a default value": ("int16 d 4", "int16 d 5", "", "default value of 'd': 4 -> 5"),
    "a constant is new": ("uint8 K=1", "uint8 K=1\nuint8 L=2", "", "constant 'L' is new"),
    "a constant has another value": ("uint8 K=1", "uint8 K=2", "api", "constant 'K': uint8 1 -> uint8 2"),
    "a constant was removed": ("uint8 K=1\n", "", "api", "constant 'K' was removed"),
}


def diff(forge: Forge, root: Path, *words: str) -> dict[str, dict[str, list[str]]]:
    """Return the differences of two folders, or of other versions, by the name of the interface."""
    ran = forge("interface", "diff", *(words or ("old", "new")), "--package", "p", "--json", cwd=root)
    found: dict[str, dict[str, list[str]]] = json.loads(ran.out)
    assert ran.code == int(any(each["breaks"] for each in found.values())), ran.err
    return found


def written(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("case", CASES)
def test_each_change_reports_the_right_breakage(case: str, forge: Forge, tmp_path: Path) -> None:
    one, other, breaks, said = CASES[case]
    assert one in BEFORE["msg/M.msg"]
    after = {**BEFORE, "msg/M.msg": BEFORE["msg/M.msg"].replace(one, other, 1)}
    written(tmp_path / "old", BEFORE)
    written(tmp_path / "new", after)
    found = diff(forge, tmp_path)
    assert found.keys() == ({"p/msg/M"} if said else set())
    assert not said or found["p/msg/M"]["breaks"] == breaks.split()
    assert not said or any(said in change for change in found["p/msg/M"]["changes"])


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
@pytest.mark.parametrize("case", [name for name, case in CASES.items() if "wire" not in case[2]])
def test_wire_compatible_changes_keep_the_same_bytes(case: str, data: st.DataObject, tmp_path: Path) -> None:
    """What one version has written is read by the other, and written to the same bytes again."""
    one, other, _, _ = CASES[case]
    old = load(written(tmp_path / "old", BEFORE), "p")["p/msg/M"]
    after = {**BEFORE, "msg/M.msg": BEFORE["msg/M.msg"].replace(one, other, 1)}
    new = load(written(tmp_path / "new", after), "p")["p/msg/M"]
    forge_cdr = import_module("forge_cdr")  # found because types were loaded

    for writer, reader in ((old, new), (new, old)):
        content = forge_cdr.serialize(data.draw(messages(writer)))
        assert forge_cdr.serialize(forge_cdr.deserialize(content, reader)) == content


def test_messages_that_contain_a_changed_message_are_reported(forge: Forge, tmp_path: Path) -> None:
    written(tmp_path / "old", BEFORE)
    written(tmp_path / "new", {**BEFORE, "msg/In.msg": "float64 b\nstring<=3 t\nint8 low\n"})
    found = diff(forge, tmp_path)
    assert found["p/msg/In"]["breaks"] == ["hash", "api"]
    assert found["p/msg/M"]["breaks"] == ["hash"]
    assert found["p/msg/M"]["changes"] == ["contains p/msg/In, which has changed"]


def test_changed_parts_of_services_and_actions_are_named(forge: Forge, tmp_path: Path) -> None:
    service, action = "int32 a\n---\nint32 b\n", "int32 a\n---\nint32 b\n---\nint32 c\n"
    written(tmp_path / "old", {"srv/S.srv": service, "action/A.action": action, "srv/Gone.srv": service})
    edited = {"srv/S.srv": service.replace("b", "d"), "action/A.action": f"{action}bool done\n"}
    written(tmp_path / "new", {**edited, "srv/New.srv": service})
    found = diff(forge, tmp_path)
    assert found["p/srv/S"]["changes"] == ["field 'b' of the response is now called 'd'"]
    assert found["p/action/A"]["changes"] == ["field 'done' of the feedback is new"]
    assert found["p/srv/Gone"]["breaks"] == ["wire", "hash", "api"]
    assert found["p/srv/New"]["breaks"] == []


def test_fields_moved_between_request_and_response_break_the_wire(forge: Forge, tmp_path: Path) -> None:
    """Also if the sides look alike; a name that both sides have has not changed them."""
    written(tmp_path / "old", {"srv/S.srv": "int8 id\nint8 a\n---\nint8 id\nint8 b\n"})
    written(tmp_path / "new", {"srv/S.srv": "int8 id\nint8 b\n---\nint8 id\nint8 a\n"})
    found = diff(forge, tmp_path)["p/srv/S"]
    assert found["breaks"] == ["wire", "hash", "api"]
    assert found["changes"] == [
        "field 'a' of the request has moved to the response",
        "field 'b' of the response has moved to the request",
    ]
    written(tmp_path / "new", {"srv/S.srv": "int8 id\nint8 c\n---\nint8 c\nint8 b\n"})
    assert diff(forge, tmp_path)["p/srv/S"]["breaks"] == ["hash", "api"]


@reads_idl
def test_an_idl_file_equals_the_message_that_it_describes(forge: Forge, tmp_path: Path) -> None:
    idl = "module p { module msg { struct M { long x; sequence<octet> data; }; }; };\n"
    written(tmp_path / "old", {"msg/M.msg": "int32 x\nbyte[] data\n"})
    written(tmp_path / "new", {"msg/M.idl": idl})
    assert diff(forge, tmp_path) == {}


# --- where versions are


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("float64 x\nfloat64 y", "float64 y\nfloat64 x"),
        ("int8 x\nint8 y\nint8 z", "int8 y\nint8 z\nint8 w"),
        ("uint8 e", ""),
        ("int8[2] x\nint8 y", "int8 x\nint8[2] y"),
        ("int8[2] x\nint8 y", "int8[3] x"),
        ("Pair p", "Riap p"),
        ("Pair p", "Riap[1] p"),
    ],
)
def test_values_read_into_another_field_break_the_wire(
    old: str, new: str, forge: Forge, tmp_path: Path
) -> None:
    pairs = {"msg/Pair.msg": "int8 x\nint8 y\n", "msg/Riap.msg": "int8 y\nint8 x\n"}
    user = {"msg/User.msg": "M[] all\n", **pairs}
    written(tmp_path / "old", {"msg/M.msg": f"{old}\n", **user})
    written(tmp_path / "new", {"msg/M.msg": f"{new}\n", **user})
    found = diff(forge, tmp_path)
    assert "wire" in found["p/msg/M"]["breaks"]
    assert "wire" in found["p/msg/User"]["breaks"]


@pytest.mark.parametrize(
    ("old", "new"), [("Pair[] p", "PairSequence p"), ("Pair[2] p", "PairArray p"), ("Pair p", "Pair[1] p")]
)
def test_a_field_and_a_message_that_contains_it_have_the_same_bytes(
    old: str, new: str, forge: Forge, tmp_path: Path
) -> None:
    pairs = {
        "msg/Pair.msg": "int8 x\nint8 y\n",
        "msg/PairArray.msg": "Pair a\nPair p\n",
        "msg/PairSequence.msg": "Pair[] p\n",
    }
    written(tmp_path / "old", {"msg/M.msg": f"{old}\n", **pairs})
    written(tmp_path / "new", {"msg/M.msg": f"{new}\n", **pairs})
    assert diff(forge, tmp_path)["p/msg/M"]["breaks"] == ["hash", "api"]
    assert diff(forge, tmp_path, "new", "old")["p/msg/M"]["breaks"] == ["hash", "api"]


@pytest.mark.parametrize(
    "text",
    [
        "uint8 S_A=0\nuint8 s",
        "uint8 S_A=0\nuint8 T_A=0\nuint8 s  # enum: T_*",
        "uint8 S_A=0\nuint8 S=3\nuint8 s  # enum: S_*",
        "uint8 S_A=0\nint16 S_BIG=300\nuint8 s  # enum: S_*",
    ],
)
def test_enumerations_are_part_of_the_api(text: str, forge: Forge, tmp_path: Path) -> None:
    written(tmp_path / "old", {"msg/M.msg": "uint8 S_A=0\nuint8 s  # enum: S_*\n"})
    written(tmp_path / "new", {"msg/M.msg": f"{text}\n"})
    found = diff(forge, tmp_path)["p/msg/M"]
    assert found["breaks"] == ["api"]
    assert "enumeration 'S' was removed" in found["changes"]


def test_equal_defaults_are_not_a_difference(forge: Forge, tmp_path: Path) -> None:
    for name in ("old", "new"):
        written(tmp_path / name, {"msg/M.msg": "float32 x nan\nfloat32[] y [nan, 1]\nfloat32 Z=nan\n"})
    assert diff(forge, tmp_path) == {}
    written(tmp_path / "new", {"msg/M.msg": "float32 x -0.0\nfloat32[] y [nan, 1]\nfloat32 Z=nan\n"})
    assert diff(forge, tmp_path)["p/msg/M"]["breaks"] == []


def test_a_version_may_have_no_interfaces(forge: Forge, tmp_path: Path) -> None:
    written(tmp_path / "old", {"msg/M.msg": "int8 x\n"})
    (tmp_path / "empty").mkdir()
    assert forge("interface", "diff", "empty", "old", "--package", "p", cwd=tmp_path).code == 0
    ran = forge("interface", "diff", "old", "empty", "--package", "p", cwd=tmp_path)
    assert (ran.code, "p/msg/M: removed" in ran.out) == (1, True)


def test_packages_are_identified_by_the_name_in_their_manifest(forge: Forge, tree: Tree) -> None:
    manifest = manifest_text("p").replace('email="', 'email="no address ')
    root = tree(
        {
            **{f"old/x/{path}": text for path, text in {"package.xml": manifest, **BEFORE}.items()},
            **{f"new/y/{path}": text for path, text in {"package.xml": manifest, **BEFORE}.items()},
            "new/z/package.xml": manifest_text("z"),
            "new/z/COLCON_IGNORE": "",
            "new/z/msg/Z.msg": "int8 z\n",
        }
    )
    ran = forge("interface", "diff", "old", "new", cwd=root)
    assert (ran.code, ran.out) == (0, "no difference in 2 interfaces\n")
    written(root / "new/again", {"package.xml": manifest, "msg/M.msg": "int8 other\n"})
    ran = forge("interface", "diff", "old", "new", cwd=root)
    assert (ran.code, "is called 'p', too" in ran.err) == (2, True)


@reads_idl
@pytest.mark.needs("git")
def test_definitions_that_cmake_names_are_compared_in_any_folder(forge: Forge, tree: Tree) -> None:
    cmake = """set(files system/msg/State.msg)
rosidl_generate_interfaces(p ${files} "${CMAKE_CURRENT_SOURCE_DIR}/system/srv/Stop.srv" msg/M.msg dds/D.idl)
if(BUILD_TESTING)
  rosidl_generate_interfaces(p_tests test/msg/Tested.msg)
endif()
"""
    before = {
        "msg/M.msg": "int8 x\n",
        "system/msg/State.msg": "M m\n",
        "system/msg/Unused.msg": "int8 x\n",
        "system/srv/Stop.srv": "---\nint8 code\n",
        "dds/D.idl": "module p { module dds { struct D { int8 x; }; }; };\n",
        "test/msg/Tested.msg": "int8 x\n",
    }
    root = tree({"package.xml": manifest_text("p"), "CMakeLists.txt": cmake, **before})
    git = ("git", "-c", "user.name=n", "-c", "user.email=e@example.com")
    for words in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        subprocess.run((*git, *words), cwd=root, check=True)
    shutil.copytree(root, root / "old")
    (root / "old/COLCON_IGNORE").touch()
    written(root, {path: text.replace("int8", "int16") for path, text in before.items()})
    for old in ("old", "HEAD"):
        assert diff(forge, root, old, ".").keys() == {"p/dds/D", "p/msg/M", "p/msg/State", "p/srv/Stop"}, old


def test_an_idl_file_next_to_another_definition_is_reported(forge: Forge, tree: Tree) -> None:
    idl = "module p { module msg { struct M { short a; }; }; };\n"
    root = tree({"p/package.xml": manifest_text("p"), "p/msg/M.msg": "int8 a\n", "p/msg/M.idl": idl})
    ran = forge("interface", "diff", "p", "p", cwd=root)
    assert (ran.code, "p/msg/M.idl: warning: this definition of 'p/msg/M' is ignored" in ran.err) == (0, True)


def test_packages_outside_a_workspace_are_not_searched(forge: Forge, tree: Tree) -> None:
    other = {"q/package.xml": manifest_text("q"), "q/msg/Q.msg": "int8 q\n"}
    root = tree({"old/msg/M.msg": "q/Q x\n", "new/msg/M.msg": "q/Q x\n", **other})
    ran = forge("interface", "diff", "old", "new", cwd=root)
    assert (ran.code, "unknown type 'q/Q'" in ran.err) == (2, True)
    (root / "forge.toml").touch()
    assert diff(forge, root) == {}


@pytest.mark.needs("git")
def test_files_missing_from_a_revision_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree({"msg/M.msg": "int8 x\n", "more/N.msg": "int8 y\n"})
    (root / "msg/N.msg").symlink_to("../more/N.msg")
    git = ("git", "-c", "user.name=n", "-c", "user.email=e@example.com")
    for words in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        subprocess.run((*git, *words), cwd=root, check=True)
    ran = forge("interface", "diff", "HEAD", "--package", "p", cwd=root)
    assert (ran.code, "'msg/N.msg' of 'HEAD' is a symbolic link" in ran.err) == (2, True)
    (root / "msg/N.msg").unlink()
    head = subprocess.run((*git, "rev-parse", "HEAD"), cwd=root, check=True, capture_output=True, text=True)
    entry = ("update-index", "--add", "--cacheinfo", f"160000,{head.stdout.strip()},other")
    for words in (("rm", "-q", "--cached", "msg/N.msg"), entry, ("commit", "-q", "-m", "second")):
        subprocess.run((*git, *words), cwd=root, check=True)
    ran = forge("interface", "diff", "HEAD", "--package", "p", cwd=root)
    assert (ran.code, "warning: the submodule 'other' of 'HEAD' is left out" in ran.err) == (0, True)


@pytest.mark.needs("git")
def test_revisions_are_compared_with_the_working_tree(forge: Forge, tree: Tree) -> None:
    """Also of a folder below the root of the repository, whose other packages are known as well."""
    manifest = manifest_text("p", build_type="ament_cmake")
    other = {"src/q/package.xml": manifest_text("q"), "src/q/msg/Q.msg": "int8 q\n"}
    root = tree({"src/p/package.xml": manifest, "src/p/msg/M.msg": "q/Q x\n", **other})
    git = ("git", "-c", "user.name=n", "-c", "user.email=e@example.com")
    for words in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        subprocess.run((*git, *words), cwd=root, check=True)
    assert diff(forge, root, "HEAD") == {}
    (root / "src/q/msg/Q.msg").write_text("int16 q\n")
    assert diff(forge, root, "HEAD")["p/msg/M"]["breaks"] == ["wire", "hash"]
    assert diff(forge, root, "HEAD:src", "src").keys() == {"p/msg/M"}
    assert diff(forge, root, "HEAD:src/p", "src/p") == {}, "q is found in the workspace"
    (root / "src/p/msg/M.msg").write_text("q/Q x\nint8\n")
    subprocess.run((*git, "commit", "-q", "-a", "-m", "second"), cwd=root, check=True)
    ran = forge("interface", "diff", "HEAD~1", "HEAD", cwd=root)
    assert ran.code == 2
    assert ran.err.startswith("HEAD:src/p/msg/M.msg:2:")


@reads_idl
@pytest.mark.needs("cmake", "g++")
def test_an_install_folder_is_a_version(forge: Forge, tree: Tree) -> None:
    """It equals its sources: generated .idl files and parts of services are nothing new."""
    build = "rosidl_generate_interfaces(p msg/M.msg srv/S.srv msg/deep/D.msg)"
    needs = (
        "<buildtool_depend>ament_cmake</buildtool_depend>",
        "<build_depend>rosidl_default_generators</build_depend>",
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    )
    cmake = (
        "cmake_minimum_required(VERSION 3.16)\nproject(p)\nfind_package(ament_cmake REQUIRED)\n"
        f"find_package(rosidl_default_generators REQUIRED)\n{build}\nament_package()\n"
    )
    root = tree(
        {
            "src/p/package.xml": manifest_text("p", *needs, build_type="ament_cmake"),
            "src/p/CMakeLists.txt": cmake,
            "src/p/msg/M.msg": "D d\n",
            "src/p/msg/deep/D.msg": "int8 x\n",
            "src/p/srv/S.srv": "int8 a\n---\nint8 b\n",
        }
    )
    ran = forge("build", cwd=root)
    assert ran.code == 0, ran.out + ran.err
    assert diff(forge, root, "src", "install") == {}
    assert diff(forge, root, "src", "src/p") == {}
    shutil.rmtree(root / "src/p/srv")
    assert diff(forge, root, "install").keys() == {"p/srv/S"}


# --- what is printed


def output(forge: Forge, root: Path, *words: str) -> Ran:
    return forge("interface", "diff", "old", "new", "--package", "p", *words, cwd=root)


def test_differences_are_printed_with_their_effect(forge: Forge, tmp_path: Path) -> None:
    written(tmp_path / "old", {"msg/A.msg": "int8 x\n", "msg/B.msg": "int8 x\n", "msg/C.msg": "int8 x 1\n"})
    written(tmp_path / "new", {"msg/A.msg": "int8 y\n", "msg/D.msg": "int8 x\n", "msg/C.msg": "int8 x 2\n"})
    assert output(forge, tmp_path).out == (
        "p/msg/A: breaks the hash and the API\n"
        "  field 'x' is now called 'y'\n"
        "p/msg/B: removed\n"
        "p/msg/C: keeps the wire, the hash and the API\n"
        "  default value of 'x': 1 -> 2\n"
        "p/msg/D: new\n"
        "4 of 4 interfaces differ: 1 break the wire, 2 break the hash, 2 break the API\n"
    )


@pytest.mark.parametrize(
    ("words", "code"), [((), 1), (("wire",), 0), (("hash",), 1), (("wire", "api"), 1), (("none",), 0)]
)
def test_the_exit_code_depends_on_the_required_compatibility(
    words: tuple[str, ...], code: int, forge: Forge, tmp_path: Path
) -> None:
    written(tmp_path / "old", {"msg/A.msg": "int8 x\n"})
    written(tmp_path / "new", {"msg/A.msg": "int8 y\n"})
    assert output(forge, tmp_path, *(("--fail-on", *words) if words else ())).code == code


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("old", "nowhere"), "'nowhere' is neither a folder nor a git revision: "),
        (("empty", "empty"), "found no package 'p' with interfaces in 'empty' or 'empty'"),
        (("old", "wrong"), "wrong/msg/A.msg:1:1: error: unknown type 'q/Z'"),
        (("--upload-pack=x", "old"), "error: "),
    ],
)
@pytest.mark.needs("git")
def test_incomparable_inputs_are_reported(
    words: tuple[str, ...], said: str, forge: Forge, tmp_path: Path
) -> None:
    written(tmp_path / "old", {"msg/A.msg": "int8 x\n"})
    written(tmp_path / "wrong", {"msg/A.msg": "q/Z x\n"})
    (tmp_path / "empty").mkdir()
    ran = forge("interface", "diff", *words, "--package", "p", cwd=tmp_path)
    assert ran.code == 2
    assert said in ran.err


def test_valid_interfaces_are_compared_despite_invalid_ones(forge: Forge, tmp_path: Path) -> None:
    """Each reason is named once, at the definition that is wrong."""
    user = {"msg/User.msg": "A[] all\n", "msg/UserOfUser.msg": "User u\n", "srv/S.srv": "Syntax s\n---\n"}
    gone = {"msg/Z1.msg": "q/Z z\n", "msg/Z2.msg": "q/Z z\nq/Z y\n"}
    written(tmp_path / "old", {"msg/A.msg": "int8 x\n", "msg/F.msg": "int8 x\n", **user, **gone})
    written(tmp_path / "old", {"msg/Syntax.msg": "int8 x\n", "msg/Same.msg": "int8 x\n"})
    written(tmp_path / "new", {"msg/A.msg": "q/Z x\n", "msg/F.msg": "int16 x\n", **user, **gone})
    written(tmp_path / "new", {"msg/Syntax.msg": "int8\n", "msg/Same.msg": "int8 x\n"})
    ran = output(forge, tmp_path)
    assert ran.code == 2
    assert ran.out == (
        "p/msg/A: cannot be compared, because it is invalid in the new version\n"
        "p/msg/F: breaks the wire, the hash and the API\n"
        "  field 'x': int8 -> int16\n"
        "p/msg/Syntax: cannot be compared, because it is invalid in the new version\n"
        "p/msg/User: cannot be compared, because it is invalid in the new version\n"
        "p/msg/UserOfUser: cannot be compared, because it is invalid in the new version\n"
        "p/msg/Z1: cannot be compared, because it is invalid in both versions\n"
        "p/msg/Z2: cannot be compared, because it is invalid in both versions\n"
        "p/srv/S: cannot be compared, because it is invalid in the new version\n"
        "1 of 2 interfaces differ: 1 break the wire, 1 break the hash, 1 break the API; "
        "7 cannot be compared\n"
    )
    places = [line.partition(": error: ")[0] for line in ran.err.splitlines() if ": error: " in line]
    assert places == ["old/msg/Z1.msg:1:1", "new/msg/Syntax.msg:1:5", "new/msg/A.msg:1:1"]
    ran = output(forge, tmp_path, "--json", "--fail-on", "none")
    assert ran.code == 2
    found = json.loads(ran.out)
    assert found["p/msg/Z1"] == {"breaks": None, "changes": [], "invalid_in": ["old", "new"]}
    assert found["p/msg/F"]["breaks"] == ["wire", "hash", "api"]


@pytest.mark.parametrize(
    ("files", "names"),
    [
        ({"msg/deep/F.msg": "int8 y\n"}, {"F"}),
        ({"msg/IMUData.msg": "int8 x\n", "msg/ImuData.msg": "int8 x\n"}, {"ImuData"}),
        ({"msg/R.msg": "S[] s\n", "msg/S.msg": "R[] r\n"}, {"R", "S"}),
        pytest.param({"msg/U.idl": "module p { module msg { union U {}; }; };\n"}, {"U"}, marks=reads_idl),
        ({"msg/N.msg": "int8 class\n"}, {"N"}),
        ({"action/A.action": "int8 x\n---\n"}, {"A"}),
    ],
)
def test_invalid_interfaces_of_any_kind_do_not_affect_others(
    files: Mapping[str, str], names: set[str], forge: Forge, tmp_path: Path
) -> None:
    for version in ("old", "new"):
        written(tmp_path / version, {"msg/F.msg": "int8 x\n", "msg/G.msg": "int8 x\n"})
    written(tmp_path / "new", {**files, "msg/G.msg": "int8 y\n"})
    ran = output(forge, tmp_path, "--json")
    assert ran.code == 2
    found = json.loads(ran.out)
    assert found["p/msg/G"]["breaks"] == ["hash", "api"]
    assert {each.rpartition("/")[2] for each, one in found.items() if one["breaks"] is None} == names


def test_an_invalid_interface_of_another_package_does_not_affect_others(forge: Forge, tmp_path: Path) -> None:
    """Nor is an installed one of its name used instead."""
    for version, text in (("old", "int8 x"), ("new", "int8")):
        package = {"package.xml": manifest_text("std_msgs"), "msg/Header.msg": f"{text}\n"}
        written(tmp_path / version / "std_msgs", package)
        user = {"msg/User.msg": "std_msgs/Header h\n", "msg/Other.msg": f"int8 {version}er\n"}
        written(tmp_path / version / "p", {"package.xml": manifest_text("p"), **user})
    for words in ((), ("--package", "p")):
        ran = forge("interface", "diff", "old", "new", *words, "--json", cwd=tmp_path)
        assert ran.code == 2
        found = json.loads(ran.out)
        assert found["p/msg/User"]["breaks"] is None
        assert found["p/msg/Other"]["breaks"] == ["hash", "api"]
        assert ("std_msgs/msg/Header" in found) == (not words)
        assert ran.err.count("error: ") == 1


def test_messages_with_millions_of_members_are_compared(forge: Forge, tmp_path: Path) -> None:
    chain = {f"msg/M{n}.msg": f"M{n + 1} a\nM{n + 1} b\n" for n in range(30)}
    written(tmp_path / "old", {**chain, "msg/M30.msg": "int8 x\n"})
    written(tmp_path / "new", {**chain, "msg/M30.msg": "int16 x\n"})
    found = diff(forge, tmp_path)
    assert len(found) == 31
    assert all("wire" in each["breaks"] for each in found.values())
