"""Corner cases of interface definitions in the parser and in generated Python.

Messages are loaded by `forge.interfaces.load`. The same cases in C++ are in
tests/integration/interfaces/cpp/test_compiles.py, their serialization in python/test_cdr.py.
"""

from pathlib import Path

from forge.interfaces import load
from forge.interfaces.model import Message, Source
from forge.interfaces.read.parsing import parse
from tests.conftest import Forge, Tree
from tests.generated import reads_idl


def message(text: str) -> Message:
    interface = parse(Source("tour", "msg/A.msg", Path("A.msg"), text))
    assert isinstance(interface, Message)
    return interface


def test_bare_and_qualified_type_names_are_equivalent(tree: Tree) -> None:
    part = "Near near\ntour/Near again\nbuiltin_interfaces/Duration far\n"
    folder = tree({"msg/Near.msg": "int8 a", "action/Go.action": f"{part}---\n{part}---\n{part}"})
    go = load(folder, "tour")["tour/action/Go"]
    for section in (go.Goal, go.Result, go.Feedback):
        assert type(section().near) is type(section().again)


def test_any_text_in_brackets_is_a_unit_as_in_rosidl() -> None:
    (field,) = message("float32 a # a share [0.0-1.0]").fields
    assert (field.doc, field.unit) == (("a share",), "0.0-1.0")
    assert message("# K[0] == 0.0 says that.\n\nint8 a").doc == ("K == 0.0 says that.",)
    assert message("#     [fx  0 cx]\n# K = [ 0 fy cy]\n\nint8 a").doc == ("    [fx  0 cx]", "K = [ 0 fy cy]")


@reads_idl
def test_idl_only_types_have_their_own_namespace(forge: Forge, tree: Tree) -> None:
    idl = "module tour {{ module idl {{ struct Only {{ wchar a; sequence<wchar> b; {} c; }}; }}; }};"
    folder = tree({"src/idl/Only.idl": idl.format("long double")})
    arguments = ["--package", "tour", "--output", "out", "src"]
    ran = forge("interface", "generate", *arguments, cwd=folder)
    assert ran.code == 2
    assert ran.err.splitlines()[0].endswith("error: Python has no type for the long double 'c'")
    folder = tree({"src/idl/Only.idl": idl.format("double")})
    assert load(folder / "src", "tour")["tour/idl/Only"](a="日", b=["x"]).a == "日"


def test_types_named_like_python_keywords_are_errors_of_the_python_target(forge: Forge, tree: Tree) -> None:
    folder = tree({"src/srv/None.srv": "---\n", "src/msg/Null.msg": ""})
    ran = forge("interface", "generate", "--package", "tour", "--output", "out", "src", cwd=folder)
    assert (ran.code, ran.err.splitlines()[0]) == (
        2,
        "src/srv/None.srv: error: a Python class cannot be called 'None'",
    )
    words = ("generate", "--package", "tour", "--output", "out", "--lang", "cpp", "src")
    assert forge("interface", *words, cwd=folder).code == 0
