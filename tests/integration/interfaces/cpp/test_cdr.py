"""Serialization in C++: a program writes and reads messages, and reads corrupt buffers.

FORGE_CDR_MUTATIONS sets the number of corrupt buffers for each type.
"""

import os
import subprocess
from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.model import Catalog
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import dependency_catalogs
from forge.interfaces.wire.layout import INLINE_LIMIT
from tests.generated import catalog_of, embedded_catalog

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
SANITIZED = ("-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-Dalways_inline=unused")
"""Not inlined, it compiles in half the time; what is inlined is the same code."""
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
    "Limits": "string<=3[<=2] brief\nwstring<=2 wide\nstring<=3[2] two",
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
def test_serialized_bytes_are_correct_and_invalid_ones_are_rejected(
    compiler: str, options: tuple[str, ...], include: Path, tmp_path: Path
) -> None:
    """The program compiles without warnings, and all checks pass, including those with corrupt bytes."""
    program = compiled(tmp_path / "cdr", include, compiler, *options)
    ran = subprocess.run([program, MUTATIONS], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr[:4000]) == (0, "")


@pytest.mark.needs("g++")
def test_gcc_inlines_serialization(include: Path, tmp_path: Path) -> None:
    """For GCC it is an error if a function that has to be inlined cannot be; Clang leaves it out."""
    program = compiled(tmp_path / "inlined", include, "g++", "-std=c++17", "-O0")
    assert subprocess.run([program], check=False).returncode == 0


def compiled(program: Path, include: Path, *words: str) -> Path:
    """Compile a program without warnings."""
    source = HERE / program.with_suffix(".cpp").name
    folders = ("-I", include, "-I", RUNTIME, "-I", HERE)
    argv: list[str | Path] = [*words, *WARNINGS, *folders, source, "-o", program]
    made = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr[:4000]
    return program
