"""C headers as text: names, includes, constants and values."""

import ast
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.cpp.headers import detail_path
from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Field,
    Message,
    Primitive,
    Sequence,
    String,
    TypeName,
    Value,
)
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder, read_runtime
from forge.interfaces.resolve.resolution import resolve
from forge.plugins.c_target import target as c
from forge.plugins.c_target.target import number, units
from tests.conftest import GOLDEN, Forge, Golden, Tree


def texts(*messages: Message) -> dict[str, str]:
    catalog = Catalog("demo", {message.name: message for message in messages}, {}, {})
    return {file.path: file.text for file in c.files(catalog)}


def message(*fields: Field, constants: tuple[Constant, ...] = (), name: str = "Thing") -> Message:
    return Message(TypeName("demo", "msg", name), fields, constants)


def struct(*fields: Field, constants: tuple[Constant, ...] = ()) -> str:
    return texts(message(*fields, constants=constants))["demo/msg/detail/thing__struct.h"]


def functions(*fields: Field) -> str:
    return texts(message(*fields))["demo/msg/detail/thing__functions.h"]


def test_headers_match_the_golden_files(golden: Golden) -> None:
    """A message, a service and an action give these headers and no others."""
    case = GOLDEN / "interfaces" / "c" / "robot"
    catalog = resolve("robot", parse_all(read_folder("robot", case)), Library())
    golden(case, {file.path: file.text for file in c.files(catalog)})


def test_a_folder_of_generated_c_is_self_contained(forge: Forge, tree: Tree) -> None:
    """`--lang c` brings the run-time headers of C and other packages' messages, and nothing of C++."""
    root = tree({"src/msg/A.msg": "std_msgs/Header header"})
    ran = forge("interface", "generate", "--package", "p", "--output", "out", "--lang", "c", "src", cwd=root)
    assert (ran.code, ran.err) == (0, "")
    made = {path.relative_to(root / "out/c").as_posix() for path in (root / "out/c").rglob("*.*")}
    assert {"p/msg/a.h", "std_msgs/msg/header.h", "builtin_interfaces/msg/time.h"} <= made
    assert {"rosidl_runtime_c/string_functions.h", "rosidl_typesupport_interface/macros.h"} <= made
    assert all(path.endswith(".h") for path in made)
    assert {file.path.removeprefix("c/") for file in read_runtime("c")} <= made


@pytest.mark.parametrize(
    ("name", "path"),
    [
        (TypeName("p", "msg", "HTTPServer"), "p/msg/detail/http_server__struct.h"),
        (TypeName("p", "msg", "Foo_Request"), "p/msg/detail/foo__request__struct.h"),
        (TypeName("p", "srv", "AskMe_Request"), "p/srv/detail/ask_me__struct.h"),
        (TypeName("p", "action", "GoOn_SendGoal_Request"), "p/action/detail/go_on__struct.h"),
        (TypeName("p", "action", "GoOn_FeedbackMessage"), "p/action/detail/go_on__struct.h"),
        (TypeName("p", "srv", "Of_Idl"), "p/srv/detail/of__idl__struct.h"),
    ],
)
def test_parts_are_declared_in_the_header_of_their_interface(name: TypeName, path: str) -> None:
    assert detail_path(name, "struct", "h") == path


@pytest.mark.parametrize(
    ("type_", "value", "text"),
    [
        (Primitive("int8"), -1, "enum { demo__msg__Thing__X = -1 };"),
        (Primitive("octet"), 255, "enum { demo__msg__Thing__X = 255 };"),
        (Primitive("uint32"), 2**31 - 1, "enum { demo__msg__Thing__X = 2147483647u };"),
        (Primitive("uint32"), 2**31, "static const uint32_t demo__msg__Thing__X = 2147483648u;"),
        (Primitive("int64"), -(2**31), "enum { demo__msg__Thing__X = -2147483648ll };"),
        (Primitive("int64"), 2**40, "static const int64_t demo__msg__Thing__X = 1099511627776ll;"),
        (Primitive("boolean"), True, "static const bool demo__msg__Thing__X = true;"),
        (Primitive("float"), 1, "static const float demo__msg__Thing__X = 1.0f;"),
        (String(), 'a"b', 'static const char * const demo__msg__Thing__X = "a\\"b";'),
        (String(wide=True), "hé", "static const uint_least16_t demo__msg__Thing__X[] = {'h', 0x00e9, 0};"),
    ],
)
def test_a_constant_is_an_enumerator_if_it_can_be_one(
    type_: Primitive | String, value: Value, text: str
) -> None:
    """An int of C99 has no more than 32 bits; wstring constants, which rosidl leaves out, are there."""
    assert f"\n{text}\n" in struct(constants=(Constant("X", type_, value),))


def test_bounds_are_enumerators() -> None:
    """A sequence of texts has two; what does not fit an int is a size_t."""
    header = struct(
        Field("words", Sequence(String(bound=3), 2)),
        Field("names", Array(String(bound=4), 2)),
        Field("free", Sequence(String())),
        Field("far", String(bound=2**32)),
    )
    assert re.findall(r"^(?:enum|static).*$", header, re.MULTILINE) == [
        "enum { demo__msg__Thing__words__MAX_SIZE = 2 };",
        "enum { demo__msg__Thing__words__MAX_STRING_SIZE = 3 };",
        "enum { demo__msg__Thing__names__MAX_STRING_SIZE = 4 };",
        "static const size_t demo__msg__Thing__far__MAX_STRING_SIZE = 4294967296u;",
    ]


@pytest.mark.parametrize(
    ("type_", "value", "text"),
    [
        (Primitive("float"), float("nan"), "NAN"),
        (Primitive("float"), float("-inf"), "-HUGE_VALF"),
        (Primitive("float"), 1e60, "HUGE_VALF"),
        (Primitive("double"), float("inf"), "HUGE_VAL"),
        (Primitive("long double"), float("inf"), "HUGE_VALL"),
        (Primitive("double"), 1, "1.0"),
        (Primitive("char"), "a", "97"),
        (Primitive("char"), 200, "(signed char)200"),
        (Primitive("int64"), -(2**63), "(-9223372036854775807ll - 1)"),
    ],
)
def test_numbers_are_written_exactly(type_: Primitive, value: Value, text: str) -> None:
    assert number(value, type_) == text


@given(st.text(st.characters(), max_size=20))
def test_wide_strings_are_code_units_and_a_terminating_zero(text: str) -> None:
    """Whatever the text, the initializer holds its UTF-16, surrogates that stand alone included."""
    items = re.findall(r"'[^']'|[0-9a-fx]+", units(text))
    numbers = [ord(item[1]) if item[0] == "'" else int(ast.literal_eval(item)) for item in items]
    assert numbers.pop() == 0
    data = b"".join(number.to_bytes(2, "little") for number in numbers)
    assert data.decode("utf-16-le", "surrogatepass") == text
