"""Corner cases of interface definitions in the parser, type hashes and generated Python.

Messages are loaded by `forge.interfaces.load`. The same cases in C++ are in
tests/integration/interfaces/cpp/test_compiles.py, their serialization in python/test_cdr.py.
"""

from pathlib import Path
from typing import Any

import pytest

from forge.base.names import snake_case
from forge.interfaces import load
from forge.interfaces.hashing import hashes
from forge.interfaces.model import (
    Interface,
    Message,
    Source,
    TypeName,
)
from forge.interfaces.read.parsing import parse, parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from tests.conftest import Forge, Tree

BASIC = {
    "bool": ("true", "[false, true, false]"),
    "byte": ("50", "[0, 1, 255]"),
    "char": ("100", "[0, 1, 127]"),
    "float32": ("1.125", "[1.125, 0.0, -1.125]"),
    "float64": ("1.125", "[3.1415, 0.0, -3.1415]"),
    "int8": ("-50", "[0, 127, -128]"),
    "uint8": ("200", "[0, 1, 255]"),
    "int16": ("-1000", "[0, 32767, -32768]"),
    "uint16": ("2000", "[0, 1, 65535]"),
    "int32": ("-30000", "[0, 2147483647, -2147483648]"),
    "uint32": ("60000", "[0, 1, 4294967295]"),
    "int64": ("-40000000", "[0, 9223372036854775807, -9223372036854775808]"),
    "uint64": ("50000000", "[0, 1, 18446744073709551615]"),
}
"""A default for a value and for an array of each basic type, as in ROS's test messages."""


def collections(suffix: str) -> str:
    """Return ROS's test message of arrays or sequences."""
    types = {**dict.fromkeys(BASIC), "string": None}
    lines = [f"{type_}{suffix} {type_}_values" for type_ in types]
    lines += [f"{name}{suffix} {snake_case(name)}_values" for name in ("BasicTypes", "Constants", "Defaults")]
    lines += [f"{type_}{suffix} {type_}_values_default {values}" for type_, (_, values) in BASIC.items()]
    lines.append(f'string{suffix} string_values_default ["", "max value", "min value"]')
    return "\n".join([*lines, "int32 alignment_check"])


def texts(word: str, kind: str) -> list[str]:
    """Return fields with the same default in five kinds of quotes."""
    quoted = [
        r'"Hello world!"',
        '''"Hello'world!"''',
        """'Hello"world!'""",
        r"'Hello\'world!'",
        r'"Hello\"world!"',
    ]
    return [f"{kind} {word}_value", *(f"{kind} {word}_value_default{n} {q}" for n, q in enumerate(quoted, 1))]


TEST_MSGS = {
    "BasicTypes": "\n".join(f"{type_} {type_}_value" for type_ in BASIC),
    "Defaults": "\n".join(f"{type_} {type_}_value {value}" for type_, (value, _) in BASIC.items()),
    "Constants": "\n".join(f"{type_} {type_.upper()}_CONST={value}" for type_, (value, _) in BASIC.items()),
    "Arrays": collections("[3]"),
    "BoundedSequences": collections("[<=3]"),
    "UnboundedSequences": collections("[]"),
    "MultiNested": "\n".join(
        f"{of}{suffix} {word}_of_{snake_case(of)}"
        for word, suffix in (("array", "[3]"), ("bounded_sequence", "[<=3]"), ("unbounded_sequence", "[]"))
        for of in ("Arrays", "BoundedSequences", "UnboundedSequences")
    ),
    "Strings": "\n".join(
        [
            *texts("string", "string"),
            'string STRING_CONST="Hello world!"',
            *texts("bounded_string", "string<=22"),
        ]
    ),
    "WStrings": """\
wstring wstring_value
wstring wstring_value_default1 "Hello world!"
wstring wstring_value_default2 "Hellö wörld!"
wstring wstring_value_default3 "ハローワールド"
#wstring WSTRING_CONST='Hello'
wstring[3] array_of_wstrings
wstring[<=3] bounded_sequence_of_wstrings
wstring[] unbounded_sequence_of_wstrings
""",
    "Empty": "",
}
KNOWN = {
    "BasicTypes": "7c300afd4e796798d49bdd6cdaa0fa87fa0ed2ba3217d977e1faa87070d797ab",
    "Strings": "eee55533636293ac7c94c62432eedb5777eb849847d2a17b4dcead8c4a20ab32",
    "WStrings": "5a2c8ddb2054600023b9a180652f2ba895373217cad4b1f0fc1258c9e4424a79",
    "BoundedSequences": "fb361a3b3827c76a142c2190126a20a92e7e510e047f880141a7e9ef867961ed",
    "MultiNested": "9ee9cbfb17c2df991a750b761a56def78674034977c829449820ca07efd9758b",
}


def read(text: str, relative: str = "msg/A.msg") -> Interface:
    return parse(Source("tour", relative, Path(relative), text))


def message(text: str) -> Message:
    interface = read(text)
    assert isinstance(interface, Message)
    return interface


def embedded(name: str) -> Any:
    parsed = Library().find(TypeName(*name.split("/")))
    assert parsed
    return parsed.interface


@pytest.fixture(scope="module")
def test_msgs(
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """Write ROS's test messages."""
    folder = tmp_path_factory.mktemp("test_msgs")
    (folder / "msg").mkdir()
    for name, text in TEST_MSGS.items():
        (folder / "msg" / f"{name}.msg").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", KNOWN)
def test_nested_arrays_of_messages_have_the_reference_hashes(name: str, test_msgs: Path) -> None:
    """The hashes are those of rosidl; MultiNested contains nearly all other messages."""
    found = hashes(
        resolve(
            "test_msgs",
            parse_all(
                read_folder(
                    "test_msgs",
                    test_msgs,
                )
            ),
            Library(),
        )
    )
    assert found[TypeName("test_msgs", "msg", name)] == f"RIHS01_{KNOWN[name]}"


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


def test_idl_only_types_have_their_own_namespace(forge: Forge, tree: Tree) -> None:
    idl = "module tour {{ module idl {{ struct Only {{ wchar a; sequence<wchar> b; {} c; }}; }}; }};"
    folder = tree({"src/idl/Only.idl": idl.format("long double")})
    arguments = ["--package", "tour", "--output", "out", "src"]
    hashed = forge("interface", "hash", "--package", "tour", "src", cwd=folder)
    assert hashed.out.startswith("tour/idl/Only RIHS01_")
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
