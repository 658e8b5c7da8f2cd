"""Serialization in Python: test vectors, unusual input, lazy reading and error messages."""

import copy
import pickle
import re
import sys
import tracemalloc
from array import array
from collections import UserString
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forge.base.files import write_if_changed
from forge.interfaces.loading import load
from forge.interfaces.model import Array, Field, Message, Primitive, Sequence, TypeName
from forge.interfaces.python import target
from forge.interfaces.wire.layout import INLINE_LIMIT
from tests.generated import catalog_of, generate_embedded, importable, probe_catalog

LARGE_TEXT = "\n".join(
    f"string s{number}\nint8 n{number}\nfloat64[] d{number}" for number in range(INLINE_LIMIT // 2)
)
DEFINITIONS = {
    "msg/Seq.msg": "float64[] e\nuint8 b\nfloat64[] f",
    "msg/Inner.msg": "uint8 a\nfloat64 b",
    "msg/Nest.msg": "uint8 p\nInner[2] arr\nInner[<=3] seq\nuint8 q",
    "msg/Strs.msg": "string[] a\nstring[2] b\nbool[] c\nbool[3] d\nuint16 e",
    "msg/Big.msg": "uint8 a\nint64 b\nuint8 c\nint32 d\nuint8 e\nint16 f",
    "msg/Arr.msg": "uint8 a\nfloat64[1] b\nuint8[3] c\nuint32[2] d",
    "msg/Bnd.msg": "string<=10 s\nint32[<=4] v\nuint8 t",
    "msg/Limits.msg": "string<=3[<=2] brief\nwstring<=2 wide\nstring<=3[2] two",
    "msg/EmptyIn.msg": "std_msgs/Empty e\nuint32 x",
    "msg/W.msg": "wstring w\nuint8 t\nwstring[] ws\nwstring[2] wa",
    "msg/BasicTypes.msg": "bool a\nbyte b\nchar c\nfloat32 d\nfloat64 e\nint8 f\nuint8 g\nint16 h\nuint16 i\n"
    "int32 j\nuint32 k\nint64 l\nuint64 m",
    "action/Fibonacci.action": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence",
    "msg/Phases.msg": "string a\nfloat64 b\nuint8[] c\nint16 d\nint64[] e\nbool f\nfloat64[2] g\nstring h\n"
    "uint32 i",
    "msg/Bulk.msg": "string a\nint64[100] b\nint8 c\nfloat64[100] d\nbool[600] e\nbyte[600] f",
    "msg/Octets.msg": "byte one\nbyte[] many\nbyte[2] two",
    "msg/Large.msg": LARGE_TEXT,
    "msg/Around.msg": "int8 a\nLarge[] many\nLarge[2] two\nLarge one\nfloat64 b",
    "msg/First.msg": "Large one\nint8 a",
    "msg/FirstLoop.msg": "string[2] texts\nfloat64 a",
    "msg/FirstBulk.msg": "float64[100] a\nint8 b",
    "msg/Hollow.msg": "std_msgs/Empty[] many\nstd_msgs/Empty[3] three\nstd_msgs/Empty one",
    "msg/Tree.msg": "Nest[] nests\nStrs[2] strs\nSeq[] seqs\nInner[] inners\nTail[] tails\nint64 end",
    "msg/Tail.msg": "float64 a\nuint8 b",
    "msg/Words.msg": "int8 buffer\nint8[] view\nint8 size\nint8 limit\nint8 o\nstring nul\nInner structs\n"
    "int8 parts\nint8 append\nint8 message\nint8 read\nint8 write\nint8 len\nint8 encapsulation\n"
    "Inner[] inner\nInner[] s\nInner[] texts\nint8 unpack\nint8 pack\nint8[] end\nstring piece\n"
    "float64[] padding",
}
CHAR, WCHAR = Primitive("char"), Primitive("wchar")
CHARACTERS = Message(
    TypeName("vectors", "msg", "Characters"),
    (
        Field("one", CHAR),
        Field("wide", WCHAR),
        Field("two", Array(CHAR, 2)),
        Field("pair", Array(WCHAR, 2)),
        Field("many", Sequence(CHAR)),
        Field("much", Sequence(WCHAR)),
        Field("end", Primitive("octet")),
    ),
)
"""Types that only IDL has."""
STAMPED = "01000000 02000000 04000000 6d617000"
VECTORS: dict[str, tuple[str, dict[str, Any], str]] = {
    "1": ("std_msgs/String", {"data": "hello"}, "06000000 68656c6c6f00"),
    "2": ("std_msgs/String", {"data": ""}, "01000000 00"),
    "3": ("std_msgs/String", {"data": "é"}, "03000000 c3a900"),
    "4": ("std_msgs/Empty", {}, "00"),
    "5": ("std_msgs/Bool", {"data": True}, "01"),
    "6": ("std_msgs/Float64", {"data": 1.5}, "000000000000f83f"),
    "7": ("std_msgs/Header", {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "map"}, STAMPED),
    "8": (
        "geometry_msgs/PointStamped",
        {
            "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "map"},
            "point": {"x": 1.0, "y": 2.0, "z": 3.0},
        },
        f"{STAMPED} 000000000000f03f 0000000000000040 0000000000000840",
    ),
    "9": ("std_msgs/UInt8MultiArray", {"data": [1, 2, 3]}, "00000000 00000000 03000000 010203"),
    "10": (
        "sensor_msgs/JointState",
        {"name": ["a", "bc"], "position": [0.5, -0.5]},
        (
            "00000000 00000000 01000000 00 000000 02000000 02000000 6100 0000 03000000 626300 00 02000000"
            "000000000000e03f 000000000000e0bf 00000000 00000000"
        ),
    ),
    "11": (
        "sensor_msgs/Image",
        {
            "header": {"frame_id": "c"},
            "height": 1,
            "width": 2,
            "encoding": "mono8",
            "step": 2,
            "data": [7, 8],
        },
        (
            "00000000 00000000 02000000 6300 0000 01000000 02000000 06000000 6d6f6e6f3800 00 00 02000000"
            "02000000 0708"
        ),
    ),
    "12": (
        "vectors/BasicTypes",
        dict(
            zip("abcdefghijklm", (True, b"\x7f", 65, 1.125, 1.125, -1, 2, -3, 4, -5, 6, -7, 8), strict=True)
        ),
        (
            "01 7f 41 00 0000903f 000000000000f23f ff 02 fdff 0400 0000 fbffffff 06000000 f9ffffffffffffff"
            "0800000000000000"
        ),
    ),
    "13": ("vectors/Seq", {"b": 2, "f": [1.0]}, "00000000 02 000000 01000000 00000000 000000000000f03f"),
    "14": (
        "vectors/Nest",
        {"p": 1, "arr": [{"a": 2, "b": 1.0}, {"a": 3, "b": 2.0}], "seq": [{"a": 4, "b": 3.0}], "q": 5},
        (
            "01 02 000000000000 000000000000f03f 03 00000000000000 0000000000000040 01000000 04 000000"
            "0000000000000840 05"
        ),
    ),
    "15": (
        "vectors/Nest",
        {"p": 1, "arr": [{"a": 2, "b": 1.0}, {"a": 3, "b": 2.0}], "q": 5},
        "01 02 000000000000 000000000000f03f 03 00000000000000 0000000000000040 00000000 05",
    ),
    "16": (
        "vectors/Strs",
        {"a": ["x", ""], "b": ["", "yz"], "c": [True, False], "d": [True, False, True], "e": 258},
        (
            "02000000 02000000 7800 0000 01000000 00 000000 01000000 00 000000 03000000 797a00 00 02000000"
            "0100 010001 00 0201"
        ),
    ),
    "17": (
        "vectors/Big",
        dict(zip("abcdef", range(1, 7), strict=True)),
        "01 00000000000000 0200000000000000 03 000000 04000000 05 00 0600",
    ),
    "18": (
        "vectors/Arr",
        {"a": 1, "b": [1.0], "c": [2, 3, 4], "d": [5, 6]},
        "01 00000000000000 000000000000f03f 020304 00 05000000 06000000",
    ),
    "19": ("vectors/Bnd", {"s": "ab", "v": [-1], "t": 9}, "03000000 616200 00 01000000 ffffffff 09"),
    "20": ("vectors/EmptyIn", {"x": 1}, "00 000000 01000000"),
    "21": (
        "example_interfaces/srv/AddTwoInts_Request",
        {"a": 1, "b": 2},
        "0100000000000000 0200000000000000",
    ),
    "22": (
        "vectors/action/Fibonacci_SendGoal_Request",
        {"goal_id": {"uuid": list(range(16))}, "goal": {"order": 5}},
        "000102030405060708090a0b0c0d0e0f 05000000",
    ),
    "23": (
        "vectors/action/Fibonacci_FeedbackMessage",
        {"goal_id": {"uuid": list(range(16))}, "feedback": {"sequence": [0, 1, 1]}},
        "000102030405060708090a0b0c0d0e0f 03000000 00000000 01000000 01000000",
    ),
    "idl": (
        "vectors/Characters",
        {"one": "a", "wide": "é", "two": ["b", "c"], "pair": ["日", "d"], "many": ["e"], "much": ["f"]},
        "61 000000 e9000000 62 63 0000 e5650000 64000000 01000000 65 000000 01000000 66000000 00",
    ),
    "W1": ("example_interfaces/WString", {"data": "hé"}, "02000000 68000000 e9000000"),
    "W2": ("example_interfaces/WString", {"data": ""}, "00000000"),
    "W3": ("example_interfaces/WString", {"data": "\U0001f600"}, "02000000 3dd80000 00de0000"),
    "W4": (
        "vectors/W",
        {"w": "a", "t": 7, "ws": ["b"], "wa": ["", "c"]},
        "01000000 61000000 07 000000 01000000 01000000 62000000 00000000 01000000 63000000",
    ),
}
"""Type, values and bytes after the header, by number in the specification."""


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate the embedded packages and two more, and make them importable."""
    made = tmp_path_factory.mktemp("python")
    generate_embedded(made)
    for catalog in (catalog_of("vectors", DEFINITIONS, CHARACTERS), probe_catalog()):
        for file in target.files(catalog):
            write_if_changed(made / file.path, file.text)
    with importable(made):
        yield made


@pytest.fixture
def cdr() -> Any:
    return import_module("forge_cdr")


def class_of(name: str) -> Any:
    """Return the class of 'pkg/X', 'pkg/srv/X_Request' or a part of an action."""
    package, *kinds, stem = name.split("/")
    kind = kinds[0] if kinds else "msg"
    main, _, part = stem.partition("_")
    class_ = getattr(import_module(f"{package}.{kind}"), main)
    return getattr(sys.modules[class_.__module__], stem) if part else class_


def make(name: str, values: dict[str, Any]) -> Any:
    """Return a message with these values; nested messages are dicts."""
    set_fields = import_module("rosidl_runtime_py").set_message_fields
    message = class_of(name)()
    set_fields(message, values)
    return message


def body(text: str) -> bytes:
    """Return a little-endian message with its header."""
    return bytes.fromhex(f"00010000 {text}")


def fast(word: str, class_: Any) -> Any:
    """Return the generated reader or writer of a class, without the generic codec as a fallback."""
    return getattr(import_module(f"{class_.__module__}__cdr"), f"{word}_{class_.__name__}")()


@pytest.mark.parametrize("number", VECTORS)
def test_reference_vectors_are_written_and_read(cdr: Any, number: str) -> None:
    name, values, text = VECTORS[number]
    message, data = make(name, values), body(text)
    assert cdr.serialize(message) == data
    assert fast("writer", type(message))(message) == data
    assert cdr.deserialize(data, type(message)) == message
    assert fast("reader", type(message))(data, sys.maxsize) == message
    described: Any = import_module("forge_cdr.described")  # the generic codec
    assert described.write(message) == data
    assert described.read(data, type(message)) == message


BIG_ENDIAN = {
    "std_msgs/Header": "00000001 00000002 00000004 6d617000",
    "vectors/Seq": "00000000 02 000000 00000001 00000000 3ff0000000000000",
    "vectors/Arr": "01 00000000000000 3ff0000000000000 020304 00 00000005 00000006",
    "vectors/Bnd": "00000003 616200 00 00000001 ffffffff 09",
    "vectors/W": "00000001 00000061 07 000000 00000001 00000001 00000062 00000000 00000001 00000063",
}


@pytest.mark.parametrize("name", BIG_ENDIAN)
def test_big_endian_data_is_converted_to_native_types(cdr: Any, name: str) -> None:
    values = next(values for type_, values, _ in VECTORS.values() if type_ == name)
    read = cdr.deserialize(bytes.fromhex(f"00000000 {BIG_ENDIAN[name]}"), class_of(name))
    assert read == make(name, values)
    if name == "vectors/Arr":
        assert read.d.dtype == np.dtype("uint32")
        assert read.d.dtype.isnative


@pytest.mark.parametrize(
    ("name", "data", "value"),
    [
        *(
            ("std_msgs/String", f"{options} 02000000 7800", "x")
            for options in ("00010003", "000100ff", "0001ff00")
        ),
        ("std_msgs/Bool", "00010000 01 000000", True),
        ("std_msgs/Bool", "00010000 02", True),
    ],
)
def test_header_options_trailing_bytes_and_nonzero_booleans_are_accepted(
    cdr: Any, name: str, data: str, value: object
) -> None:
    assert cdr.deserialize(bytes.fromhex(data), class_of(name)).data == value


def test_padding_is_ignored(cdr: Any) -> None:
    data = body("01 ffffffffffffff 0200000000000000 03 ffffff 04000000 05 ff 0600")
    assert cdr.deserialize(data, class_of("vectors/Big")) == make(*VECTORS["17"][:2])


@pytest.mark.parametrize(
    ("text", "value"),
    [("00000000", ""), ("02000000 6869", "hi"), ("01000000 69", "i"), ("03000000 690000", "i\0")],
)
def test_strings_without_nul_are_accepted(cdr: Any, text: str, value: str) -> None:
    class_ = class_of("std_msgs/String")
    assert cdr.deserialize(body(text), class_).data == value
    assert fast("reader", class_)(body(text), sys.maxsize).data == value
    words = cdr.deserialize(body(f"01000000 {text}") + bytes(100), class_of("vectors/Strs"))
    assert words.a == [value]


def test_embedded_nul_characters_are_kept(cdr: Any) -> None:
    message = make("std_msgs/String", {"data": "a\0b"})
    assert cdr.deserialize(cdr.serialize(message), type(message)) == message


@pytest.mark.parametrize("kind", [bytearray, memoryview, lambda data: memoryview(bytearray(data))])
def test_any_buffer_can_be_read(cdr: Any, kind: Any) -> None:
    for name, values, text in VECTORS.values():
        message = make(name, values)
        assert cdr.deserialize(kind(body(text)), type(message)) == message
        assert fast("reader", type(message))(memoryview(body(text)), sys.maxsize) == message


def test_messages_do_not_alias_the_buffer(cdr: Any) -> None:
    data = bytearray(cdr.serialize(make("vectors/Arr", {"a": 1, "b": [1.0], "c": [2, 3, 4], "d": [5, 6]})))
    read = cdr.deserialize(data, class_of("vectors/Arr"))
    data[4:] = bytes(len(data) - 4)
    read.d[0] = 9
    assert (read.d.tolist(), read.c.tolist(), read.b.tolist()) == ([9, 6], [2, 3, 4], [1.0])
    image = cdr.deserialize(body(VECTORS["11"][2]), class_of("sensor_msgs/Image"))
    image.data.append(9)
    assert image.data.tolist() == [7, 8, 9]


# Unusual values of fields


def test_every_accepted_value_can_be_written(cdr: Any) -> None:
    octets = class_of("vectors/Octets")(one=bytearray(b"\1"), many={b"\2"}, two=(b"\3", b"\4"))
    assert cdr.serialize(octets) == body("01 000000 01000000 02 03 04")
    bounded = class_of("vectors/Bnd")(s=UserString("ab"))
    assert cdr.serialize(bounded) == body("03000000 616200 00 00000000 00")
    limits = class_of("vectors/Limits")(brief=["ééé"], wide="😀😀", two=["abc", ""])
    assert cdr.deserialize(cdr.serialize(limits), type(limits)) == limits
    strings = class_of("vectors/Strs")(a=("x",), c={True})
    assert cdr.deserialize(cdr.serialize(strings), type(strings)).a == ["x"]
    matrix = class_of("vectors/Arr")(d=np.array([[5], [6]], "uint32").ravel())
    matrix.d = np.array([[5], [6]], "uint32")
    assert cdr.deserialize(cdr.serialize(matrix), type(matrix)).d.tolist() == [5, 6]


def test_strided_arrays_are_written_contiguously(cdr: Any) -> None:
    for name, size in (("vectors/Arr", 2), ("vectors/Bulk", 100)):
        message = class_of(name)()
        slot = "d"
        values = np.arange(2 * size, dtype=getattr(message, slot).dtype)[::2]
        setattr(message, slot, values)
        assert (
            getattr(cdr.deserialize(cdr.serialize(message), type(message)), slot).tolist() == values.tolist()
        )


def test_unchecked_values_are_serialized_if_possible(cdr: Any) -> None:
    message = class_of("vectors/Arr")()
    message._d, message._b = [5, 6], (1,)
    assert cdr.serialize(message) == body("00 00000000000000 000000000000f03f 000000 00 05000000 06000000")


def test_subclasses_of_messages_are_supported(cdr: Any) -> None:
    class Mine(class_of("std_msgs/String")):  # type: ignore[misc]
        __slots__ = ()

    assert cdr.serialize(Mine(data="x")) == body("02000000 7800")
    read = cdr.deserialize(body("02000000 7800"), Mine)
    assert (type(read), read.data) == (Mine, "x")


def test_classes_without_generated_serializers_use_their_description(cdr: Any, folder: Path) -> None:
    definition: Any = import_module("rosidl_parser.definition")

    class Foreign:
        """A class like rosidl's, with the slot that later releases have."""

        __slots__ = ("_name", "_numbers", "_check_fields")  # noqa: RUF023  (the order of the types)
        SLOT_TYPES = (definition.UnboundedString(), definition.Array(definition.BasicType("int16"), 2))

    assert folder.is_dir()
    read = cdr.deserialize(body("02000000 7800 0100 0200"), Foreign)
    assert (read._name, read._numbers.tolist()) == ("x", [1, 2])
    assert cdr.serialize(read) == body("02000000 7800 0100 0200")


def test_classes_loaded_at_run_time_are_serialized(cdr: Any) -> None:
    text = f"""Around[] many
===
MSG: mine/Around
Large large
std_msgs/Header header
===
MSG: mine/Large
{LARGE_TEXT}
===
MSG: std_msgs/Header
string only
""".replace("===", 80 * "=")
    types = load(text, "mine/msg/Top")
    around = types["mine/msg/Around"](header=types["std_msgs/msg/Header"](only="here"))
    message = types["mine/msg/Top"](many=[around, around])
    data = cdr.serialize(message)
    assert fast("writer", type(message))(message) == data
    assert cdr.deserialize(data, type(message)) == message
    described: Any = import_module("forge_cdr.described")
    assert described.read(data, type(message)) == message
    assert described.write(message) == data


def test_a_service_is_not_a_message(cdr: Any) -> None:
    for wrong in (class_of("example_interfaces/srv/AddTwoInts"), int):
        with pytest.raises(TypeError, match="is not a message class"):
            cdr.deserialize(body("00"), wrong)
    with pytest.raises(TypeError, match="'int' is not a message class"):
        cdr.serialize(1)


# Values and bytes that are rejected


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("vectors/Bnd", {"v": array("i", range(5))}, "'v' has 5 elements, 4 are allowed, at offset 9"),
        ("vectors/Bnd", {"s": "é" * 11}, "'s' has 11 characters, 10 are allowed, at offset 4"),
        ("vectors/Limits", {"brief": ["abcd"]}, "'brief[0]' has 4 characters, 3 are allowed, at offset 8"),
        ("vectors/Limits", {"wide": "abc"}, "'wide' has 3 characters, 2 are allowed, at offset 8"),
        ("vectors/Nest", {"arr": []}, "'arr' has 0 elements, not 2, at offset 5"),
        ("vectors/Arr", {"d": np.zeros(3, "uint32")}, "'d' has 3 elements, not 2, at offset 23"),
        ("vectors/Bulk", {"b": np.zeros(3, "int64")}, "'b' has 3 elements, not 100, at offset 9"),
        ("vectors/Octets", {"many": [b"", b"ab"]}, "'many[0]' does not fit: "),
        ("vectors/Octets", {"two": [b"", b"ab"]}, "'two[0]' does not fit: "),
        ("vectors/Big", {"b": 2**63}, "'b' does not fit: "),
        ("vectors/Strs", {"d": [True]}, "'d' has 1 elements, not 3"),
        ("vectors/Strs", {"b": ["a", 1]}, "'b[1]' is of type 'int', not 'str'"),
        ("std_msgs/String", {"data": "\ud800"}, "'data' does not fit: 'utf-8' codec can't encode"),
        (
            "example_interfaces/WString",
            {"data": "\ud800"},
            "'data' does not fit: 'utf-16-le' codec can't encode",
        ),
        (
            "geometry_msgs/PoseStamped",
            {"header": None},
            "'header' is of type 'NoneType', not 'Header', at offset 4",
        ),
        ("geometry_msgs/PoseArray", {"poses": [1]}, "'poses[0]' is of type 'int', not 'Pose', at offset 24"),
    ],
)
def test_values_that_cannot_be_written_are_reported(
    cdr: Any, name: str, changes: dict[str, Any], words: str
) -> None:
    message = class_of(name)()
    for field, value in changes.items():
        setattr(message, f"_{field}", value)
    with pytest.raises(cdr.CdrError, match=f"^{re.escape(words)}") as caught:
        cdr.serialize(message)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("std_msgs/Bool", "", "0 bytes are too few for a header of 4, at offset 0"),
        ("std_msgs/Bool", "000100", "3 bytes are too few for a header of 4, at offset 0"),
        (
            "std_msgs/Bool",
            "00070000 01",
            "the header '0007' is not that of classic CDR, '0000' or '0001', at offset 0",
        ),
        ("std_msgs/Bool", "00010000", "'data' needs 1 bytes, 0 are left, at offset 4"),
        ("std_msgs/Empty", "00010000", "the message needs 1 bytes, 0 are left, at offset 4"),
        ("std_msgs/String", "00010000 05000000 6100", "'data' needs 5 bytes, 2 are left, at offset 8"),
        (
            "std_msgs/String",
            "00010000 02000000 ff00",
            (
                "'data' does not fit: 'utf-8' codec can't decode byte 0xff in position 0: "
                "invalid start byte, at offset 10"
            ),
        ),
        (
            "vectors/Bnd",
            "00010000 01000000 00 000000 05000000" + 60 * "0",
            "'v' has 5 elements, 4 are allowed, at offset 16",
        ),
        (
            "vectors/Bnd",
            "00010000 0b000000" + 11 * "61" + "00 00000000 00",
            "'s' has 11 characters, 10 are allowed, at offset 19",
        ),
        (
            "vectors/Limits",
            "00010000 00000000 03000000" + 3 * "61000000",
            "'wide' has 3 characters, 2 are allowed, at offset 24",
        ),
        (
            "vectors/Seq",
            "00010000 ffffff7f",
            "'e' has 2147483647 elements, more than the 0 bytes that are left, at offset 8",
        ),
        ("vectors/Seq", "00010000 01000000 00000000", "'e' needs 8 bytes, 0 are left, at offset 12"),
        (
            "vectors/Strs",
            "00010000 02000000 02000000 6100 0000 09000000 61",
            "'a[1]' needs 9 bytes, 1 are left, at offset 20",
        ),
        ("vectors/W", "00010000 01000000 00000100", "'w' does not fit: "),
        ("vectors/W", "00010000 01000000 00d80000", "'w' does not fit: "),
    ],
)
def test_invalid_bytes_have_specific_errors(cdr: Any, name: str, data: str, words: str) -> None:
    with pytest.raises(cdr.CdrError, match=f"^{re.escape(words)}"):
        cdr.deserialize(bytes.fromhex(data), class_of(name))


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("one", "\x80", "'one' is the character 128, the highest is 127"),
        ("wide", "\U00010000", "'wide' is the character 65536, the highest is 65535"),
        ("two", ["a", "\x80"], "'two[1]' is the character 128, the highest is 127"),
        ("much", ["\U00010000"], "'much[0]' is the character 65536, the highest is 65535"),
    ],
)
def test_unencodable_characters_are_rejected(cdr: Any, field: str, value: Any, words: str) -> None:
    message = class_of("vectors/Characters")()
    setattr(message, f"_{field}", value)
    with pytest.raises(cdr.CdrError, match=re.escape(words)):
        cdr.serialize(message)


@pytest.mark.parametrize(
    ("position", "words"),
    [
        (4, "'one' is the character 255"),
        (10, "'wide' is the character 16711777"),
        (13, "'two[1]' is the char"),
    ],
)
def test_invalid_code_points_are_rejected(cdr: Any, position: int, words: str) -> None:
    data = bytearray(cdr.serialize(class_of("vectors/Characters")(wide="a")))
    data[position] = 255
    with pytest.raises(cdr.CdrError, match=re.escape(words)):
        cdr.deserialize(data, class_of("vectors/Characters"))


def test_errors_have_an_offset_and_can_be_pickled(cdr: Any) -> None:
    with pytest.raises(cdr.CdrError) as caught:
        cdr.deserialize(body("05000000 6100"), class_of("std_msgs/String"))
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.offset, again.problem, str(again)) == (8, caught.value.problem, str(caught.value))


@pytest.mark.parametrize("count", ["ffffffff", "ffffff7f", "00000010"])
@pytest.mark.parametrize(
    "name", ["vectors/Seq", "vectors/Strs", "std_msgs/String", "vectors/W", "vectors/Tree", "vectors/Hollow"]
)
def test_an_invalid_length_allocates_no_memory(cdr: Any, name: str, count: str) -> None:
    data, class_ = body(count) + bytes(64), class_of(name)
    for _ in range(2):  # the first time loads modules
        tracemalloc.start()
        with pytest.raises(cdr.CdrError):
            cdr.deserialize(data, class_)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 100_000


# Lazy reading


@pytest.fixture
def image(cdr: Any) -> Any:
    """Return an image of 10,000 bytes that have not been copied."""
    whole = make("sensor_msgs/Image", {"header": {"frame_id": "c"}, "data": [1, 2, 3, 4] * 2500})
    return cdr.deserialize(cdr.serialize(whole), type(whole), copy=False)


def test_a_large_sequence_is_copied_on_first_access(image: Any) -> None:
    class_ = class_of("sensor_msgs/Image")
    assert type(image) is not class_
    assert image.__class__ is class_
    assert isinstance(image, class_)
    assert image.header.frame_id == "c"
    assert type(image) is not class_
    assert image.data == array("B", [1, 2, 3, 4] * 2500)
    assert image.data is image.data
    assert type(image) is class_


def test_lazy_messages_behave_like_eager_ones(cdr: Any, image: Any) -> None:
    whole = make("sensor_msgs/Image", {"header": {"frame_id": "c"}, "data": [1, 2, 3, 4] * 2500})
    data = cdr.serialize(whole)

    def fresh() -> Any:
        return cdr.deserialize(data, type(whole), copy=False)

    assert image == whole
    assert whole == fresh()
    assert repr(fresh()) == repr(whole)
    assert cdr.serialize(fresh()) == data
    assert fresh().__slots__ == whole.__slots__
    assert fresh().get_fields_and_field_types() == whole.get_fields_and_field_types()
    for copied in (copy.copy(fresh()), copy.deepcopy(fresh()), pickle.loads(pickle.dumps(fresh()))):
        assert type(copied) is type(whole)
        assert copied == whole


def test_lazy_fields_are_read_independently(cdr: Any) -> None:
    scan = class_of("sensor_msgs/LaserScan")(ranges=[1.0] * 2000, intensities=[2.0] * 3000)
    read = cdr.deserialize(cdr.serialize(scan), type(scan), copy=False)
    assert read.ranges == scan.ranges
    assert type(read) is not type(scan)
    assert read.intensities == scan.intensities
    assert type(read) is type(scan)


def test_nested_lazy_messages_are_created_on_access(cdr: Any) -> None:
    image = make("sensor_msgs/Image", {"data": [1] * 5000})
    around = class_of("stereo_msgs/DisparityImage")(image=image)
    read = cdr.deserialize(cdr.serialize(around), type(around), copy=False)
    assert type(read) is type(around)
    assert type(read.image) is not type(image)
    assert read == around


def test_a_lazy_field_references_the_buffer_until_accessed(cdr: Any, image: Any) -> None:
    view = cdr.view(image, "data")
    assert view.readonly
    assert view[:4].tolist() == [1, 2, 3, 4]
    assert type(image) is not class_of("sensor_msgs/Image")
    image.data[0] = 9
    assert cdr.view(image, "data")[0] == 9
    assert view[0] == 1
    with pytest.raises(AttributeError):
        cdr.view(image, "nothing")
    with pytest.raises(TypeError):
        cdr.view(image, "height")


def test_only_immutable_buffers_are_read_lazily(cdr: Any) -> None:
    data = body(VECTORS["11"][2])
    class_ = class_of("sensor_msgs/Image")
    for kind in (bytearray, lambda text: memoryview(bytearray(text))):
        with pytest.raises(TypeError, match="copy=False needs data that cannot change"):
            cdr.deserialize(kind(data), class_, copy=False)
    assert cdr.deserialize(memoryview(data), class_, copy=False).data == array("B", [7, 8])
