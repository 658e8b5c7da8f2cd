"""The wire format in C++: what headers say about messages, and programs that write, read and are lied to.

FORGE_CDR_MUTATIONS sets how many spoilt buffers of each type are read.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.cdr import MembersView, MembersViews
from forge.interfaces.model import TypeName
from forge.interfaces.read.sources import EMBEDDED, Library
from forge.interfaces.resolve.dependencies import dependency_catalogs
from forge.interfaces.wire.flattening import INLINE_LIMIT, LayoutBuilder
from tests.generated import catalog_of, embedded_catalog

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.interfaces.model import Catalog

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
SANITIZED = ("-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
MUTATIONS = os.environ.get("FORGE_CDR_MUTATIONS", "500")
PACKAGES = ("example_interfaces", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs")
MANY = "\n".join(
    f"string s{number}\nint8 n{number}\nfloat64[] d{number}" for number in range(INLINE_LIMIT // 2)
)
DEFINITIONS = {
    "Around": "int8 a\nLarge[] many\nLarge[2] two\nLarge one\nfloat64 b\nFirst[] first",
    "Arr": "uint8 a\nfloat64[1] b\nuint8[3] c\nuint32[2] d",
    "BasicTypes": "bool a\nbyte b\nchar c\nfloat32 d\nfloat64 e\nint8 f\nuint8 g\nint16 h\nuint16 i\n"
    "int32 j\nuint32 k\nint64 l\nuint64 m",
    "Big": "uint8 a\nint64 b\nuint8 c\nint32 d\nuint8 e\nint16 f",
    "Bnd": "string<=10 s\nint32[<=4] v\nuint8 t",
    "Collections": "bool[<=3] flags\nbyte[] octets\nint8[] small\nuint16[] middle\nfloat32[<=5] few\n"
    "int64[100] large\nbool[600] larger\nMixed[] mixed\nMixed[3] three\nTight[] tight\nTight[2] two\n"
    "Late[] late\nFlag[] flag\nstd_msgs/Empty[] empty\nwstring[] wide\nstring<=3[<=2] brief\nWhole[] whole",
    "EmptyIn": "std_msgs/Empty e\nuint32 x",
    "First": "Large one\nint8 a",
    "Flag": "uint8 number\nbool flag",
    "Inner": "uint8 a\nfloat64 b",
    "Large": MANY,
    "Late": "int32 a\nint32 b\nfloat64 c",
    "Mixed": "float64 a\nuint8 b",
    "Nest": "uint8 p\nInner[2] arr\nInner[<=3] seq\nuint8 q",
    "Seq": "float64[] e\nuint8 b\nfloat64[] f",
    "Strs": "string[] a\nstring[2] b\nbool[] c\nbool[3] d\nuint16 e",
    "Tight": "float64 a\nint32 b\nint16[2] c",
    "W": "wstring w\nuint8 t\nwstring[] ws\nwstring[2] wa",
    "Whole": "Tight tight\nfloat64[600] more",
}
LETTERS = (
    "module wire { module msg { struct Letters { char narrow; wchar wide; sequence<char> few;\n"
    "sequence<wchar> many; wchar row[3]; octet last; }; }; };"
)


def wire_catalog() -> Catalog:
    """Return the catalog of the package that the programs use."""
    definitions = {f"msg/{name}.msg": text for name, text in DEFINITIONS.items()}
    return catalog_of("wire", definitions | {"msg/Letters.idl": LETTERS})


@pytest.fixture(scope="module")
def include(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate the headers that the programs use."""
    folder = tmp_path_factory.mktemp("include")
    own = [wire_catalog(), *map(embedded_catalog, PACKAGES)]
    for catalog in (*own, *(other for each in own for other in dependency_catalogs(each, Library()))):
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    return folder


@pytest.mark.parametrize(
    ("compiler", "options"),
    [
        pytest.param("g++", ("-std=c++17", *SANITIZED), marks=pytest.mark.needs("g++")),
        pytest.param("clang++", ("-std=c++20", "-O1"), marks=pytest.mark.needs("clang++")),
    ],
)
def test_bytes_are_right_and_wrong_ones_refused(
    compiler: str, options: tuple[str, ...], include: Path, tmp_path: Path
) -> None:
    """The program compiles without a warning; every check holds, those of spoilt bytes included."""
    program = tmp_path / "cdr"
    folders = ("-I", include, "-I", RUNTIME, "-I", HERE)
    argv: list[str | Path] = [
        compiler,
        *options,
        *WARNINGS,
        *folders,
        HERE / "cdr.cpp",
        "-o",
        program,
    ]
    made = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr[:4000]
    ran = subprocess.run([program, MUTATIONS], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr[:4000]) == (0, "")


def view(text: str, **others: str) -> MembersView:
    """Return what is said about a message of this definition."""
    catalog = catalog_of("demo", {f"msg/{name}.msg": each for name, each in {**others, "X": text}.items()})
    return MembersViews(LayoutBuilder(catalog.known)).of(TypeName("demo", "msg", "X"))


def statements(text: str, **others: str) -> list[str]:
    """Return the statements in the definition's words, without what they all have."""
    return [each.replace("message.", "").removeprefix("cdr.") for each in view(text, **others).statements]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("int32 a\nint16 b\nint8 c", ["fixed(a, b, c);"]),
        ("int8 a\nint64 b\nint8 c\nint32 d", ["fixed(a);", "fixed(b, c, d);"]),
        ("int32 a\nstring b\nint32 c", ["fixed(a);", "text(b);", "fixed(c);"]),
        ("float64[3] a\nfloat64[1000] b", ["fixed(a);", "fixed(b);"]),
        ("string[2] a\nstring[] b\nbool[<=3] c", ["array(a);", "sequence(b);", "sequence(c);"]),
        ("Inner a\nInner[2] b\nInner[] c", ["fixed(a);", "array(b);", "sequence(c);"]),
        ("", ["fixed(structure_needs_at_least_one_member);"]),
        ("Large a\nint8 b", ["message(a);", "fixed(b);"]),
        ("Pair a\nint8 b\nPair[2] c", ["fixed(a.inner, a.other, b);", "array(c);"]),
    ],
)
def test_neighbours_of_fixed_size_are_moved_together(text: str, expected: list[str]) -> None:
    """A run ends where padding would depend on what comes before it."""
    pair = "Inner inner\nint8 other"
    assert statements(text, Inner="float64 x", Large=MANY, Pair=pair) == expected


def test_a_long_statement_has_several_lines() -> None:
    text = "\n".join(f"float64 some_member_with_a_name_{number}" for number in range(5))
    (statement,) = view(text).statements
    first, *lines = statement.splitlines()
    assert first == "cdr.fixed("
    assert all(line.startswith("      message.") and len(line) <= 100 for line in lines)
    assert statement.endswith("_4);")


@pytest.mark.parametrize(
    ("text", "size", "alignment"),
    [
        ("float64 x\nfloat64 y", 16, 8),
        ("int32 sec\nuint32 nanosec", 8, 4),
        ("uint8[16] uuid", 16, 1),
        ("float64 a\nint32 b\nint16[2] c", 16, 8),
        ("Inner a\nInner b", 16, 8),
        ("int32 a\nint32 b\nfloat64 c", 0, 0),
        ("float64 a\nint8 b", 0, 0),
        ("int8 a\nint16 b", 0, 0),
        ("uint8 a\nbool b", 0, 0),
        ("bool[2] a", 0, 0),
        ("float64[1000] a", 0, 0),
        ("float64 a\nfloat64[] b", 0, 0),
        ("string a", 0, 0),
        ("Inner[2] a", 0, 0),
    ],
)
def test_only_messages_without_padding_are_packed(text: str, size: int, alignment: int) -> None:
    """What is called packed has the same bytes wherever it lies; no bool is, as not every byte is one."""
    expected = (f"packed = {size};", *([f"alignment = {alignment};"] if size else []))
    assert view(text, Inner="float64 x").constants[1:] == expected


@pytest.mark.parametrize(
    ("text", "least"),
    [
        ("string a\nint8 b", 5),
        ("float64[2] a\nint8[] b", 20),
        ("Inner[3] a\nInner[] b", 16),
        ("Large a\nint8 b", INLINE_LIMIT // 2 * 9 + 1),
        ("Large[2] a\nLarge[] b", INLINE_LIMIT // 2 * 18 + 4),
        ("", 1),
    ],
)
def test_the_least_size_counts_no_padding(text: str, least: int) -> None:
    assert view(text, Inner="string x", Large=MANY).constants[0] == f"least = {least};"


def _headers(names: Iterable[str]) -> list[str]:
    return [f"demo/msg/detail/{name}__cdr.hpp" for name in names]


def test_a_header_includes_those_of_messages_that_stay_whole() -> None:
    """Those that are unfolded need no header, but what is whole inside them does."""
    definitions = {
        "msg/A.msg": "Flat flat\nElement[] elements\nOuter outer\nLoose loose",
        "msg/Flat.msg": "int8 x",
        "msg/Loose.msg": "bool x",
        "msg/Element.msg": "string x",
        "msg/Outer.msg": "Inner[2] inner",
        "msg/Inner.msg": "string x",
    }
    catalog = catalog_of("demo", definitions)
    text = next(file.text for file in cpp.files(catalog) if file.path.endswith("/a__cdr.hpp"))
    included = [line.split('"')[1] for line in text.splitlines() if line.startswith('#include "')]
    assert included == ["demo/msg/detail/a__struct.hpp", *_headers(["element", "flat", "inner"])]
