"""`forge interface proto`."""

from tests.conftest import Forge, Tree
from tests.generated import reads_idl
from tests.packages import manifest_text

INDEX = "share/ament_index/resource_index"
MARKS = {f"{INDEX}/packages/mine": "", f"{INDEX}/rosidl_interfaces/mine": ""}


def test_proto_prints_the_defaults_as_yaml(forge: Forge) -> None:
    assert forge("interface", "proto", "geometry_msgs/msg/Point").out == '"x: 0.0\ny: 0.0\nz: 0.0\n"\n'
    assert forge("interface", "proto", "--no-quotes", "std_srvs/srv/SetBool").out == "data: false\n\n"
    assert forge("interface", "proto", "--no-quotes", "std_msgs/msg/Empty").out == "{}\n\n"
    assert forge("interface", "proto", "example_interfaces/action/Fibonacci").out == '"order: 0\n"\n'
    nested = forge("interface", "proto", "--no-quotes", "geometry_msgs/msg/PoseStamped").out
    assert "  orientation:\n    x: 0.0\n    y: 0.0\n    z: 0.0\n    w: 1.0\n" in nested
    assert nested.startswith("header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: ''\npose:\n")


def test_proto_supports_every_kind_of_field(forge: Forge, tree: Tree) -> None:
    lines = [
        "byte a",
        "byte b 65",
        "byte[2] c",
        "float32[2] d [0.1, 1]",
        "string[] e ['x']",
        "Inner[2] f",
        "bool[] g",
    ]
    prefix = tree(
        {**MARKS, "share/mine/msg/All.msg": "\n".join(lines), "share/mine/msg/Inner.msg": "int8 x 1"}
    )
    ran = forge("interface", "proto", "--no-quotes", "mine/msg/All", env={"AMENT_PREFIX_PATH": str(prefix)})
    assert ran.out == (
        'a: "\\0"\nb: A\nc:\n- "\\0"\n- "\\0"\nd:\n- 0.10000000149011612\n- 1.0\ne:\n- x\n'
        "f:\n- x: 1\n- x: 1\ng: []\n\n"
    )


@reads_idl
def test_interfaces_in_idl_have_defaults(forge: Forge, tree: Tree) -> None:
    files = {
        "msg/Short.idl": "module mine { module msg { struct Short { @default (value=7) short a; }; }; };",
        "idl/Wide.idl": "module mine { module idl { struct Wide { mine::msg::Short a; wchar b; }; }; };",
        "msg/Wrong.idl": "module mine { module other { struct Wrong { short a; }; }; };",
    }
    listed = {f"{INDEX}/rosidl_interfaces/mine": "\n".join(files)}
    prefix = tree({**MARKS, **listed, **{f"share/mine/{path}": text for path, text in files.items()}})
    env = {"AMENT_PREFIX_PATH": str(prefix)}
    ran = forge("interface", "proto", "--no-quotes", "mine/idl/Wide", env=env)
    assert ran.out == 'a:\n  a: 7\nb: "\\0"\n\n'
    ran = forge("interface", "proto", "mine/msg/Wrong", env=env)
    assert (ran.code, "does not define the interface 'mine/msg/Wrong'" in ran.err) == (2, True)


def test_an_error_names_the_command_that_builds_the_package(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/robot_msgs/package.xml": manifest_text("robot_msgs"),
            "src/robot_msgs/msg/Arm.msg": "int8 x\n",
            "install/.colcon_install_layout": "isolated\n",
        }
    )
    for verb in ("proto", "schema"):
        ran = forge("interface", verb, "robot_msgs/msg/Arm", cwd=root / "src")
        assert ran.code == 2
        assert ran.err == (
            "error: package 'robot_msgs' is in this workspace, but not built\n"
            "hint: run: forge build --packages-up-to robot_msgs\n"
        )


def test_interfaces_of_the_current_workspace_need_no_sourcing(forge: Forge, tree: Tree) -> None:
    files = {**MARKS, f"{INDEX}/rosidl_interfaces/mine": "msg/Top.msg", "share/mine/msg/Top.msg": "int8 x\n"}
    root = tree({f"install/mine/{path}": text for path, text in files.items()})
    tree({"install/.colcon_install_layout": "isolated\n", "src/new/msg/A.msg": ""})
    for verb in ("proto", "schema"):
        ran = forge("interface", verb, "mine/msg/Top", cwd=root / "src")
        assert (ran.code, ran.err) == (0, ""), verb
