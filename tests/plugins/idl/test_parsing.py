"""The subset of IDL that rosidl supports, and errors for the rest."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.errors import InterfaceError
from forge.interfaces.idl import idl_text
from forge.interfaces.model import (
    Action,
    Array,
    Constant,
    Field,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    Type,
    TypeName,
    Value,
)
from forge.interfaces.read.parsing import parse, parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.plugins.idl.parsing import read_idl
from tests.conftest import GOLDEN

INT8 = Primitive("int8")
LIBRARY = Library()


def read(text: str, relative: str = "msg/A.idl") -> Interface:
    return parse(Source("p", relative, Path(relative), text))


def in_modules(text: str) -> str:
    return f"module p {{ module msg {{ {text} }}; }};"


def message(members: str, before: str = "") -> Message:
    read_message = read(in_modules(f"{before} struct A {{ {members} }};"))
    assert isinstance(read_message, Message)
    return read_message


def errors(text: str, relative: str = "msg/A.idl") -> list[str]:
    """Return the errors in a file with line and column."""
    with pytest.raises(InterfaceError) as caught:
        read(text, relative)
    return [
        f"{p.location.line}:{p.location.column} {p.message}" if p.location and p.location.line else p.message
        for p in caught.value.problems
    ]


def error(members: str, before: str = "") -> str:
    """Return the only error in a struct with these members."""
    (text,) = errors(in_modules(f"{before} struct A {{ {members} }};"))
    return text.partition(" ")[2]


@pytest.mark.parametrize(
    ("written", "type_"),
    [
        *((name, Primitive(name)) for name in "int8 uint8 int16 uint32 int64 uint64 float double".split()),
        *((name, Primitive(name)) for name in ("long double", "char", "wchar", "boolean", "octet")),
        ("short", Primitive("int16")),
        ("unsigned short", Primitive("uint16")),
        ("long", Primitive("int32")),
        ("unsigned long", Primitive("uint32")),
        ("long long", Primitive("int64")),
        ("unsigned long long", Primitive("uint64")),
        ("string", String()),
        ("wstring", String(wide=True)),
        ("string<5>", String(bound=5)),
        ("wstring<5>", String(wide=True, bound=5)),
        ("sequence<int8>", Sequence(INT8)),
        ("sequence<unsigned long, 3>", Sequence(Primitive("uint32"), 3)),
        ("sequence<string<5>>", Sequence(String(bound=5))),
        ("sequence<wstring<5>, 2>", Sequence(String(wide=True, bound=5), 2)),
        ("sequence<q::msg::B, 3>", Sequence(Named(TypeName("q", "msg", "B")), 3)),
        ("q::msg::B", Named(TypeName("q", "msg", "B"))),
        ("::q::idl::B", Named(TypeName("q", "idl", "B"))),
    ],
)
def test_idl_types_are_converted(written: str, type_: Type) -> None:
    assert message(f"{written} a;").fields == (Field("a", type_),)


def test_each_declarator_can_be_an_array() -> None:
    fields = message("int8 a[3], b, c[4];").fields
    assert [(field.name, field.type) for field in fields] == [
        ("a", Array(INT8, 3)),
        ("b", INT8),
        ("c", Array(INT8, 4)),
    ]


def test_typedefs_of_typedefs_are_resolved() -> None:
    before = """
        typedef q::msg::B q__msg__B;
        typedef q__msg__B q__msg__B__3[3];
        typedef sequence<string<4>, 2> Words;
        typedef long Number;
        typedef Number Other;
    """
    fields = message("q__msg__B__3 a; Words b; Other c; Number d[2]; sequence<Other> e;", before).fields
    assert [field.type for field in fields] == [
        Array(Named(TypeName("q", "msg", "B")), 3),
        Sequence(String(bound=4), 2),
        Primitive("int32"),
        Array(Primitive("int32"), 2),
        Sequence(Primitive("int32")),
    ]


def test_idl_keywords_may_be_member_names() -> None:
    words = "string wstring sequence module boolean octet TRUE any map A a__b a_ struct_"
    fields = message(" ".join(f"int8 {word};" for word in words.split())).fields
    assert [field.name for field in fields] == words.split()


@pytest.mark.parametrize(
    ("type_", "written", "value"),
    [
        ("int8", "-3", -3),
        ("int8", "(-(3))", 3 * -1),
        ("int8", "+3", 3),
        ("uint8", "~3", 3),
        ("int8", "-128", -128),
        ("octet", "255", 255),
        ("boolean", "TRUE", True),
        ("boolean", "0", False),
        ("float", "1.5", 1.5),
        ("float", ".5", 0.5),
        ("double", "1.", 1.0),
        ("double", "1e5", 1e5),
        ("double", "9e-05", 9e-05),
        ("double", "8.7d", 8.7),
        ("double", "3", 3.0),
        ("double", "-inf", float("-inf")),
        ("double", "1" * 400, float("inf")),
        ("long double", "2.5", 2.5),
        ("string", '"a" "b"', "ab"),
        ("string", "name", "name"),
        ("string", "a::b", "a::b"),
        ("wstring", 'L"w"', "w"),
        ("string<2>", '"é日"', "é日"),
        ("char", '"c"', "c"),
        ("char", "65", "A"),
        ("wchar", '"日"', "日"),
        ("sequence<int8>", '"(1, -2)"', (1, -2)),
        ("sequence<int8>", '"()"', ()),
        ("sequence<int8, 3>", '"[1]"', (1,)),
        ("sequence<boolean>", '"(True, False, 1)"', (True, False, True)),
        ("sequence<double>", '"(1, 2.5, inf, -inf)"', (1.0, 2.5, float("inf"), float("-inf"))),
        ("sequence<string>", "\"('a, b', '\\\"')\"", ("a, b", '"')),
        ("sequence<octet>", '"(0, 255)"', (0, 255)),
    ],
)
def test_defaults_are_converted_to_the_type_of_the_member(type_: str, written: str, value: Value) -> None:
    (field,) = message(f"@default (value={written}) {type_} a;").fields
    assert field.default == value
    assert type(field.default) is type(value)


@pytest.mark.parametrize(
    ("written", "value"),
    [
        (r"\n\t\v\b\r\f\a", "\n\t\v\b\r\f\a"),
        (r"\\ \' \"", "\\ ' \""),
        (r"\101\1012\7z", "AA2\az"),
        (r"\x41\xg\x4", "A\\xg\x04"),
        (r"\u0041 \q \?", r"\u0041 \q \?"),
        (r"\\\\", "\\"),
        (r"\\\"", '"'),
    ],
)
def test_doubled_backslashes_are_halved_as_in_rosidl(written: str, value: str) -> None:
    (field,) = message(f'@default (value="{written}") string a;').fields
    assert field.default == value


def test_wide_literals_support_escapes_by_code_unit() -> None:
    (field,) = message(r'@default (value=L"\u0041\u65e5") wstring a;').fields
    assert field.default == "A日"
    assert "half of a surrogate pair" in error(r'@default (value=L"\ud800") wstring a;')


def test_constants_belong_to_the_struct_that_their_module_names() -> None:
    before = """
        const int8 ELSEWHERE = 1;
        module B_Constants { const int8 OTHER = 2; };
        module A_Constants {
            @verbatim (language="comment", text="What it " "means" "\\n" "is this")
            const long ONE = -1;
            const string TEXT = "t";
            const wstring<3> NEVER = L"n";
        };
    """
    assert error("int8 a;", before) == "constant 'NEVER' cannot be of this type"
    (one, text) = message("int8 a;", before.replace("const wstring<3>", "//")).constants
    assert one == Constant("ONE", Primitive("int32"), -1, ("What it means", "is this"))
    assert text == Constant("TEXT", String(), "t")


def test_unknown_annotations_are_ignored() -> None:
    annotated = """
        @key @optional @range(min=1, max=3) @bit_bound(8) @transfer_mode(SHMEM_REF) @unit (value="m/s")
        @verbatim (language="c++", text="not this") @verbatim (language="comment", text="This.")
        double a;
    """
    before = "@default_nested @topic(name=x)"
    (field,) = message(annotated, before).fields
    assert (field.doc, field.unit) == (("This.",), "m/s")
    assert message(annotated, '@verbatim (language="comment", text="Of it.")').doc == ("Of it.",)


def test_definitions_that_ros_does_not_use_are_ignored() -> None:
    before = """
        enum Color { @value(1) RED, GREEN };
        struct Later;
        typedef int8 unused[3];
        @comment const int8 NOWHERE = NAME;
    """
    assert message("int8 a;", before).fields == (Field("a", INT8),)


def test_includes_and_comments_are_ignored() -> None:
    comments = '#include "x.idl"\n#include <y.idl>\n// one /*\n/* two\n// */'
    text = comments + in_modules("struct A { int8 a; };")
    assert isinstance(read(f"\ufeff{text}\r\n"), Message)


def test_the_number_of_structs_determines_the_kind() -> None:
    def structs(*names: str) -> str:
        return "".join(f"struct {name} {{ int8 a; }};" for name in names)

    service = read(in_modules(structs("A_Request", "A_Response")))
    assert isinstance(service, Service)
    assert (str(service.name), str(service.response.name)) == ("p/msg/A", "p/msg/A_Response")
    assert isinstance(read(in_modules(structs("A_Goal", "A_Result", "A_Feedback"))), Action)
    assert errors(in_modules(structs("A_Response", "A_Request"))) == [
        "1:32 the name of struct 'A_Response' does not match the file",
        "1:62 the name of struct 'A_Request' does not match the file",
    ]
    wrong = "expected 1 struct (a message), 2 (a service) or 3 (an action), found"
    assert errors(in_modules("")) == [f"{wrong} 0"]
    assert errors(in_modules(structs("A", "B", "C", "D"))) == [f"{wrong} 4"]
    apart = "module p {module srv {struct A_Request {int8 a;};}; module msg {struct A_Response {int8 a;};};};"
    assert errors(apart) == ["1:72 all structs of a file must be in one module"]


def test_modules_are_package_and_namespace() -> None:
    assert read("module p { module idl { struct A { int8 a; }; }; };").name == TypeName("p", "idl", "A")
    assert errors("module q { module msg { struct A { int8 a; }; }; };") == [
        "1:8 the module is 'q', but the package is 'p'"
    ]
    assert errors("struct A { int8 a; };") == [
        "1:8 a struct must be inside 2 modules: the package and a namespace"
    ]
    deep = "module a {" * 2000 + "};" * 2000
    assert "1:38 modules are nested too deeply" in errors(deep)
    assert errors("module p { module class { struct None { int8 a; }; }; };", "class/None.idl") == [
        "1:19 module name 'class' is a keyword of Python and C++",
        "1:34 struct name 'None' is a keyword of Python",
    ]


def test_a_single_placeholder_member_is_not_a_field() -> None:
    assert message("uint8 structure_needs_at_least_one_member;").fields == ()
    assert len(message("uint8 structure_needs_at_least_one_member; int8 a;").fields) == 2


@pytest.mark.parametrize(
    ("members", "text"),
    [
        ("", "'}' is not expected here"),
        ("int8 _a;", "'_a' is not expected here"),
        ("int8 a", "'}' is not expected here"),
        ("int8 a; /* b", "the comment is not closed"),
        ("int8 class;", "field name 'class' is a keyword of Python and C++"),
        ("int8 restrict;", "field name 'restrict' is a keyword of C"),
        ("int8 a; int16 a;", "'a' is already declared"),
        ("int8 in; int8 in_;", "'in_' has the same name in Python as 'in'"),
        ("int8 in_; int8 in;", "'in' has the same name in Python as 'in_'"),
        ("int8 a[2][3];", "arrays of arrays are not supported"),
        ("sequence<int8> a[2];", "arrays of sequences are not supported"),
        ("sequence<sequence<int8>> a;", "sequences of arrays or sequences are not supported"),
        (
            "sequence<wstring<5>> a;",
            "rosidl reads 'sequence<wstring<5>>' as a sequence of at most 5 elements",
        ),
        ("int8 a[1+2];", "'+' is not expected here"),
        ("int8 a[0x3];", "hexadecimal numbers such as '0x3' are not supported"),
        ("int8 a[010];", "a number with a leading zero is octal"),
        ("int8 a[N];", "a size must be a decimal number"),
        ("int8 a[-1];", "a size must be at least 1"),
        ("wstring<N> a;", "a size must be a decimal number"),
        ("string<0> a;", "a size must be at least 1"),
        (f"int8 a[{1 << 64}];", "a size must fit in 64 bits"),
        ("int8 a[" + "9" * 5000 + "];", "the number has too many digits"),
        ("Thing a;", "unknown type 'Thing'"),
        ("q::B a;", "'q::B' does not have three parts"),
        ("any a;", "unknown type 'any'"),
        ("map<int8, int8> a;", "'map' of OMG IDL is not supported by ROS"),
        ("fixed<5,2> a;", "'fixed' of OMG IDL is not supported by ROS"),
        ("@default() int8 a;", "')' is not expected here"),
        ("@default(3) int8 a;", "expected '@default (value=...)'"),
        ("@default int8 a;", "expected '@default (value=...)'"),
        ("@default(value=300) int8 a;", "'300' is out of range for int8"),
        ("@default(value=1.0) int8 a;", "'1.0' is not an integer"),
        ("@default(value=true) boolean a;", "'true' is not a boolean"),
        ("@default(value=2) boolean a;", "'2' is not a boolean"),
        ("@default(value=x) double a;", "'x' is not a number"),
        ("@default(value=3) string a;", "expected a string in double quotes"),
        ('@default(value="abc") string<2> a;', "a string of 3 characters exceeds the bound 2"),
        ("@default(value='c') char a;", "character literals are not supported"),
        ('@default(value="cc") char a;', "'cc' is not a single char"),
        ("@default(value=128) char a;", "'128' is not a single char"),
        ('@default(value="a\nb") string a;', "a string must end on the line where it starts"),
        ("@default(value=-TRUE) boolean a;", "only numbers can have a sign"),
        ("@default(value=(1)) sequence<int8> a;", "expected a string with the value of an array"),
        ('@default(value="(1)") sequence<int8> a;', "the string is not a tuple"),
        ('@default(value="1,,") sequence<int8> a;', "the string is not a tuple"),
        (
            '@default(value="(f(),)") sequence<int8> a;',
            "an element must be a number, a string, True or False",
        ),
        ('@default(value="(1, 2)") sequence<int8, 1> a;', "expected at most 1 element, found 2"),
        ("@default(value=1) q::msg::B a;", "a member of a struct's type cannot have a default"),
        ('@default(value="()") sequence<q::msg::B> a;', "a member of a struct's type cannot have a default"),
        ("@range(min=0x1) int8 a;", "hexadecimal numbers such as '0x1' are not supported"),
        ("@range(min=01) int8 a;", "a number with a leading zero is octal"),
    ],
)
def test_unsupported_members_are_reported(members: str, text: str) -> None:
    assert error(members) == text


@pytest.mark.parametrize(
    ("before", "text"),
    [
        ("union U switch(long) { case 1: int8 a; };", "'union' of OMG IDL is not supported by ROS"),
        ("bitmask B { X };", "'bitmask' of OMG IDL is not supported by ROS"),
        ("interface I {};", "'interface' of OMG IDL is not supported by ROS"),
        ("struct B : A { int8 a; };", "':' is not expected here"),
        ("typedef int8 X; typedef int16 X;", "'X' is already defined as another type"),
        ("typedef int8 X[2]; typedef X Y[3];", "arrays of arrays are not supported"),
        ("typedef int8 X[2]; typedef sequence<X> Y;", "sequences of arrays or sequences are not supported"),
        ("typedef Y X;", "unknown type 'Y'"),
        ("enum E { X }; typedef E Y;", "'E' is an enum, which ROS does not support as the type of a member"),
        ("module A_Constants { const int8 X = 1; const int8 X = 1; };", "'X' is already declared"),
        ("module A_Constants { const int8 new = 1; };", "constant name 'new' is a keyword of C++"),
        ("module A_Constants { const int8 X = 1 + 1; };", "'+' is not expected here"),
        ("\n#define X 1\n", "the only supported preprocessor directive is #include"),
    ],
)
def test_definitions_that_rosidl_rejects_are_reported(before: str, text: str) -> None:
    assert error("int8 a;", before) == text


def test_all_errors_are_reported_with_their_line() -> None:
    text = "module p {\n  module msg {\n    struct A {\n      int8 class;\n\tnope b;\n    };\n  };\n};\n"
    with pytest.raises(InterfaceError) as caught:
        read(text)
    assert str(caught.value).splitlines() == [
        "msg/A.idl:4:12: error: field name 'class' is a keyword of Python and C++",
        "          int8 class;",
        "               ^",
        "hint: rename it, for example to 'class_value'",
        "msg/A.idl:5:2: error: unknown type 'nope'",
        "    \tnope b;",
        "    \t^",
        "hint: write the full name of a message: 'package::msg::Name'",
    ]
    assert errors("module p {\n") == ["1:11 unexpected end of file"]


def test_error_prone_idl_is_a_warning() -> None:
    text = in_modules("struct A { int8 a[3], b; @default(value=1) @default(value=2) int8 c; };")
    reader = read_idl(Source("p", "msg/A.idl", Path("A.idl"), text))
    assert [warning.message for warning in reader.warnings] == [
        "rosidl before Rolling declares all of these as arrays",
        "rosidl ignores the default if there are several",
    ]
    interface = reader.interface()
    assert isinstance(interface, Message)
    assert interface.fields[2].default is None


@given(
    st.text(st.characters(codec="utf-8")),
    st.text(st.sampled_from("\\\\\"'ntu0419x ")),
    st.lists(st.text(st.sampled_from("a\\\\\"'é "), min_size=1)),
)
def test_any_text_survives_a_round_trip_through_idl(value: str, escapes: str, parts: list[str]) -> None:
    name = TypeName("p", "msg", "A")
    fields = (
        Field("a", String(), value, doc=("first", f"{escapes}."), unit=f"{escapes}."),
        Field("b", String(wide=True), escapes),
        Field("c", Sequence(String()), tuple(parts)),
    )
    written = Message(name, fields, doc=(f".{value}.",) if value.isprintable() else ())
    assert read(idl_text(written, "origin")) == written


@pytest.mark.parametrize("package", sorted(LIBRARY.packages()))
def test_embedded_interfaces_survive_a_round_trip(package: str) -> None:
    for parsed in parse_all(read_folder(package, LIBRARY.packages()[package])):
        _assert_same(package, parsed.interface)


def test_all_features_survive_a_round_trip() -> None:
    for folder in ("idl", "show", "cpp", "python"):
        source = GOLDEN / "interfaces" / folder / "src"
        if source.is_dir():
            for parsed in parse_all(read_folder("tour", source)):
                _assert_same("tour", parsed.interface)


def _assert_same(package: str, interface: Interface) -> None:
    relative = f"{interface.name.kind}/{interface.name.name}.idl"
    text = idl_text(interface, "origin")
    assert parse(Source(package, relative, Path(relative), text)) == interface


def test_annotations_without_effect_give_a_warning() -> None:
    """Other tools for DDS write other bytes because of them."""
    text = in_modules('@mutable struct A { @key @unit(value="m") int8 a; @optional int8 b; };')
    reader = read_idl(Source("p", "msg/A.idl", Path("A.idl"), text))
    assert sorted(warning.message for warning in reader.warnings) == [
        f"ROS ignores '@{name}': values are serialized as without it"
        for name in ("key", "mutable", "optional")
    ]
