"""Single fields of generated Python: defaults, accepted and rejected values."""

import copy
import math
import pickle
import sys
from array import array
from collections import UserString
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    TypeName,
)
from forge.interfaces.python import target as python
from tests.generated import INTEGERS, catalog_of, classes_of, generate, importable, refused

FLOAT = "a float in [-3.402823466e+38, 3.402823466e+38]"


def test_fields_start_at_zero(msg: ModuleType) -> None:
    scalars = msg.Scalars()
    assert scalars.flag is False
    assert (scalars.octet, scalars.letter) == (b"\0", 0)
    assert (scalars.text, scalars.wide, scalars.brief) == ("", "", "")
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
def test_scalars_accept_values_in_range(msg: ModuleType, name: str, value: object) -> None:
    message = msg.Scalars()
    setattr(message, name, value)
    assert getattr(message, name) is value
    assert getattr(msg.Scalars(**{name: value}), name) is value


@pytest.mark.parametrize(("name", "value", "words"), SCALARS_REFUSED)
def test_a_rejected_scalar_leaves_the_field_unchanged(
    msg: ModuleType, name: str, value: object, words: str
) -> None:
    message = msg.Scalars()
    with refused(words):
        setattr(message, name, value)
    assert message == msg.Scalars()
    with refused(words):
        msg.Scalars(**{name: value})


def test_a_message_field_accepts_subclasses(msg: ModuleType) -> None:
    class Special(msg.Point):  # type: ignore[misc, name-defined]
        """A user's subclass."""

    special = Special()
    assert msg.Nested(point=special).point is special
    with refused("The 'point' field must be a sub message of type 'Point'"):
        msg.Nested(point=msg.Nothing())
    with refused("The 'header' field must be a sub message of type 'Header'"):
        msg.Nested().header = None


def test_defaults_have_the_stored_type_of_their_fields(msg: ModuleType) -> None:
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


def test_numeric_fields_with_a_default_check_arguments(msg: ModuleType) -> None:
    assert msg.Defaults(some=[3]).some == array("i", [3])
    with pytest.raises(AssertionError):
        msg.Defaults(some=[1.5])
    with pytest.raises(AssertionError):
        msg.Defaults(pair=[1, 2])


def test_the_largest_number_of_a_float32_may_be_rounded() -> None:
    """As FLT_MAX in C is; numbers beyond are no defaults."""
    name = TypeName("idl", "msg", "Largest")
    fields = (
        Field("x", Primitive("float"), 3.4028235e38),
        Field("y", Array(Primitive("float"), 1), (-3.40282347e38,)),
    )
    largest = classes_of(Message(name, fields))["Largest"]()
    assert (largest.x, largest.y.tolist()) == (3.4028234663852886e38, [-3.4028234663852886e38])


def test_a_default_out_of_range_fails_at_construction() -> None:
    name = TypeName("idl", "msg", "Huge")
    message = Message(name, (Field("x", Primitive("float"), 1e39),))
    huge = classes_of(message)["Huge"]
    with refused(f"The 'x' field must be {FLOAT}"):
        huge()


def test_a_field_can_be_named_property(msg: ModuleType) -> None:
    message = msg.Property(property="x", after=1, builtins=2, last=3)
    assert (message.property, message.after, message.builtins, message.last) == ("x", 1, 2, 3)
    with pytest.raises(AssertionError):
        message.last = "x"


def test_field_names_may_shadow_generated_names(msg: ModuleType) -> None:
    message = msg.Words(self=1, len=2, str="x", bytes=b"y", array=[1], numpy=[1, 2, 3])
    assert (message.self, message.len, message.str, message.bytes) == (1, 2, "x", b"y")
    assert (message.array, message.numpy.tolist()) == (array("b", [1]), [1, 2, 3])
    for name, value in (("len", 300), ("str", 1), ("bytes", b"ab"), ("self", "x")):
        with pytest.raises(AssertionError):
            msg.Words(**{name: value})


def test_classes_of_the_same_name_do_not_conflict(probe: Path) -> None:
    assert probe.is_dir()
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
def test_strings_in_generated_code_are_escaped(text: str) -> None:
    name = TypeName("hostile", "msg", "Text")
    message = Message(
        name,
        (
            Field("a", String(), text, (text,)),
            Field("b", Sequence(String(), 3), (text, text)),
            Field("c", Array(String(wide=True, bound=9), 1), (text,)),
        ),
        (Constant("A", String(), text, (text,)),),
        (text,),
    )
    made = classes_of(message)["Text"]()
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
    class_ = classes_of(message)["Chars"]
    made = class_()
    assert (made.c, made.w, made.cs, made.ws) == ("\0", "é", ["\0", "\0"], ["A"])
    assert class_(c="a", w="日", cs=["a", "b"], ws=[]).w == "日"
    wrong = ({"c": "é"}, {"c": "ab"}, {"w": "\U0001f600"}, {"w": 1}, {"cs": ["a", "é"]}, {"ws": ["ab"]})
    for values in wrong:
        with pytest.raises(AssertionError):
            class_(**values)


def test_a_member_may_have_the_name_of_its_class() -> None:
    inner, outer = TypeName("idl", "msg", "Inner"), TypeName("idl", "msg", "Outer")
    messages = {
        inner: Message(inner, (Field("x", Primitive("int8")),)),
        outer: Message(outer, (Field("Inner", Named(inner)),)),
    }
    text = {file.path: file.text for file in python.files(Catalog("idl", messages, messages, {}))}
    assert "from idl.msg._inner import Inner as _idl_msg_Inner" in text["idl/msg/_outer.py"]


def test_a_message_with_a_field_named_shape_can_be_compared(tmp_path: Path) -> None:
    """Arrays have an attribute of that name as well."""
    texts = {
        "msg/Panel.msg": "float64 width\n",
        "msg/Seen.msg": "Panel shape\n",
        "msg/Tracked.msg": "Seen object\n",
    }
    generate(tmp_path, catalog_of("seen_msgs", texts))
    with importable(tmp_path):
        module: Any = import_module("seen_msgs.msg")
        assert module.Tracked() == module.Tracked()
        wide = module.Tracked(object=module.Seen(shape=module.Panel(width=1.0)))
        assert wide != module.Tracked()


def test_fields_named_like_keywords_are_renamed_in_code(tmp_path: Path) -> None:
    """getattr(), the constructor and tools that iterate over the fields use its own name."""
    text = "string from\nfloat64[2] in\nint8[<=2] is\nint32 lambda 3\nuint8 pass\n"
    generate(tmp_path, catalog_of("keyword_msgs", {"msg/Edge.msg": text}))
    with importable(tmp_path):
        module: Any = import_module("keyword_msgs.msg")
        edge = module.Edge(**{"from": "a", "in": [1.0, 2.0], "is_": [1]}, pass_=4)
        assert (edge.from_, getattr(edge, "from"), edge.lambda_) == ("a", "a", 3)
        assert list(edge.get_fields_and_field_types()) == ["from", "in", "is", "lambda", "pass"]
        setattr(edge, "from", "b")
        assert edge.from_ == "b"
        with pytest.raises(AssertionError, match="The 'from' field must be"):
            edge.from_ = 1
        with pytest.raises(AssertionError, match="unknown"):
            module.Edge(unknown=1)
        cdr: Any = import_module("forge_cdr")
        assert cdr.deserialize(cdr.serialize(edge), module.Edge) == edge
        convert: Any = import_module("rosidl_runtime_py.convert")
        assert convert.message_to_ordereddict(edge)["from"] == "b"
        assert copy.deepcopy(edge) == edge == pickle.loads(pickle.dumps(edge))


def test_stubs_rename_fields_named_like_keywords() -> None:
    catalog = catalog_of("keyword_msgs", {"msg/Edge.msg": "string from\n"})
    stub = next(file.text for file in python.files(catalog) if file.path.endswith("_edge.pyi"))
    compile(stub, "_edge.pyi", "exec")
    assert "def from_(self) -> str:" in stub
