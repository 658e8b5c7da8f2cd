"""Corner cases of interface definitions: what the parser, the type hash and generated Python make of them.

Messages are loaded by `forge.interfaces.load`. The same cases in C++ are in
tests/integration/interfaces/cpp/test_compiles.py, their serialization in python/test_cdr.py.
"""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from forge.base.errors import InterfaceError
from forge.base.names import snake_case
from forge.base.standard_interfaces import EMBEDDED
from forge.interfaces import load
from forge.interfaces.hashing import hashes
from forge.interfaces.model import (
    Array,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
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
"""ROS's test messages have a field of each basic type, and arrays of three with values at the borders."""


def collections(suffix: str) -> str:
    """Return ROS's test message whose fields all are arrays or sequences of three."""
    types = {**dict.fromkeys(BASIC), "string": None}
    lines = [f"{type_}{suffix} {type_}_values" for type_ in types]
    lines += [f"{name}{suffix} {snake_case(name)}_values" for name in ("BasicTypes", "Constants", "Defaults")]
    lines += [f"{type_}{suffix} {type_}_values_default {values}" for type_, (_, values) in BASIC.items()]
    lines.append(f'string{suffix} string_values_default ["", "max value", "min value"]')
    return "\n".join([*lines, "int32 alignment_check"])


def texts(word: str, kind: str) -> list[str]:
    """Return fields with one default, quoted in five ways."""
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
    """Return an interface that forge brings along."""
    parsed = Library().find(TypeName(*name.split("/")))
    assert parsed
    return parsed.interface


def made(text: str) -> Any:
    """Return the Python class of a message."""
    return load(text, "tour/msg/A")["tour/msg/A"]


def hash_of(name: str) -> str:
    package = name.partition("/")[0]
    catalog = resolve(package, parse_all(read_folder(package, EMBEDDED / package)), Library())
    return hashes(catalog)[TypeName(*name.split("/"))].removeprefix("RIHS01_")


@pytest.fixture(scope="module")
def test_msgs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write ROS's test messages."""
    folder = tmp_path_factory.mktemp("test_msgs")
    (folder / "msg").mkdir()
    for name, text in TEST_MSGS.items():
        (folder / "msg" / f"{name}.msg").write_text(text, encoding="utf-8")
    return folder


def test_01_files_of_no_bytes_and_of_one_separator() -> None:
    assert (message("").fields, message("").members[0].type) == ((), Primitive("uint8"))
    service = read("---", "srv/A.srv")
    assert isinstance(service, Service)
    assert (service.request.fields, service.response.fields) == ((), ())
    assert hash_of("std_msgs/msg/Empty") == "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"
    assert hash_of("std_srvs/srv/Empty") == "5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19"
    made("")()
    assert made("").get_fields_and_field_types() == {}


def test_02_constants_alone_make_an_empty_message_that_others_contain(test_msgs: Path) -> None:
    constants = message(TEST_MSGS["Constants"])
    assert (constants.fields, len(constants.constants)) == ((), 13)
    arrays = load(test_msgs, "test_msgs")["test_msgs/msg/Arrays"]()
    assert len(arrays.constants_values) == 3
    assert arrays.constants_values[0].INT64_CONST == -40000000


@pytest.mark.parametrize("name", ["Arrays", "BoundedSequences", "UnboundedSequences"])
def test_03_what_follows_strings_of_odd_length_is_aligned(name: str, test_msgs: Path) -> None:
    class_ = load(test_msgs, "test_msgs")[f"test_msgs/msg/{name}"]
    forge_cdr = import_module("forge_cdr")
    value = class_(alignment_check=0x01020304)
    data = forge_cdr.serialize(value)
    assert data.endswith(b"\x04\x03\x02\x01")
    assert len(data) % 4 == 0
    assert forge_cdr.deserialize(data, class_) == value


def test_04_defaults_at_every_border(test_msgs: Path) -> None:
    arrays = load(test_msgs, "test_msgs")["test_msgs/msg/Arrays"]()
    assert arrays.uint64_values_default.tolist() == [0, 1, 2**64 - 1]
    assert arrays.int64_values_default.tolist() == [0, 2**63 - 1, -(2**63)]
    assert arrays.int8_values_default.tolist() == [0, 127, -128]
    assert (arrays.char_values_default.dtype, arrays.char_values_default.tolist()) == ("uint8", [0, 1, 127])
    assert arrays.byte_values_default == [b"\0", b"\1", b"\xff"]


def test_05_five_ways_to_quote_and_a_bound_on_the_text_without_escapes() -> None:
    strings = message(TEST_MSGS["Strings"])
    plain = ["Hello world!", "Hello'world!", 'Hello"world!', "Hello'world!", 'Hello"world!']
    assert [field.default for field in strings.fields] == [None, *plain, None, *plain]
    assert strings.constants[0].value == "Hello world!"
    assert message(r'string<=2 a "\"\""').fields[0].default == '""'


def test_06_fields_named_like_pythons_builtins() -> None:
    names = ["property", "type", "id", "range", "format", "builtins", "self", "value", "len", "str"]
    class_ = made("\n".join(f"int8 {name}" for name in names))
    values = {name: number for number, name in enumerate(names)}
    assert {name: getattr(class_(**values), name) for name in names} == values


def test_07_lists_of_texts() -> None:
    text = r"""
string[<=2] a ["H\"el'lo", 'Wo\'r"ld']
string[4] b ["Hel,lo", ',World', abcd , "!,",]
string<=5[3] c
string<=5[<=10] d
string<=5[] e
""".strip()
    a, b, c, d, e = message(text).fields
    assert a.default == ("H\"el'lo", "Wo'r\"ld")
    assert b.default == ("Hel,lo", ",World", "abcd", "!,")
    assert [c.type, d.type] == [Array(String(bound=5), 3), Sequence(String(bound=5), 10)]
    assert e.type == Sequence(String(bound=5))


def test_08_wide_texts_beyond_ascii() -> None:
    value = made(TEST_MSGS["WStrings"])()
    assert (value.wstring_value_default2, value.wstring_value_default3) == ("Hellö wörld!", "ハローワールド")
    assert not hasattr(value, "WSTRING_CONST")


@pytest.mark.parametrize("name", KNOWN)
def test_09_messages_of_arrays_of_messages_of_arrays(name: str, test_msgs: Path) -> None:
    """These hashes were computed by others; MultiNested contains nearly all of the other messages."""
    found = hashes(resolve("test_msgs", parse_all(read_folder("test_msgs", test_msgs)), Library()))
    assert found[TypeName("test_msgs", "msg", name)] == f"RIHS01_{KNOWN[name]}"


def test_10_one_type_with_and_without_its_package(tree: Tree) -> None:
    part = "Near near\ntour/Near again\nbuiltin_interfaces/Duration far\n"
    folder = tree({"msg/Near.msg": "int8 a", "action/Go.action": f"{part}---\n{part}---\n{part}"})
    go = load(folder, "tour")["tour/action/Go"]
    for section in (go.Goal, go.Result, go.Feedback):
        assert type(section().near) is type(section().again)


def test_11_a_byte_is_bytes_in_python_and_so_are_its_constants() -> None:
    status = load(EMBEDDED / "diagnostic_msgs")["diagnostic_msgs/msg/DiagnosticStatus"]
    assert (status().level, status.OK, status.STALE) == (b"\0", b"\0", b"\3")
    log = load(EMBEDDED / "rcl_interfaces")["rcl_interfaces/msg/Log"]
    assert (log().level, log.DEBUG, log.INFO, log.WARN, log.ERROR, log.FATAL) == (
        0,
        b"\n",
        b"\x14",
        b"\x1e",
        b"(",
        b"2",
    )


def test_12_a_default_without_a_fraction_is_a_float_and_no_part_of_the_hash() -> None:
    pose = load(EMBEDDED / "geometry_msgs")["geometry_msgs/msg/Pose"]()
    assert (type(pose.orientation.w), pose.orientation.w) == (float, 1.0)
    expected = "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa"
    assert hash_of("geometry_msgs/msg/Pose") == expected


def test_13_bounded_sequences_of_messages_and_a_bound_before_a_comment() -> None:
    descriptor = embedded("rcl_interfaces/msg/ParameterDescriptor")
    types = [field.type for field in descriptor.fields]
    assert Sequence(Named(TypeName("rcl_interfaces", "msg", "FloatingPointRange")), 1) in types
    (field,) = message("float64[<=3] dimensions  # At no point more").fields
    assert (field.type, field.doc) == (Sequence(Primitive("double"), 3), ("At no point more",))


def test_14_blanks_wherever_people_put_them() -> None:
    text = (
        "int8 NO_FIX =  -1        # none\nuint16   GPS=          1\nstd_msgs/Header  header\nint8   a    5  "
    )
    parsed = message(text)
    assert [(c.name, c.value) for c in parsed.constants] == [("NO_FIX", -1), ("GPS", 1)]
    assert parsed.constants[0].doc == ("none",)
    assert [(field.name, field.default) for field in parsed.fields] == [("header", None), ("a", 5)]


def test_15_comments_that_go_on_further_in_and_their_units() -> None:
    text = "float32 a   # an angle [rad]\n            # that goes on\nuint8 b  # which one [enum]\n"
    a, b = message(text).fields
    assert (a.doc, a.unit) == (("an angle", "that goes on"), "rad")
    assert (b.doc, b.unit) == (("which one",), "enum")


def test_16_brackets_that_are_no_units_are_taken_for_units_as_rosidl_does() -> None:
    (field,) = message("float32 a # a share [0.0-1.0]").fields
    assert (field.doc, field.unit) == (("a share",), "0.0-1.0")
    assert message("# K[0] == 0.0 says that.\n\nint8 a").doc == ("K == 0.0 says that.",)
    assert message("#     [fx  0 cx]\n# K = [ 0 fy cy]\n\nint8 a").doc == ("    [fx  0 cx]", "K = [ 0 fy cy]")


def test_17_lines_of_hashes_and_constants_of_a_response() -> None:
    service = read("##\n## \n#\n# Asks.\n##\nint8 a\n---\nint8 NO=0\nint8 YES=1\nint8 b\n", "srv/A.srv")
    assert isinstance(service, Service)
    assert service.request.doc == ("Asks.",)
    assert (service.request.constants, len(service.response.constants)) == ((), 2)
    assert embedded("action_msgs/srv/CancelGoal").request.constants == ()


def test_18_a_lone_hash_leaves_no_trace_without_comments(forge: Forge, tree: Tree) -> None:
    folder = tree({"share/tour/msg/A.msg": "# a\n#\n# b\n\nB b # c\n", "share/tour/msg/B.msg": "#\nint8 b\n"})
    ran = forge("interface", "show", "--no-comments", "tour/msg/A", env={"AMENT_PREFIX_PATH": str(folder)})
    assert ran.out == "B b\n\tint8 b\n"


def test_19_chars_of_an_event_are_hashed_as_uint8(forge: Forge, tmp_path: Path) -> None:
    assert embedded("service_msgs/msg/ServiceEventInfo").fields[2].type == Array(Primitive("uint8"), 16)
    expected = "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"
    assert hash_of("service_msgs/msg/ServiceEventInfo") == expected
    arguments = ["--package", "service_msgs", "--lang", "json", "--output", str(tmp_path)]
    forge("interface", "generate", *arguments, str(EMBEDDED / "service_msgs"))
    stored = json.loads((tmp_path / "json/service_msgs/msg/ServiceEventInfo.json").read_text())
    fields = stored["type_description_msg"]["type_description"]["fields"]
    assert [f["type"]["type_id"] for f in fields if f["name"] == "client_gid"] == [51]


def test_20_a_sequence_of_bounded_wide_texts_is_refused_for_rosidl_bounds_it() -> None:
    with pytest.raises(InterfaceError, match=r"rosidl reads 'wstring<=4\[\]' as 'wstring<=4\[<=4\]'"):
        read("wstring<=4[] a")
    with pytest.raises(InterfaceError, match="rosidl reads 'sequence<wstring<4>>' as"):
        read("module tour { module msg { struct A { sequence<wstring<4>> a; }; }; };", "msg/A.idl")
    wide = String(wide=True, bound=4)
    fields = message("wstring<=4[2] a\nwstring<=4[<=3] b\nstring<=4[] c").fields
    assert [field.type for field in fields] == [Array(wide, 2), Sequence(wide, 3), Sequence(String(bound=4))]


@pytest.mark.parametrize(
    ("files", "cycle"),
    [
        ({"msg/A.msg": "A[] a"}, "tour/A -> tour/A"),
        ({"msg/A.msg": "B b", "msg/B.msg": "A[2] a"}, "tour/A -> tour/B -> tour/A"),
    ],
)
def test_21_messages_that_contain_each_other_are_an_error(
    tree: Tree, files: dict[str, str], cycle: str
) -> None:
    with pytest.raises(InterfaceError, match=re.escape(f"a message cannot contain itself: {cycle}")):
        load(tree(files), "tour")


def test_22_what_only_idl_can_say_in_a_namespace_of_its_own(forge: Forge, tree: Tree) -> None:
    idl = "module tour {{ module idl {{ struct Only {{ wchar a; sequence<wchar> b; {} c; }}; }}; }};"
    folder = tree({"src/idl/Only.idl": idl.format("long double")})
    arguments = ["--package", "tour", "--output", "out", "src"]
    hashed = forge("interface", "hash", "--package", "tour", "src", cwd=folder)
    assert hashed.out.startswith("tour/idl/Only RIHS01_")
    assert forge("interface", "generate", "--lang", "c", *arguments, cwd=folder).code == 0
    ran = forge("interface", "generate", *arguments, cwd=folder)
    assert ran.code == 2
    assert ran.err.splitlines()[0].endswith("error: Python has no type for the long double 'c'")
    folder = tree({"src/idl/Only.idl": idl.format("double")})
    assert load(folder / "src", "tour")["tour/idl/Only"](a="日", b=["x"]).a == "日"


def test_23_bytes_that_peers_send(test_msgs: Path) -> None:
    """Padding that is not zero, options in the header, a string of length 0, the other byte order."""
    del test_msgs
    forge_cdr = import_module("forge_cdr")
    class_ = made("uint8 a\nstring b\nuint16 c")
    expected = class_(a=1, b="", c=2)
    for text in ("00010000 01ffffff 00000000 0200", "0001dead 01000000 01000000 00ff 0200"):
        assert forge_cdr.deserialize(bytes.fromhex(text), class_) == expected
    assert forge_cdr.deserialize(bytes.fromhex("00000000 01000000 00000000 0002"), class_) == expected


def test_24_a_message_and_a_service_of_one_name(tree: Tree) -> None:
    folder = tree(
        {
            "msg/Empty.msg": "",
            "srv/Empty.srv": "---",
            "msg/AB1.msg": "",
            "srv/Ab1.srv": "Empty e\n---\n",
            "action/Ab1.action": "---\n---\n",
        }
    )
    types = load(folder, "tour")
    assert types["tour/srv/Ab1"].Request().e == types["tour/msg/Empty"]()
    assert types["tour/srv/Empty"].Request is not types["tour/msg/Empty"]


def test_25_names_that_would_share_a_generated_file_are_an_error(tree: Tree) -> None:
    with pytest.raises(InterfaceError, match="'Ab1' and 'AB1' would both be generated into 'ab1'"):
        load(tree({"msg/AB1.msg": "", "msg/Ab1.msg": ""}), "tour")
    folder = tree({"q/msg/FooBar.msg": "", "q/msg/Foobar.msg": ""})
    assert len(load(folder / "q")) == 2


def test_26_files_of_another_package_belong_to_the_one_that_generates(forge: Forge, tree: Tree) -> None:
    root = tree({"share/files/msg/Inner.msg": "int8 a", "share/files/msg/Outer.msg": "Inner inner"})
    files = [word for name in ("Inner", "Outer") for word in ("--file", f"share/files:msg/{name}.msg")]
    ran = forge("interface", "hash", "--package", "test_msgs", *files, cwd=root)
    assert [line.split()[0] for line in ran.out.splitlines()] == [
        "test_msgs/msg/Inner",
        "test_msgs/msg/Outer",
    ]


def test_27_a_package_may_be_large() -> None:
    """Time is measured by tests/bench/generation.py; here, that hundreds are no problem."""
    assert snake_case("Px4ioStatus") == "px4io_status"
    sources = [
        Source("tour", f"msg/M{n}.msg", Path(f"M{n}.msg"), f"M{n - 1} a\n" if n else "") for n in range(400)
    ]
    catalog = resolve("tour", parse_all(sources), Library())
    assert len(hashes(catalog)) == 400


def test_28_the_hidden_member_beside_others_is_a_field() -> None:
    hidden = "uint8 structure_needs_at_least_one_member"
    assert message(hidden).fields == ()
    assert [f.name for f in message(f"{hidden}\nint8 a").fields] == [hidden.split()[1], "a"]
    assert made(f"{hidden}\nint8 a")(structure_needs_at_least_one_member=3, a=1).a == 1


def test_29_float32_takes_what_fits_and_infinity() -> None:
    class_ = made("float32 a")
    assert class_(a=float("inf")).a == float("inf")
    assert class_(a=3.4028234663852886e38).a == 3.4028234663852886e38
    with pytest.raises(AssertionError):
        class_(a=1e39)
    assert message("float32 a 1e39").fields[0].default == 1e39


def test_30_integers_become_floats_in_defaults_and_nowhere_else() -> None:
    class_ = made("float64 a\nfloat64[] b [1, 2]\nfloat64[2] c [1, 2]")
    value = class_()
    assert (value.b.typecode, value.b.tolist(), value.c.tolist()) == ("d", [1.0, 2.0], [1.0, 2.0])
    with pytest.raises(AssertionError):
        value.a = 1
    with pytest.raises(AssertionError):
        value.b = [1]
