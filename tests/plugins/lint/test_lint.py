"""`--strict`: error-prone definitions, and definitions that rosidl reads differently."""

from pathlib import Path

import pytest

from forge.interfaces.model import Source
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.plugins.lint.lint import lint
from tests.conftest import Forge, Tree
from tests.generated import reads_idl


def messages_of(text: str, relative: str = "msg/A.msg") -> list[str]:
    """Return the messages about a file, each with line and column."""
    found = lint(parse_all([Source("p", relative, Path(relative), text)]))
    return [f"{p.location.line}:{p.location.column} {p.message}" for p in found if p.location]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("int8 requires", "1:6 avoid the field name 'requires': it is a keyword of C++20"),
        ("int8[<=2] in", "1:11 field name 'in' is a keyword of Python, where it becomes 'in_'"),
        ("int8 errno", "1:6 avoid the field name 'errno': it is a macro in common headers"),
        ("int8 unix", "1:6 avoid the field name 'unix': it is a macro in common headers"),
        (
            "int8 get_fields_and_field_types",
            "1:6 avoid the field name 'get_fields_and_field_types': it shadows a method of the Python class",
        ),
        ("float64 NAN=0", "1:9 avoid the constant name 'NAN': it is a macro of C or Windows"),
        (
            "int8 S_GO=1\nint8 S_OFF=0\nint8 S_STOP=1",
            "3:6 'S_STOP' and 'S_GO' have the same value",
        ),
        ('string a "a#b"', "1:12 the string ends at '#', which starts a comment"),
        ("string A='a#b'", "1:12 the string ends at '#', which starts a comment"),
        ('string a "abc', "1:10 this quote is not closed and becomes part of the string"),
        ('string a "a\tb"', "1:12 a tab in a string becomes a space"),
        (r'string a "a\nb"', r"1:12 rosidl interprets the escape '\n' differently, or fails"),
        (r'string a "a\\b"', r"1:12 rosidl interprets the escape '\\' differently, or fails"),
        (r"string A=C:\Users", r"1:12 rosidl interprets the escape '\U' differently, or fails"),
        ("string[] a ['a' 'b']", "1:12 two strings without a comma between them become two elements"),
        ("string[] a ['é']", "1:12 rosidl fails on non-ASCII characters in string arrays"),
        ("int8 a 017", "1:8 '017' is decimal, though it looks octal"),
        ("int8[] a [1, -010]", "1:14 '-010' is decimal, though it looks octal"),
        ("int8 A=007", "1:8 '007' is decimal, though it looks octal"),
        ("int8 a ٣", "1:8 '٣' contains non-ASCII digits"),
        ("float64 a nan", "1:11 rosidl generates code for 'nan' that does not compile"),
        ("float32[] a [0, -inf]", "1:17 rosidl generates code for '-inf' that does not compile"),
        ("float32 a 1e39", "1:11 '1e39' is too large for the type and becomes infinite"),
        ("float64 a -1e400", "1:11 '-1e400' is too large for the type and becomes infinite"),
        (
            "float64 a # in [0.0-1.0]",
            "1:16 '0.0-1.0' is parsed as the unit of the field and removed from the comment",
        ),
        ("int8 a # [0]", "1:10 '0' is parsed as the unit of the field and removed from the comment"),
        (
            "string a # [this is its link](http://x)",
            "1:12 'this is its link' is parsed as the unit of the field and removed from the comment",
        ),
        (r"int8 a # C:\Users", "1:12 rosidl reads a backslash in a comment as the start of an escape"),
        ("# K[0] == 0\nint8 a", "1:4 '[0]' is parsed as a unit and removed from the comment"),
        ("uint8 structure_needs_at_least_one_member\nint8 a", "1:7 this name is reserved for empty messages"),
    ],
)
def test_error_prone_definitions_are_reported_with_their_position(line: str, message: str) -> None:
    assert messages_of(line) == [message]


@pytest.mark.parametrize(
    "line",
    [
        "int8 a 0",
        "int8 a 0x1F",
        "int8 a 00",
        "int8 a -10",
        "float64 a 0.5",
        "float64 a 1.",
        "float32[2] a [1e38, 3.4e38]",
        "float64 a # [m/s^2]",
        "float64 a # [°]",
        "float64 a # [kg m^2] of it",
        "int8 a # [0] or [1]",
        'string a "it\'s"',
        r"string a 'it\'s'",
        r'string a "a\tb"',
        "string[] a ['a', \"b\"]",
        "wstring a 'é'",
        "int8 DELETE=1",
        "int8 property",
        "string a",
        "int8[] a []",
    ],
)
def test_common_definitions_are_accepted(line: str) -> None:
    assert messages_of(line) == []


@reads_idl
def test_sections_and_idl_files_are_checked() -> None:
    assert messages_of("int8 errno\n---\nint8 linux", "srv/A.srv") == [
        "1:6 avoid the field name 'errno': it is a macro in common headers",
        "3:6 avoid the field name 'linux': it is a macro in common headers",
    ]
    text = "module p { module msg { struct A { int8 a[2], errno; }; }; };"
    assert messages_of(text, "msg/A.idl") == [
        "1:47 rosidl before Rolling declares all of these as arrays",
        "1:47 avoid the field name 'errno': it is a macro in common headers",
    ]


def test_strict_turns_warnings_into_errors(forge: Forge, tree: Tree) -> None:
    root = tree({"src/msg/A.msg": "int8 a 017\nint8 errno\n"})
    arguments = ["--package", "tour", "src"]
    assert forge("interface", "generate", "--output", "out", *arguments, cwd=root).code == 0
    ran = forge("interface", "generate", "--output", "strict", "--strict", *arguments, cwd=root)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.splitlines() == [
        "src/msg/A.msg:1:8: error: '017' is decimal, though it looks octal",
        "    int8 a 017",
        "           ^",
        "hint: write 17, or 0o17 for the octal number",
        "src/msg/A.msg:2:6: error: avoid the field name 'errno': it is a macro in common headers",
        "    int8 errno",
        "         ^",
        "hint: rename it, for example to 'errno_value'",
    ]
    assert not (root / "strict").exists()


@pytest.mark.parametrize("package", sorted(Library().packages()))
def test_embedded_definitions_pass_strict(package: str) -> None:
    assert lint(parse_all(read_folder(package, Library().packages()[package]))) == []


@pytest.mark.parametrize(
    "text",
    [
        "float32 level # enum: LEVEL_*\nuint8 LEVEL_LOW=0",
        "uint8 level # enum: LEVEL_*",
        "int8 level # enum: LEVEL_*\nuint8 LEVEL_HIGH=200",
        "uint8 level # enum: LEVEL_*\nuint8 LEVEL_LOW=0\nstring LEVEL_NAME=low",
    ],
)
def test_enumerations_without_matching_constants_are_error_prone(text: str, tree: Tree, forge: Forge) -> None:
    root = tree({"msg/Tank.msg": text})
    words = ("interface", "generate", str(root), "--package", "tanks", "--output", str(root / "out"))
    assert forge(*words).code == 0
    ran = forge(*words, "--strict")
    assert ran.code == 2
    assert "error: 'enum: LEVEL_*' does not define an enumeration for 'level'" in ran.err
