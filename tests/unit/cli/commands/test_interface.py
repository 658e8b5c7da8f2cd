"""forge interface, as a user types it."""

from pathlib import Path

import pytest

from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from tests.conftest import GOLDEN, Forge, Golden, Tree
from tests.generated import reads_idl, render
from tests.packages import manifest_text

INDEX = "share/ament_index/resource_index"
PREFIX = {
    f"{INDEX}/packages/mine": "",
    f"{INDEX}/packages/bare": "",
    f"{INDEX}/rosidl_interfaces/mine": "\n".join(
        ("msg/Inner.msg", "msg/Loop.msg", "msg/Lost.msg", "msg/Only.idl", "msg/Top.msg", "srv/Ask.srv")
    ),
    "share/mine/msg/Top.msg": "# top\n\nInner inner # in\n",
    "share/mine/msg/Inner.msg": "# inner\nstd_msgs/String text\n",
    "share/mine/msg/Lost.msg": "nowhere/Thing thing\n",
    "share/mine/msg/Loop.msg": "Loop[] loop\n",
    "share/mine/msg/Only.idl": '#include "x.idl"\nmodule mine {};\n',
    "share/mine/srv/Ask.srv": "int8 a 3\n---\n",
}


def test_list_prints_a_heading_for_each_kind(forge: Forge) -> None:
    out = forge("interface", "list").out.splitlines()
    headings = [line for line in out if not line.startswith(" ")]
    assert headings == ["Messages:", "Services:", "Actions:"]
    assert "    std_msgs/msg/String" in out
    messages = out[1 : out.index("Services:")]
    assert messages == sorted(messages)


def test_list_can_be_restricted_to_kinds(forge: Forge) -> None:
    out = forge("interface", "list", "-a", "--only-srvs").out.splitlines()
    assert [line for line in out if not line.startswith(" ")] == ["Services:", "Actions:"]
    assert "    example_interfaces/action/Fibonacci" in out


def test_package_prints_one_interface_per_line(forge: Forge) -> None:
    assert (
        forge("interface", "package", "std_srvs").out
        == "std_srvs/srv/Empty\nstd_srvs/srv/SetBool\nstd_srvs/srv/Trigger\n"
    )
    assert (
        forge("interface", "package", "example_interfaces", "-a").out
        == "example_interfaces/action/Fibonacci\n"
    )


def test_a_package_without_interfaces_is_not_an_error(forge: Forge, tree: Tree) -> None:
    ran = forge("interface", "package", "bare", env={"AMENT_PREFIX_PATH": str(tree(PREFIX))})
    assert (ran.code, ran.out) == (0, "")
    assert forge("interface", "package", "ament_cmake").code == 0


def test_packages_are_sorted_and_listed_once(forge: Forge) -> None:
    names = forge("interface", "packages").out.splitlines()
    assert names == sorted(names)
    assert {"std_msgs", "std_srvs"} <= set(names)
    assert forge("interface", "packages", "-a", "-s").out == forge("interface", "packages", "-s").out
    assert "std_msgs" not in forge("interface", "packages", "-s").out.split()


def test_show_expands_nested_messages_and_removes_comments(forge: Forge, tree: Tree, golden: Golden) -> None:
    definitions = (GOLDEN / "interfaces/show/src").rglob("*.*")
    files = {f"share/tour/{path.parent.name}/{path.name}": path.read_text() for path in definitions}
    header = {"share/std_msgs/msg/Header.msg": "# head\n\nbuiltin_interfaces/Time stamp # when\n"}
    time = {"share/builtin_interfaces/msg/Time.msg": "int32 sec  # [s]\n\n# the rest\nuint32 nanosec\n"}
    prefix = {"AMENT_PREFIX_PATH": str(tree({**files, **header, **time}))}
    shown = {
        f"{name}{option}.txt": forge(
            "interface", "show", f"tour/{name}", *filter(None, [option]), env=prefix
        ).out
        for name in ("msg/Walk", "srv/Go")
        for option in ("", "--all-comments", "--no-comments")
    }
    golden("interfaces/show", shown)


def test_show_reads_sourced_prefixes_and_names_from_stdin(forge: Forge, tree: Tree) -> None:
    prefix = {"AMENT_PREFIX_PATH": str(tree(PREFIX))}
    ran = forge("interface", "show", "mine/msg/Top", env=prefix)
    assert ran.out == "# top\n\nInner inner # in\n\tstd_msgs/String text\n\t\tstring data\n"


def test_interfaces_of_the_current_workspace_need_no_sourcing(forge: Forge, tree: Tree) -> None:
    """But code is generated only from what is included or sourced, as in a build."""
    files = {f"install/mine/{path}": text for path, text in PREFIX.items()}
    root = tree(
        {**files, "install/.colcon_install_layout": "isolated\n", "src/new/msg/A.msg": "mine/Inner i\n"}
    )
    ran = forge("interface", "show", "mine/msg/Top", cwd=root / "src")
    assert (ran.code, ran.err) == (0, "")
    assert "mine/msg/Top\n" in forge("interface", "package", "mine", cwd=root / "src").out
    assert "mine\n" in forge("interface", "packages", cwd=root).out
    assert "    mine/srv/Ask\n" in forge("interface", "list", cwd=root).out
    new = ("--package", "new", str(root / "src/new"))
    assert "mine" in forge("interface", "generate", *new, "--output", "out", cwd=root).err


@pytest.mark.parametrize("built", [True, False])
def test_errors_name_the_command_that_builds_the_package(
    forge: Forge,
    tree: Tree,
    built: bool,
) -> None:
    files = {
        "src/robot_msgs/package.xml": manifest_text("robot_msgs"),
        "src/robot_msgs/msg/Arm.msg": "int8 x\n",
        "src/robot_msg/package.xml": manifest_text("robot_msg"),
    }
    installed = {f"install/robot_msg/{path}": text for path, text in PREFIX.items()}
    installed["install/.colcon_install_layout"] = "isolated\n"
    root = tree({**files, **(installed if built else {})})
    arm = "robot_msgs/msg/Arm"
    for words in (("show", arm), ("package", "robot_msgs")):
        ran = forge("interface", *words, cwd=root / "src")
        assert ran.code == 2
        assert ran.err == (
            "error: package 'robot_msgs' is in this workspace, but not built\n"
            "hint: run: forge build --packages-up-to robot_msgs\n"
        )


def test_show_prints_idl_only_interfaces_unchanged(forge: Forge, tree: Tree) -> None:
    ran = forge("interface", "show", "mine/msg/Only", env={"AMENT_PREFIX_PATH": str(tree(PREFIX))})
    assert ran.out == PREFIX["share/mine/msg/Only.idl"]


def test_show_suggests_the_full_name(forge: Forge, tree: Tree) -> None:
    ran = forge("interface", "show", "mine/Only", env={"AMENT_PREFIX_PATH": str(tree(PREFIX))})
    assert ran.code == 2
    assert "hint: did you mean 'mine/msg/Only'?" in ran.err


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("std_msgs/String", "Invalid name 'std_msgs/String'. Expected three parts separated by '/'"),
        ("a/b/c/d", "Invalid name 'a/b/c/d'. Expected three parts separated by '/'"),
        ("a//c", "Invalid name 'a//c'. Must not contain empty parts"),
        ("a/../c", "Invalid name 'a/../c'. Must not contain '..'"),
        ("std_msg/msg/String", "Unknown package 'std_msg'"),
        ("mine/msg/Topp", "Could not find the interface 'PREFIX/share/mine/msg/Topp.idl'"),
        ("mine/msg/Lost", "Unknown package 'nowhere'"),
        ("mine/msg/Loop", "a message cannot contain itself: mine/Loop -> mine/Loop"),
        ("bare/msg/A", "Could not find the interface 'PREFIX/share/bare/msg/A.idl'"),
        ("", "argument TYPE: the name is empty"),
    ],
)
def test_show_reports_its_errors(forge: Forge, tree: Tree, name: str, text: str) -> None:
    prefix = tree(PREFIX)
    ran = forge("interface", "show", name, env={"AMENT_PREFIX_PATH": str(prefix)})
    assert ran.code == 2
    assert ran.err.splitlines()[0] == f"error: {text.replace('PREFIX', str(prefix))}"


def test_idl_only_interfaces_are_listed(forge: Forge, tree: Tree) -> None:
    struct = "module mine { module msg { struct Short { @default (value=7) short a; }; }; };"
    other = "module mine { module idl { struct Wide { mine::msg::Short a; wchar b; }; }; };"
    elsewhere = "module mine { module other { struct Wrong { short a; }; }; };"
    files = {
        "msg/Short.idl": struct,
        "idl/Wide.idl": other,
        "msg/Wrong.idl": elsewhere,
        "msg/Short.msg": "Gone a",
    }
    listed = {f"{INDEX}/rosidl_interfaces/mine": "\n".join(files)}
    prefix = tree({**PREFIX, **listed, **{f"share/mine/{path}": text for path, text in files.items()}})
    (prefix / "share/mine/msg/Short.msg").unlink()
    env = {"AMENT_PREFIX_PATH": str(prefix)}
    assert "    mine/idl/Wide" not in forge("interface", "list", env=env).out.splitlines()
    assert "mine/idl/Wide" in forge("interface", "package", "mine", env=env).out.splitlines()


@reads_idl
def test_generate_takes_idl_files_and_folders_of_them(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/msg/A.idl": "module tour { module msg { struct A { long a; }; }; };",
            "src/deep/B.idl": "module tour { module deep { struct B { tour::msg::C c; }; }; };",
            "src/msg/C.msg": "A a\nstd_msgs/String text",
            "src/msg/C.idl": "// generated from tour/msg/C.msg, and not read",
        }
    )
    arguments = ["--package", "tour", "--lang", "idl", "--lang", "json", "--output"]
    assert forge("interface", "generate", *arguments, "all", "src", cwd=root).err == ""
    made = {
        path.relative_to(root / "all/idl/tour").as_posix() for path in (root / "all/idl/tour").rglob("*.idl")
    }
    assert made == {"deep/B.idl", "msg/A.idl", "msg/C.idl"}
    files = ["--file", "src:msg/A.idl", "--file", "src:msg/C.msg", "--file", "src:deep/B.idl"]
    assert forge("interface", "generate", *arguments, "some", *files, cwd=root).err == ""
    for path in made:
        assert (root / "some/idl/tour" / path).read_text() == (root / "all/idl/tour" / path).read_text()


def test_generate_writes_a_package_with_its_dependencies(forge: Forge, tree: Tree) -> None:
    root = tree({"src/msg/A.msg": "std_msgs/Header header", "src/action/Go.action": "A a\n---\n---\n"})
    out = root / "out"
    ran = forge("interface", "generate", "--package", "tour", "--output", str(out), str(root / "src"))
    assert (ran.code, ran.err) == (0, "")
    for path in (
        "python/tour/msg/_a.py",
        "python/std_msgs/msg/_header.py",
        "python/action_msgs/srv/_cancel_goal.py",
        "cpp/tour/msg/a.hpp",
        "cpp/tour/action/go.hpp",
        "cpp/std_msgs/msg/header.hpp",
        "cpp/action_msgs/msg/goal_status_array.hpp",
        "cpp/rosidl_runtime_cpp/bounded_vector.hpp",
    ):
        assert (out / path).is_file(), path
    assert not (out / "python/std_msgs/msg/_string.py").exists()
    again = forge("interface", "generate", "--package", "tour", "--output", str(out), str(root / "src"))
    assert again.out.startswith("0 of ")


def test_packages_can_share_an_output_folder(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "a/msg/A.msg": "std_msgs/Header header",
            "b/msg/B.msg": "std_msgs/String text\na_msgs/A a",
            "a/msg/Old.msg": "int8 old",
        }
    )
    out = root / "out"

    def generate(package: str, folder: str) -> None:
        arguments = ["--include", f"a_msgs={root / 'a'}", "--lang", "python", str(root / folder)]
        ran = forge("interface", "generate", "--package", package, "--output", str(out), *arguments)
        assert (ran.code, ran.err) == (0, "")

    generate("a_msgs", "a")
    generate("b_msgs", "b")
    generate("a_msgs", "a")
    namespace = (out / "python/std_msgs/msg/__init__.py").read_text()
    assert "Header" in namespace
    assert "String" in namespace
    assert (out / "python/a_msgs/msg/_old.py").is_file()
    (root / "a/msg/Old.msg").unlink()
    generate("a_msgs", "a")
    assert not (out / "python/a_msgs/msg/_old.py").exists()


def test_a_build_rejects_types_of_packages_that_are_not_dependencies(forge: Forge, tree: Tree) -> None:
    root = tree({"src/msg/A.msg": "int8 a\nstd_msgs/Header header"})
    arguments = ["--package", "tour", "--output", "out", "--no-runtime", "src"]
    ran = forge("interface", "generate", *arguments, cwd=root)
    assert ran.code == 2
    assert ran.err.splitlines()[:2] == [
        "src/msg/A.msg:2:1: error: 'tour' does not depend on 'std_msgs'",
        "    std_msgs/Header header",
    ]
    listed = "hint: add std_msgs to the DEPENDENCIES of rosidl_generate_interfaces()"
    declared = "<depend>std_msgs</depend>"
    assert ran.err.splitlines()[-1] == f"{listed}, and {declared} to package.xml"
    tree({"src/package.xml": f"<package>{declared}</package>"})
    assert forge("interface", "generate", *arguments, cwd=root).err.splitlines()[-1] == listed
    tree({"src/package.xml": "<package>"})
    assert declared in forge("interface", "generate", *arguments, cwd=root).err
    included = Library().folder("std_msgs")
    assert forge("interface", "generate", *arguments, "--include", f"std_msgs={included}", cwd=root).code == 0


def test_generate_for_a_build_takes_files_and_writes_a_stamp_and_a_depfile(forge: Forge, tree: Tree) -> None:
    root = tree({"some where/msg/A.msg": "std_msgs/Header header"})
    arguments = [
        "--package",
        "tour",
        "--output",
        "out",
        "--lang",
        "idl",
        "--lang",
        "json",
        "--no-runtime",
        "--include",
        f"std_msgs={Library().folder('std_msgs')}",
        "--file",
        f"{root / 'some where'}:msg/A.msg",
        "--stamp",
        "out/stamp",
        "--depfile",
        "out/tour.d",
    ]
    (root / "generate.args").write_text("\n".join(arguments))
    ran = forge("interface", "generate", "@generate.args", cwd=root)
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    made = sorted(
        path.relative_to(root / "out").as_posix() for path in (root / "out").rglob("*") if path.is_file()
    )
    assert made == [".forge/tour.json", "idl/tour/msg/A.idl", "json/tour/msg/A.json", "stamp", "tour.d"]
    depfile = (root / "out/tour.d").read_text()
    assert depfile.startswith("out/stamp: ")
    assert "some\\ where/msg/A.msg" in depfile
    assert "std_msgs/msg/Header.msg" in depfile


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "missing package name"),
        (["--package", "Tour", "."], "'Tour' is not a valid name of an interface package"),
        (["--package", "tour"], "no interface definitions found"),
        (["--package", "tour", "."], "no interface definitions found in '.'"),
        (["--package", "tour", "--lang", "pyton", "src"], "unknown target 'pyton'"),
        (["--package", "tour", "--file", "x"], "argument --file: 'x' is not of the form LEFT:RIGHT"),
        (["--package", "tour", "--include", "x="], "argument --include: 'x=' is not of the form LEFT=RIGHT"),
    ],
)
def test_generate_reports_missing_definitions(
    forge: Forge, tree: Tree, arguments: list[str], text: str
) -> None:
    root = tree({"src/msg/A.msg": "int8 a"})
    ran = forge("interface", "generate", "--output", "out", *arguments, cwd=root)
    assert (ran.code, ran.err.splitlines()[0]) == (2, f"error: {text}")


def test_idl_text_matches_the_reviewed_text(golden: Golden) -> None:
    folder = GOLDEN / "interfaces/idl/src"
    catalog = resolve("tour", parse_all(read_folder("tour", folder)), Library())
    golden("interfaces/idl", {file.path.removeprefix("idl/"): file.text for file in render(catalog, "idl")})


def test_a_name_can_be_read_from_stdin(forge: Forge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "line").write_text("std_msgs/msg/Empty\nnot read\n")
    with (tmp_path / "line").open() as stream:
        monkeypatch.setattr("sys.stdin", stream)
        assert forge("interface", "show", "-").code == 0
