"""Generated Python is imported and used: interface spec 4, fact by fact."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from array import array
from collections import UserList, UserString
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces import python
from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    Text,
    TypeName,
)
from tests.conftest import GOLDEN, Golden
from tests.generated import RUNTIME, catalog_of, generate, importable

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

INTEGERS = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
CODES = dict(zip(INTEGERS, "bhiqBHIQ", strict=True)) | {"float32": "f", "float64": "d"}

DEFINITIONS = {
    "msg/Scalars.msg": "\n".join(
        ["bool flag", "byte octet", "char letter", "string text", "wstring wide", "string<=3 brief"]
        + ["float32 single", "float64 exact", *(f"{name} a_{name}" for name in INTEGERS)]
    ),
    "msg/Fixed.msg": "\n".join(
        [*(f"{name}[3] a_{name}" for name in CODES), "bool[2] flags", "byte[2] bytes", "string[2] texts"]
        + ["string<=3[2] shorts", "Point[2] points"]
    ),
    "msg/Loose.msg": "\n".join(
        [*(f"{name}[] a_{name}" for name in CODES), "bool[] flags", "byte[] bytes", "string[] texts"]
        + ["string<=3[] shorts", "Point[] points"]
    ),
    "msg/Bound.msg": "int32[<=3] numbers\nstring[<=3] texts\nstring<=3[<=2] shorts\nPoint[<=2] points",
    "msg/Point.msg": "float64 x\nfloat64 y",
    "msg/Nested.msg": "std_msgs/Header header\nPoint point",
    "msg/Nothing.msg": "",
    "msg/Constants.msg": (
        "bool YES=true\nbyte RAW=10\nchar LETTER=65\nint8 LOW=-128\nuint64 HIGH=18446744073709551615\n"
        "float32 PI=3.5\nfloat64 NAN=nan\nfloat64 INF=inf\nstring WORD='it''s'\nwstring WIDE=\"日本\"\n"
        "uint8 level"
    ).replace("''", "\\'"),
    "msg/Defaults.msg": (
        "bool flag true\nbyte raw 255\nint64 low -9223372036854775808\nuint64 high 18446744073709551615\n"
        'float64 whole 0\nfloat64 nothing nan\nfloat32 endless -inf\nstring text "it\'s"\n'
        'wstring wide "Hellö"\nstring<=5 brief \'a"b\'\nint32[] none []\nint32[] some [1, 2]\n'
        "float64[2] pair [1, 2]\nbool[2] flags [true, false]\nbyte[2] bytes [0, 255]\n"
        "string[<=3] texts ['a', \"b\"]\nuint8[] letters [0, 1, 127]"
    ),
    "msg/Property.msg": "string property\nint8 after\nint8 builtins\nint8 last",
    "msg/Words.msg": (
        "int8 type\nint8 id\nint8 range\nint8 format\nint8 self\nint8 value\nint8 len\n"
        "string str\nbyte bytes\nint8[] array\nint8[3] numpy\nPoint[2] messages\nint8 checks\nint8 unknown"
    ),
    "msg/Hidden.msg": "uint8 structure_needs_at_least_one_member\nint8 other",
    "msg/Act.msg": "int8 mine",
    "srv/Point.srv": "int8 LIMIT=3\nint64 a 5\n---\nstring why\nint64[] all",
    "action/Act.action": "Act goal_of_same_name\ngeometry_msgs/Point theirs\nPoint ours\n---\nint8 done\n---\nfloat32 part",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate all definitions once; they can be imported while this module's tests run."""
    folder = tmp_path_factory.mktemp("python")
    generate(folder, catalog_of("probe", DEFINITIONS))
    with importable(folder):
        yield folder


@pytest.fixture
def msg(folder: Path) -> Any:  # noqa: ANN401  (a generated module)
    """The module probe.msg."""
    assert folder.is_dir()
    return import_module("probe.msg")


def refused(words: str) -> pytest.RaisesExc[AssertionError]:
    """Expect the assertion with exactly these words."""
    return pytest.raises(AssertionError, match=f"^{_escaped(words)}$")


def _escaped(words: str) -> str:
    import re

    return re.escape(words)


# Layout and names (4.1)


def test_a_package_has_a_module_for_each_file_and_one_for_each_kind() -> None:
    catalog = catalog_of("probe", {"msg/UInt8.msg": "", "srv/DoIt.srv": "---", "msg/Vec3D.msg": ""})
    assert sorted(file.path for file in python.files(catalog)) == [
        "probe/__init__.py",
        "probe/msg/__init__.py",
        "probe/msg/_u_int8.py",
        "probe/msg/_vec3_d.py",
        "probe/py.typed",
        "probe/srv/__init__.py",
        "probe/srv/_do_it.py",
    ]


def test_generating_twice_gives_the_same_files() -> None:
    catalog = catalog_of("probe", DEFINITIONS)
    assert list(python.files(catalog)) == list(python.files(catalog))


def test_only_the_main_name_is_exported(folder: Path) -> None:
    assert folder.is_dir()
    srv = import_module("probe.srv")
    assert srv.__all__ == ["Point"]
    with pytest.raises(AttributeError, match="'probe.srv' has no attribute 'Point_Request'"):
        _ = srv.Point_Request


def test_classes_live_in_the_module_of_their_file(msg: Any) -> None:
    assert msg.Scalars.__module__ == "probe.msg._scalars"
    assert import_module("probe.srv").Point.Request.__module__ == "probe.srv._point"


def test_a_namespace_lists_its_classes_and_gives_them_to_a_star_import(msg: Any) -> None:
    assert {
        path.removeprefix("msg/").removesuffix(".msg") for path in DEFINITIONS if path.startswith("msg/")
    } <= set(dir(msg))
    names: dict[str, Any] = {}
    exec("from probe.msg import *", names)
    assert names["Point"] is msg.Point
    assert set(msg.__all__) == {name for name in names if not name.startswith("_")}


def test_importing_a_namespace_loads_no_message(folder: Path) -> None:
    code = "import probe.msg, sys; print([name for name in sys.modules if name.startswith('probe.msg.')])"
    assert _python(folder, code) == "[]"


def test_a_module_without_fixed_arrays_needs_no_numpy(folder: Path) -> None:
    code = "from probe.msg import Loose; import sys; Loose(a_int8=[1]); print('numpy' in sys.modules)"
    assert _python(folder, code) == "False"


# The class (4.2)


def test_constants_can_be_read_on_class_and_instance(msg: Any) -> None:
    for owner in (msg.Constants, msg.Constants()):
        assert (owner.YES, owner.RAW, owner.LETTER, owner.LOW) == (True, b"\n", 65, -128)
        assert (18446744073709551615, 3.5, math.inf) == (owner.HIGH, owner.PI, owner.INF)
        assert math.isnan(owner.NAN)
        assert (owner.WORD, owner.WIDE) == ("it's", "日本")


def test_constants_cannot_be_changed(msg: Any) -> None:
    for owner in (msg.Constants, msg.Constants()):
        with pytest.raises(AttributeError, match="LOW"):
            owner.LOW = 1
        with pytest.raises(AttributeError, match="LOW"):
            del owner.LOW
    assert msg.Constants.LOW == -128


def test_a_class_stays_open_for_other_attributes(msg: Any) -> None:
    msg.Hidden.note = "mine"
    msg.Hidden.note = "still mine"
    del msg.Hidden.note
    assert not hasattr(msg.Hidden, "note")


def test_defaults_can_be_read_but_not_changed(msg: Any) -> None:
    assert msg.Defaults.WHOLE__DEFAULT == 0.0
    assert array("i", [1, 2]) == msg.Defaults().SOME__DEFAULT
    for name in ("WHOLE__DEFAULT", "SOME__DEFAULT"):
        with pytest.raises(AttributeError, match=name):
            setattr(msg.Defaults, name, None)
        with pytest.raises(AttributeError, match=name):
            setattr(msg.Defaults(), name, None)
    assert not hasattr(msg.Point, "X__DEFAULT")


@pytest.mark.parametrize("name", ["SOME__DEFAULT", "PAIR__DEFAULT", "FLAGS__DEFAULT"])
def test_a_default_read_on_the_class_is_fresh_and_shared_on_instances(msg: Any, name: str) -> None:
    assert getattr(msg.Defaults, name) is not getattr(msg.Defaults, name)
    assert getattr(msg.Defaults(), name) is getattr(msg.Defaults(), name)


def test_slots_stand_in_the_order_of_the_fields_and_nothing_else_can_be_set(msg: Any) -> None:
    assert msg.Nested.__slots__ == ["_header", "_point"]
    with pytest.raises(AttributeError):
        msg.Nested().other = 1
    assert not hasattr(msg.Nested(), "__dict__")


def test_field_types_are_spelled_as_rosidl_does(msg: Any) -> None:
    assert msg.Nested.get_fields_and_field_types() == {"header": "std_msgs/Header", "point": "probe/Point"}
    types = {
        **msg.Scalars.get_fields_and_field_types(),
        **msg.Fixed.get_fields_and_field_types(),
        **msg.Bound.get_fields_and_field_types(),
    }
    assert types["flag"] == "boolean"
    assert (types["octet"], types["letter"], types["wide"], types["brief"]) == (
        "octet",
        "uint8",
        "wstring",
        "string<3>",
    )
    assert (types["single"], types["exact"]) == ("float", "double")
    assert (types["a_int8"], types["bytes"]) == ("int8[3]", "octet[2]")
    assert (types["numbers"], types["shorts"]) == ("sequence<int32, 3>", "sequence<string<3>, 2>")
    assert types["points"] == "sequence<probe/Point, 2>"


def test_field_types_are_handed_out_as_a_copy(msg: Any) -> None:
    msg.Point.get_fields_and_field_types().clear()
    assert list(msg.Point().get_fields_and_field_types()) == ["x", "y"]
    assert msg.Point._fields_and_field_types == {"x": "double", "y": "double"}


def test_slot_types_describe_the_fields(msg: Any) -> None:
    definition = import_module("rosidl_parser.definition")
    point = definition.NamespacedType(["probe", "msg"], "Point")
    assert (
        definition.BoundedSequence(definition.BasicType("int32"), 3),
        definition.BoundedSequence(definition.UnboundedString(), 3),
        definition.BoundedSequence(definition.BoundedString(3), 2),
        definition.BoundedSequence(point, 2),
    ) == msg.Bound.SLOT_TYPES
    assert msg.Fixed.SLOT_TYPES[-1] == definition.Array(point, 2)
    assert msg.Loose().SLOT_TYPES[-1] == definition.UnboundedSequence(point)
    assert definition.UnboundedWString() in msg.Scalars.SLOT_TYPES


def test_unknown_keywords_are_refused_in_order(msg: Any) -> None:
    with refused("Invalid arguments passed to constructor: a, z"):
        msg.Point(z=1, a=2, x=0.0)


def test_arguments_are_keywords_only(msg: Any) -> None:
    with pytest.raises(TypeError):
        msg.Point(1.0)


def test_messages_are_equal_member_by_member(msg: Any) -> None:
    assert msg.Point(x=1.0) == msg.Point(x=1.0)
    assert msg.Point(x=1.0) != msg.Point(x=2.0)
    assert msg.Point() != msg.Nothing()
    assert msg.Point() != 0
    assert msg.Nothing() == msg.Nothing()
    assert msg.Point(x=math.nan) != msg.Point(x=math.nan)


def test_arrays_differ_if_one_element_does(msg: Any) -> None:
    one, other = msg.Fixed(a_int8=[1, 2, 3]), msg.Fixed(a_int8=[1, 2, 4])
    assert one != other
    other.a_int8[2] = 3
    assert one == other


def test_messages_have_no_hash_and_no_order(msg: Any) -> None:
    with pytest.raises(TypeError):
        hash(msg.Point())
    with pytest.raises(TypeError):
        _ = msg.Point() < msg.Point()


def test_a_message_shows_as_the_call_that_makes_it(msg: Any) -> None:
    assert repr(msg.Point(x=1.0)) == "probe.msg.Point(x=1.0, y=0.0)"
    assert repr(msg.Nothing()) == "probe.msg.Nothing()"
    shown = repr(msg.Bound(numbers=[1, 2], texts=["a'b"]))
    assert shown == 'probe.msg.Bound(numbers=[1, 2], texts=["a\'b"], shorts=[], points=[])'
    assert "a_int8=array([0, 0, 0], dtype=int8)" in repr(msg.Fixed())


@pytest.mark.parametrize("name", ["Scalars", "Fixed", "Loose", "Nested", "Nothing", "Defaults"])
def test_messages_can_be_copied_and_pickled(msg: Any, name: str) -> None:
    values = {"nothing": 0.5} if name == "Defaults" else {}
    original = getattr(msg, name)(**values)
    for made in (copy.copy(original), copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert made == original
        assert made is not original


def test_a_copy_is_shallow_and_a_deep_copy_is_not(msg: Any) -> None:
    original = msg.Nested()
    assert copy.copy(original).point is original.point
    assert copy.deepcopy(original).point is not original.point


def test_the_metaclass_carries_what_client_libraries_look_for(msg: Any) -> None:
    metaclass = type(msg.Point)
    assert metaclass.__name__ == "Metaclass_Point"
    for name in (
        "_CREATE_ROS_MESSAGE",
        "_CONVERT_FROM_PY",
        "_CONVERT_TO_PY",
        "_DESTROY_ROS_MESSAGE",
        "_TYPE_SUPPORT",
    ):
        assert getattr(metaclass, name) is None
    metaclass.__import_type_support__()
    assert metaclass._TYPE_SUPPORT is None


def test_the_docstring_names_the_constants(msg: Any) -> None:
    assert msg.Point.__doc__ == "Message class 'Point'."
    assert msg.Constants.__doc__.split() == [
        "Message",
        "class",
        "'Constants'.",
        "Constants:",
        *["YES", "RAW", "LETTER", "LOW", "HIGH", "PI", "NAN", "INF", "WORD", "WIDE"],
    ]


def test_an_empty_message_has_no_field(msg: Any) -> None:
    assert msg.Nothing.__slots__ == []
    assert msg.Nothing.SLOT_TYPES == ()
    assert msg.Nothing.get_fields_and_field_types() == {}


def test_a_hidden_member_beside_another_is_a_field(msg: Any) -> None:
    assert list(msg.Hidden.get_fields_and_field_types()) == ["structure_needs_at_least_one_member", "other"]


# Storage and checks (4.3)


def test_fields_start_at_zero(msg: Any) -> None:
    scalars = msg.Scalars()
    assert scalars.flag is False
    assert (scalars.octet, scalars.letter, scalars.text, scalars.wide, scalars.brief) == (
        b"\0",
        0,
        "",
        "",
        "",
    )
    for name in ("single", "exact"):
        assert type(getattr(scalars, name)) is float
    for name in INTEGERS:
        assert type(getattr(scalars, f"a_{name}")) is int


SCALARS_ACCEPTED = [
    ("flag", True),
    ("octet", b"\xff"),
    ("octet", bytearray(b"x")),
    ("letter", 255),
    ("text", "é"),
    ("wide", "日本"),
    ("brief", "日本語"),
    ("brief", UserString("abc")),
    ("single", 1.5),
    ("single", math.inf),
    ("single", -math.inf),
    ("single", float(np.finfo("float32").max)),
    ("exact", np.float64(2.5)),
    ("exact", sys.float_info.max),
    ("a_int8", True),
    *((f"a_{name}", limit) for name, limits in INTEGERS.items() for limit in limits),
]

FLOAT = "a float in [-3.402823466e+38, 3.402823466e+38]"
SCALARS_REFUSED = [
    ("flag", 1, "The 'flag' field must be of type 'bool'"),
    ("octet", 1, "The 'octet' field must be of type 'bytes' or 'ByteString' with length 1"),
    ("octet", b"ab", "The 'octet' field must be of type 'bytes' or 'ByteString' with length 1"),
    ("letter", "a", "The 'letter' field must be of type 'int'"),
    ("letter", 256, "The 'letter' field must be an unsigned integer in [0, 255]"),
    ("text", b"a", "The 'text' field must be of type 'str'"),
    ("wide", 1, "The 'wide' field must be of type 'str'"),
    ("brief", "abcd", "The 'brief' field must be string value not longer than 3"),
    ("brief", 5, "The 'brief' field must be string value not longer than 3"),
    ("single", 1, "The 'single' field must be of type 'float'"),
    ("single", np.float32(1), "The 'single' field must be of type 'float'"),
    ("single", 3.5e38, f"The 'single' field must be {FLOAT}"),
    ("exact", 1, "The 'exact' field must be of type 'float'"),
    ("a_int8", 1.0, "The 'a_int8' field must be of type 'int'"),
    ("a_int8", np.int8(1), "The 'a_int8' field must be of type 'int'"),
    ("a_int8", 128, "The 'a_int8' field must be an integer in [-128, 127]"),
    ("a_uint8", -1, "The 'a_uint8' field must be an unsigned integer in [0, 255]"),
    ("a_int64", 2**63, f"The 'a_int64' field must be an integer in [{-(2**63)}, {2**63 - 1}]"),
]


@pytest.mark.parametrize(("name", "value"), SCALARS_ACCEPTED)
def test_a_scalar_accepts_a_value_of_its_type_in_its_range(msg: Any, name: str, value: object) -> None:
    message = msg.Scalars()
    setattr(message, name, value)
    assert getattr(message, name) is value
    assert getattr(msg.Scalars(**{name: value}), name) is value


@pytest.mark.parametrize(("name", "value", "words"), SCALARS_REFUSED)
def test_a_scalar_refuses_other_values_and_keeps_its_own(
    msg: Any, name: str, value: object, words: str
) -> None:
    message = msg.Scalars()
    with refused(words):
        setattr(message, name, value)
    assert message == msg.Scalars()
    with refused(words):
        msg.Scalars(**{name: value})


def test_nan_is_a_float(msg: Any) -> None:
    assert math.isnan(msg.Scalars(single=math.nan).single)


def test_a_message_field_takes_its_class_and_those_derived_from_it(msg: Any) -> None:
    class Special(msg.Point):  # type: ignore[misc, name-defined]
        """A user's own."""

    special = Special()
    assert msg.Nested(point=special).point is special
    with refused("The 'point' field must be a sub message of type 'Point'"):
        msg.Nested(point=msg.Nothing())
    with refused("The 'header' field must be a sub message of type 'Header'"):
        msg.Nested().header = None


def test_messages_do_not_share_their_parts(msg: Any) -> None:
    for class_ in (msg.Nested, msg.Fixed, msg.Loose, msg.Defaults):
        one, other = class_(), class_()
        for slot in class_.__slots__:
            if not isinstance(getattr(one, slot), bool | int | float | str | bytes):
                assert getattr(one, slot) is not getattr(other, slot), slot
    points = msg.Fixed().points
    assert points[0] is not points[1]


@pytest.mark.parametrize(("name", "code"), CODES.items())
def test_fixed_numeric_arrays_are_numpy_arrays(msg: Any, name: str, code: str) -> None:
    value = getattr(msg.Fixed(), f"a_{name}")
    assert isinstance(value, np.ndarray)
    assert (value.dtype, value.shape, value.tolist()) == (np.dtype(name), (3,), [0, 0, 0])
    assert np.dtype(code) == value.dtype


@pytest.mark.parametrize(("name", "code"), CODES.items())
def test_numeric_sequences_are_arrays(msg: Any, name: str, code: str) -> None:
    assert getattr(msg.Loose(), f"a_{name}") == array(code)
    message = msg.Loose(**{f"a_{name}": [1, 2]})
    assert getattr(message, f"a_{name}").typecode == code


def test_other_collections_are_lists(msg: Any) -> None:
    fixed, loose = msg.Fixed(), msg.Loose()
    assert (fixed.flags, fixed.bytes, fixed.texts, fixed.shorts) == (
        [False] * 2,
        [b"\0"] * 2,
        [""] * 2,
        [""] * 2,
    )
    assert fixed.points == [msg.Point(), msg.Point()]
    assert (loose.flags, loose.bytes, loose.texts, loose.shorts, loose.points) == ([], [], [], [], [])


def test_a_constructor_lets_numpy_convert(msg: Any) -> None:
    message = msg.Fixed(a_int8=[1.7, 2, True], a_float32=(1, 2, 3))
    assert message.a_int8.tolist() == [1, 2, 1]
    assert message.a_float32.dtype == np.float32
    with pytest.raises(OverflowError):
        msg.Fixed(a_int8=[1, 2, 300])
    with refused("The 'a_int8' numpy.ndarray() must have a size of 3"):
        msg.Fixed(a_int8=[1, 2])
    with pytest.raises(AssertionError):
        msg.Fixed(a_int8=[[1, 2, 3]])


def test_a_constructor_lets_array_convert(msg: Any) -> None:
    given = array("d", [1.0])
    message = msg.Loose(a_uint8=b"\x01\x02", a_float64=given)
    assert message.a_uint8 == array("B", [1, 2])
    assert message.a_float64 == given
    assert message.a_float64 is not given
    assert msg.Loose(a_float32=[1, 2]).a_float32 == array("f", [1.0, 2.0])
    with pytest.raises(OverflowError):
        msg.Loose(a_uint8=[256])
    with pytest.raises(TypeError):
        msg.Loose(a_uint8=["a"])
    with refused("The 'numbers' array.array() must have a size <= 3"):
        msg.Bound(numbers=[1, 2, 3, 4])


def test_a_property_keeps_an_array_of_the_right_type(msg: Any) -> None:
    fixed, loose = msg.Fixed(), msg.Loose()
    fixed.a_uint8 = kept = np.arange(3, dtype=np.uint8)
    assert fixed.a_uint8 is kept
    loose.a_uint8 = also_kept = array("B", [1])
    assert loose.a_uint8 is also_kept
    square = np.zeros((3, 1), np.uint8)
    fixed.a_uint8 = square
    assert fixed.a_uint8 is square
    assert fixed != msg.Fixed()


COLLECTIONS_ACCEPTED = [
    ("a_uint8", b"\x01\x02\x03"),
    ("a_uint8", range(3)),
    ("a_uint8", memoryview(b"abc")),
    ("a_uint8", UserList([1, 2, 3])),
    ("a_int16", {1, 2, 3}),
    ("a_int16", (True, False, True)),
    ("a_float64", [1.0, math.nan, math.inf]),
    ("a_float32", [np.float64(1.5), 2.5, -math.inf]),
]


@pytest.mark.parametrize(("name", "value"), COLLECTIONS_ACCEPTED)
def test_a_property_converts_sequences_and_sets_of_numbers(msg: Any, name: str, value: Any) -> None:
    for message in (msg.Fixed(), msg.Loose()):
        setattr(message, name, value)
        assert repr(list(map(float, getattr(message, name)))) == repr(list(map(float, value)))


@pytest.mark.parametrize("value", [[1.0], (n for n in ()), "", 5, None, {1: 1.5}, np.zeros(3), [300], ["a"]])
def test_a_numeric_sequence_refuses_what_is_no_collection_of_its_numbers(msg: Any, value: object) -> None:
    with refused(
        "The 'a_uint8' field must be a set or sequence and each value of type 'int' "
        "and each unsigned integer in [0, 255]"
    ):
        msg.Loose().a_uint8 = value


def test_arrays_of_another_type_or_size_are_refused(msg: Any) -> None:
    fixed, loose, bound = msg.Fixed(), msg.Loose(), msg.Bound()
    with refused("The 'a_uint8' numpy.ndarray() must have the dtype of 'numpy.uint8'"):
        fixed.a_uint8 = np.zeros(3)
    with refused("The 'a_uint8' numpy.ndarray() must have a size of 3"):
        fixed.a_uint8 = np.zeros(4, np.uint8)
    with refused("The 'a_uint8' array.array() must have the type code of 'B'"):
        loose.a_uint8 = array("b")
    with refused("The 'numbers' array.array() must have a size <= 3"):
        bound.numbers = array("i", [1, 2, 3, 4])
    with refused(
        "The 'a_uint8' field must be a set or sequence with length 3 and each value of type 'int' "
        "and each unsigned integer in [0, 255]"
    ):
        fixed.a_uint8 = [1, 2]
    with refused(
        "The 'a_float32' field must be a set or sequence and each value of type 'float' "
        "and each float in [-3.402823466e+38, 3.402823466e+38]"
    ):
        loose.a_float32 = [1e39]


LISTS_REFUSED = [
    ("Fixed", "flags", [1, 0], "with length 2 and each value of type 'bool'"),
    ("Fixed", "bytes", [b"a"], "with length 2 and each value of type 'bytes'"),
    ("Fixed", "texts", "ab", "with length 2 and each value of type 'str'"),
    (
        "Fixed",
        "shorts",
        ["a", "long"],
        "with length 2 and each string value not longer than 3 and each value of type 'str'",
    ),
    ("Loose", "texts", UserString("ab"), "and each value of type 'str'"),
    ("Loose", "texts", ["a", 1], "and each value of type 'str'"),
    ("Loose", "points", [None], "and each value of type 'Point'"),
    ("Loose", "flags", np.array([True]), "and each value of type 'bool'"),
    ("Bound", "texts", ["a"] * 4, "with length <= 3 and each value of type 'str'"),
    (
        "Bound",
        "shorts",
        [1],
        "with length <= 2 and each string value not longer than 3 and each value of type 'str'",
    ),
]


@pytest.mark.parametrize(("class_", "name", "value", "words"), LISTS_REFUSED)
def test_a_list_refuses_other_elements_and_lengths(
    msg: Any, class_: str, name: str, value: object, words: str
) -> None:
    message = getattr(msg, class_)()
    with refused(f"The '{name}' field must be a set or sequence{' ' + words}"):
        setattr(message, name, value)
    with pytest.raises(AssertionError):
        getattr(msg, class_)(**{name: value})


@pytest.mark.parametrize("value", [("a", "b"), {"a", "b"}, UserList(["a", "b"]), ["a", "b"]])
def test_a_list_is_stored_as_given(msg: Any, value: object) -> None:
    message = msg.Fixed()
    message.texts = value
    assert message.texts is value


def test_bytes_in_a_list_may_have_any_length(msg: Any) -> None:
    assert msg.Loose(bytes=[b"", b"abc"]).bytes == [b"", b"abc"]


def test_without_assertions_values_are_not_checked_but_converted(folder: Path) -> None:
    code = (
        "from probe.msg import Scalars, Fixed, Loose\n"
        "loose = Loose(); loose.a_int8 = [1]\n"
        "fixed = Fixed(); fixed.a_int8 = [1, 2, 3]\n"
        "print(Scalars(flag='x', a_int8=1000, other=1).flag, type(loose.a_int8).__name__, type(fixed.a_int8).__name__)"
    )
    assert _python(folder, code, "-O") == "x array ndarray"


@given(value=st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=2), st.none()))
def test_an_integer_field_holds_what_it_is_given_or_what_it_had(folder: Path, value: Any) -> None:
    assert folder.is_dir()
    message = import_module("probe.msg").Scalars()
    try:
        message.a_uint16 = value
    except AssertionError:
        assert message.a_uint16 == 0
        assert not (isinstance(value, int) and 0 <= value < 2**16)
    else:
        assert message.a_uint16 is value
        assert isinstance(value, int)
        assert 0 <= value < 2**16


# Defaults (1.6, 4.3, 10)


def test_defaults_have_the_form_in_which_fields_store_them(msg: Any) -> None:
    message = msg.Defaults()
    assert (message.flag, message.raw, message.low, message.high) == (True, b"\xff", -(2**63), 2**64 - 1)
    assert (message.whole, message.endless) == (0.0, -math.inf)
    assert math.isnan(message.nothing)
    assert (message.text, message.wide, message.brief) == ("it's", "Hellö", 'a"b')
    assert message.none == array("i")
    assert message.some == array("i", [1, 2])
    assert message.letters == array("B", [0, 1, 127])
    assert (message.pair.dtype, message.pair.tolist()) == (np.float64, [1.0, 2.0])
    assert (message.flags, message.bytes, message.texts) == ([True, False], [b"\0", b"\xff"], ["a", "b"])


def test_numeric_fields_with_a_default_check_what_a_constructor_is_given(msg: Any) -> None:
    assert msg.Defaults(some=[3]).some == array("i", [3])
    with pytest.raises(AssertionError):
        msg.Defaults(some=[1.5])
    with pytest.raises(AssertionError):
        msg.Defaults(pair=[1, 2])


def test_a_default_out_of_range_fails_at_construction() -> None:
    name = TypeName("idl", "msg", "Huge")
    message = Message(name, (Field("x", Primitive("float"), 1e39),))
    huge = dict(_executed(Catalog("idl", {name: message}, {name: message}, ())))["idl/msg/_huge.py"]["Huge"]
    with refused(f"The 'x' field must be {FLOAT}"):
        huge()


# Names that get in the way (10)


def test_a_field_may_be_called_property(msg: Any) -> None:
    message = msg.Property(property="x", after=1, builtins=2, last=3)
    assert (message.property, message.after, message.builtins, message.last) == ("x", 1, 2, 3)
    with pytest.raises(AssertionError):
        message.last = "x"


def test_fields_may_have_the_names_of_what_the_code_uses(msg: Any) -> None:
    message = msg.Words(self=1, len=2, str="x", bytes=b"y", array=[1], numpy=[1, 2, 3])
    assert (message.self, message.len, message.str, message.bytes) == (1, 2, "x", b"y")
    assert (message.array, message.numpy.tolist()) == (array("b", [1]), [1, 2, 3])
    for name, value in (("len", 300), ("str", 1), ("bytes", b"ab"), ("self", "x")):
        with pytest.raises(AssertionError):
            msg.Words(**{name: value})


def test_classes_of_one_name_are_kept_apart(folder: Path) -> None:
    assert folder.is_dir()
    goal = import_module("probe.action").Act.Goal()
    assert type(goal.ours).__module__ == "probe.msg._point"
    assert type(goal.theirs).__module__ == "geometry_msgs.msg._point"
    assert type(goal.goal_of_same_name).__module__ == "probe.msg._act"


HOSTILE = [
    '"""',
    "'''",
    "\\",
    '\\"',
    "\n",
    "\r\n",
    "\0",
    "\x85\u2028",
    "{{ x }}",
    "{% x %}",
    "#",
    "\ud800",
    "'\"\n",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_breaks_out_of_its_quotes(text: str) -> None:
    name = TypeName("hostile", "msg", "Text")
    message = Message(
        name,
        (
            Field("a", Text(), text, (text,)),
            Field("b", Sequence(Text(), 3), (text, text)),
            Field("c", Array(Text(wide=True, bound=9), 1), (text,)),
        ),
        (Constant("A", Text(), text, (text,)),),
        (text,),
    )
    modules = dict(_executed(Catalog("hostile", {name: message}, {name: message}, ())))
    made = modules["hostile/msg/_text.py"]["Text"]()
    assert (made.a, made.b, made.c, made.A) == (text, [text, text], [text], text)


def test_idl_characters_are_strings_of_one_character() -> None:
    name = TypeName("idl", "idl", "Chars")
    message = Message(
        name,
        (
            Field("c", Primitive("char")),
            Field("w", Primitive("wchar"), "é"),
            Field("cs", Array(Primitive("char"), 2)),
            Field("ws", Sequence(Primitive("wchar"), 2), (65,)),
        ),
    )
    class_ = dict(_executed(Catalog("idl", {name: message}, {name: message}, ())))["idl/idl/_chars.py"][
        "Chars"
    ]
    made = class_()
    assert (made.c, made.w, made.cs, made.ws) == ("\0", "é", ["\0", "\0"], ["A"])
    assert class_(c="a", w="日", cs=["a", "b"], ws=[]).w == "日"
    for values in (
        {"c": "é"},
        {"c": "ab"},
        {"w": "\U0001f600"},
        {"w": 1},
        {"cs": ["a", "é"]},
        {"ws": ["ab"]},
    ):
        with pytest.raises(AssertionError):
            class_(**values)


def test_a_member_may_be_called_like_its_class() -> None:
    inner, outer = TypeName("idl", "msg", "Inner"), TypeName("idl", "msg", "Outer")
    messages = {
        inner: Message(inner, (Field("x", Primitive("int8")),)),
        outer: Message(outer, (Field("Inner", Named(inner)),)),
    }
    text = {file.path: file.text for file in python.files(Catalog("idl", messages, messages, ()))}
    assert "from idl.msg._inner import Inner as _idl_msg_Inner" in text["idl/msg/_outer.py"]


# Services and actions (4.4)


def test_a_service_is_a_pair_of_messages(folder: Path) -> None:
    assert folder.is_dir()
    service = import_module("probe.srv").Point
    assert service.Request.__name__ == "Point_Request"
    assert (service.Request().a, service.Request.LIMIT) == (5, 3)
    assert repr(service.Response(why="x")) == "probe.srv.Point_Response(why='x', all=[])"
    with pytest.raises(NotImplementedError, match="^Service classes can not be instantiated$"):
        service()
    assert type(service)._TYPE_SUPPORT is None
    assert not hasattr(service, "Event")


def test_an_action_holds_its_messages_and_services(folder: Path) -> None:
    assert folder.is_dir()
    action = import_module("probe.action").Act
    assert [part.__name__ for part in (action.Goal, action.Result, action.Feedback)] == [
        "Act_Goal",
        "Act_Result",
        "Act_Feedback",
    ]
    impl = action.Impl
    send = impl.SendGoalService.Request(goal=action.Goal())
    assert send.get_fields_and_field_types() == {
        "goal_id": "unique_identifier_msgs/UUID",
        "goal": "probe/Act_Goal",
    }
    assert impl.SendGoalService.Response(accepted=True).accepted is True
    assert impl.GetResultService.Response(status=4).result == action.Result()
    assert impl.FeedbackMessage(feedback=action.Feedback(part=0.5)).feedback.part == 0.5
    assert impl.CancelGoalService.__module__ == "action_msgs.srv._cancel_goal"
    assert impl.GoalStatusMessage.__module__ == "action_msgs.msg._goal_status_array"
    assert pickle.loads(pickle.dumps(send)) == send
    with pytest.raises(NotImplementedError, match="^Action classes can not be instantiated$"):
        action()
    type(action).__import_type_support__()
    assert type(action)._TYPE_SUPPORT is None


# The text


@pytest.mark.parametrize("case", sorted(path.name for path in (GOLDEN / "interfaces" / "python").iterdir()))
def test_the_text_is_as_reviewed(case: str, golden: Golden) -> None:
    source = GOLDEN / "interfaces" / "python" / case
    definitions = {
        path.relative_to(source).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(source.glob("*/*.*"))
        if "expected" not in path.parts
    }
    files = python.files(catalog_of("golden_msgs", definitions))
    golden(f"interfaces/python/{case}", {file.path: file.text for file in files})


def _python(folder: Path, code: str, *options: str) -> str:
    """Return what the code prints in a Python of its own."""
    variables = {"PYTHONPATH": f"{folder}:{RUNTIME}", "PYTHONDONTWRITEBYTECODE": "1"}
    argv = [sys.executable, *options, "-c", code]
    return subprocess.run(argv, env=variables, check=True, capture_output=True, text=True).stdout.strip()


def _executed(catalog: Catalog) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the names that each generated interface module defines, executed where it stands."""
    sys.path.insert(0, str(RUNTIME))
    try:
        for file in python.files(catalog):
            if "/_" in file.path and "__init__" not in file.path:
                names: dict[str, Any] = {"__name__": file.path.removesuffix(".py").replace("/", ".")}
                exec(compile(file.text, file.path, "exec"), names)
                yield file.path, names
    finally:
        sys.path.remove(str(RUNTIME))
