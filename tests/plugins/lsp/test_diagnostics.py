"""The problems of single files, as an editor shows them."""

import time
from pathlib import Path

import pytest

from forge.base.errors import ForgeError
from forge.build.build_types import build_type_of
from forge.plugins.lsp.diagnostics import diagnose
from forge.plugins.lsp.index import Index
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from tests.conftest import Tree
from tests.generated import reads_idl
from tests.packages import manifest_text
from tests.plugins.lsp.editors import index_of


@pytest.fixture
def index(tree: Tree) -> Index:
    return index_of(tree({"src/nav/package.xml": manifest_text("nav"), "src/nav/msg/Goal.msg": "int8 x\n"}))


def told(index: Index, file: str, text: str) -> list[str]:
    """Return the problems of a file of the package with this text."""
    path = index.root / "src/nav" / file
    index.open(path, text)
    return [
        f"{each.span.line}:{each.span.start}-{each.span.end} {each.severity}: {each.message.splitlines()[0]}"
        for each in diagnose(index, path)
    ]


_IDL = "module nav {\n  module msg {\n    struct A {\n      nav::msg::Gaol g;\n    };\n  };\n};\n"


@pytest.mark.parametrize(
    ("file", "text", "problems"),
    [
        ("msg/A.msg", "int8 x\n", []),
        ("msg/A.msg", "int8 X\n", ["0:5-6 error: invalid field name 'X'"]),
        ("msg/A.msg", "int8\n\nint8 y\n", ["0:4-5 error: expected a name after 'int8'"]),
        ("msg/A.msg", "A[] more\n", ["0:0-3 error: a message cannot contain itself: nav/A -> nav/A"]),
        ("msg/A.msg", "std_msgs/Empty a\n", ["0:0-14 warning: 'nav' does not depend on 'std_msgs'"]),
        ("msg/A.msg", "std_msgs/Empt a\n", ["0:0-13 error: unknown type 'std_msgs/Empt'"]),
        ("srv/A.srv", "int8 x\n", ["0:0-6 error: a .srv file must contain exactly one '---'"]),
        ("action/A.action", "int8 x\n---\n---\nGoal g\nFoo f\n", ["4:0-3 error: unknown type 'nav/Foo'"]),
        pytest.param("msg/A.idl", _IDL, ["3:21-22 error: unknown type 'nav/Gaol'"], marks=reads_idl),
        pytest.param(
            "msg/A.idl",
            *("module nav {\n  struct\n", ["1:8-9 error: unexpected end of file"]),
            marks=reads_idl,
        ),
        ("package.xml", manifest_text("nav", "<dpend>a</dpend>"), ["7:2-18 error: unknown element 'dpend'"]),
        ("package.xml", "<package>\n", ["1:0-1 error: not well-formed XML: no element found"]),
        ("package.xml", manifest_text("nav", "<depend/>"), ["7:2-11 warning: element 'depend' is empty"]),
    ],
)
def test_diagnostics_match_compiler_errors(index: Index, file: str, text: str, problems: list[str]) -> None:
    assert told(index, file, text) == problems


def test_hints_follow_the_message(index: Index) -> None:
    path = index.root / "src/nav/msg/A.msg"
    index.open(path, "Gaol goal\n")
    (error,) = diagnose(index, path)
    assert error.message == "unknown type 'nav/Gaol'\nhint: did you mean 'nav/Goal'?"


@pytest.mark.parametrize("build_type", ["ament_cmake", "cmake", "weird_make"])
@pytest.mark.usefixtures("plugin")
def test_supported_build_types_give_no_diagnostics(index: Index, build_type: str) -> None:
    assert told(index, "package.xml", manifest_text("nav", build_type=build_type)) == []


@pytest.mark.parametrize(
    ("build_type", "span", "hint"),
    [
        ("ament_weird", "22-33", "did you mean 'ament_"),
        ("", "10-44", "supported build types: ament_"),
        ("catkin", "22-28", "catkin, the build type of"),
    ],
)
def test_an_unsupported_build_type_is_reported_as_by_the_build(
    index: Index, build_type: str, span: str, hint: str
) -> None:
    path, text = index.root / "src/nav/package.xml", manifest_text("nav", build_type=build_type)
    message = f"unsupported build type '{build_type}' of package 'nav'"
    assert told(index, "package.xml", text) == [f"7:{span} error: {message}"]
    (problem,) = diagnose(index, path)
    parsed = parse_manifest(text.encode(), path, {})
    with pytest.raises(ForgeError) as built:
        build_type_of(Package(Path("src/nav"), parsed))
    assert problem.message == f"{message}\nhint: {built.value.problems[0].hint}"
    assert f"hint: {hint}" in problem.message


def test_only_the_active_build_type_is_checked(index: Index) -> None:
    weird = '<build_type condition="$ROS_VERSION == 1">catkin</build_type>'
    text = manifest_text("nav").replace("<export>", f"<export>{weird}")
    assert told(index, "package.xml", text) == []


def test_an_overridden_build_type_gives_no_diagnostics(tree: Tree) -> None:
    manifest = manifest_text("nav", build_type="weird")
    root = tree({"src/nav/package.xml": manifest, "src/nav/colcon.pkg": '{"type": "ros.ament_cmake"}'})
    assert told(index_of(root), "package.xml", manifest) == []


def test_a_type_with_a_broken_file_is_still_known(index: Index) -> None:
    told(index, "msg/Goal.msg", "what is this\n")
    assert told(index, "msg/A.msg", "Goal goal\n") == []


def test_problems_are_shown_in_the_file_that_causes_them(index: Index) -> None:
    assert told(index, "msg/Goal.msg", "Missing x\n") == ["0:0-7 error: unknown type 'nav/Missing'"]
    assert told(index, "msg/A.msg", "Goal goal\n") == []


def test_a_cycle_is_shown_in_each_of_its_files(index: Index) -> None:
    told(index, "msg/Goal.msg", "A a\n")
    assert told(index, "msg/A.msg", "int8 x\nGoal goal\n") == [
        "1:0-4 error: a message cannot contain itself: nav/A -> nav/Goal -> nav/A"
    ]
    assert told(index, "msg/Goal.msg", "A a\n") == [
        "0:0-1 error: a message cannot contain itself: nav/Goal -> nav/A -> nav/Goal"
    ]


def test_an_unknown_file_has_no_diagnostics(index: Index, tmp_path: Path) -> None:
    assert diagnose(index, tmp_path / "src/nav/msg/Nowhere.msg") == ()


@reads_idl
def test_files_with_conflicting_outputs_are_reported(index: Index) -> None:
    same = "0:0-6 warning: 'GOAL' and 'Goal' would both be generated into 'goal'"
    assert told(index, "msg/GOAL.msg", "int8 x\n") == [same]
    assert told(index, "srv/GOAL.srv", "---\n") == []
    index.close(index.root / "src/nav/msg/GOAL.msg")
    assert told(index, "msg/Goal.msg", "int8 x\n") == []
    again = "module nav { module msg { struct Goal { long x; }; }; };"
    assert told(index, "msg/Goal.idl", again) == [
        "0:0-56 warning: 'nav/msg/Goal' is also defined in 'src/nav/msg/Goal.msg'"
    ]


def test_thousands_of_unknown_types_do_not_stop_the_editor(index: Index) -> None:
    text = "".join(f"std_msgs/Strin{number} f{number}\n" for number in range(3000))
    began = time.process_time()
    assert len(told(index, "msg/Many.msg", text)) == 3000
    assert time.process_time() - began < 3
