"""Generated C: it compiles, and a C program uses it."""

import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.model import (
    Array,
    Catalog,
    Field,
    Message,
    Primitive,
    Sequence,
    String,
    TypeName,
)
from forge.interfaces.read.sources import Library
from forge.plugins.c_target import target as c
from tests.generated import catalog_of, difficult_constants, embedded_catalog

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")
DEFINITIONS = {
    "Bounded": "string<=3[<=2] words\nwstring<=4 wide\nint8[<=3] some\nstring<=4000000000 endless\n",
    "Defaults": """\
bool flag true
byte octet 255
int8 i8 -128
int64 i64 -9223372036854775808
uint64 u64 18446744073709551615
float32 single 0.1
float64 real 0.1
string text 'it\\'s "so"'
wstring wide "Hellö wörld!"
int32[3] three [1, -2, -2147483648]
int32[] many [7]
int32[<=4] some [5, 6]
bool[] flags [true, false]
string[2] pair ["a,b", c]
string[] words [x, y]
""",
    "Empty": "",
    "Names": "".join(
        f"uint8[2] {name}\n"
        for name in ["data", "done", "equal", "i", "input", "lhs", "linear", "message", "output"]
    )
    + "string size\nstring[2] capacity\nbool array\nwstring[2] pair ['a', '']\nwstring pair_0 'b'\n",
    "Nest": "Defaults one\nDefaults[2] fixed\nDefaults[<=2] few\nDefaults[] any\nEmpty[] nothing\n",
}


def wide() -> Message:
    """Return a message of the types that only IDL can say, and of odd defaults."""
    fields = (
        Field("letter", Primitive("wchar")),
        Field("letters", Sequence(Primitive("wchar"))),
        Field("precise", Primitive("long double"), 1.5),
        Field("endless", Primitive("long double"), float("inf")),
        Field("exact", Sequence(Primitive("long double")), (1.0, float("-inf"))),
        Field("signs", Array(Primitive("char"), 2)),
        Field("sign", Primitive("char"), 200),
        Field("tiny", Array(Primitive("float"), 2), (1e-60, float("nan"))),
        Field("inside", String(), "a\0b"),
        Field("half", String(wide=True), "\ud800'\\"),
        Field("texts", Sequence(String(wide=True)), ("one", "", "two")),
    )
    return Message(TypeName("probe", "msg", "Wide"), fields)


def catalogs() -> Iterator[Catalog]:
    """Yield all embedded packages, and one of odd messages."""
    yield from map(embedded_catalog, Library().packages())
    definitions = {f"msg/{name}.msg": text for name, text in DEFINITIONS.items()}
    yield catalog_of("probe", definitions, difficult_constants(), wide())


def without_long_doubles(catalog: Catalog) -> Catalog:
    """Return a catalog without the interface that C++ does not support."""
    kept = {name: interface for name, interface in catalog.interfaces.items() if name.name != "Wide"}
    return replace(catalog, interfaces=kept)


@pytest.fixture(scope="module")
def include(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate all headers once, for C and for C++ into one folder, as they are installed."""
    folder = tmp_path_factory.mktemp("include")
    for catalog in catalogs():
        of_c = {file.path: file.text for file in c.files(catalog)}
        of_cpp = {file.path: file.text for file in cpp.files(without_long_doubles(catalog))}
        assert not of_c.keys() & of_cpp.keys()
        for path, text in {**of_c, **of_cpp}.items():
            write_if_changed(folder / path, text)
    return folder


def compile_cleanly(argv: tuple[str, ...], include: Path, *arguments: str | Path) -> None:
    """Compile with strict warnings; fail with the output of the compiler."""
    line = [*argv, *WARNINGS, "-I", include, "-I", RUNTIME, *arguments]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]


C99 = ("gcc", "-std=c99")
CPP17 = ("g++", "-std=c++17", "-x", "c++")


@pytest.mark.parametrize(
    "compiler",
    [
        pytest.param((*C99, *SANITIZERS), marks=pytest.mark.needs("gcc")),
        pytest.param((*C99, "-O2"), marks=pytest.mark.needs("gcc")),
        pytest.param((*CPP17, "-O1"), marks=pytest.mark.needs("g++")),
        pytest.param(("clang", "-std=c99"), marks=pytest.mark.needs("clang")),
    ],
    ids=lambda argv: "-".join(argv[:3]),
)
def test_a_typical_c_program_compiles_and_runs(
    compiler: tuple[str, ...], include: Path, tmp_path: Path
) -> None:
    """It compiles without warnings, all checks pass, and sanitizers find no leak or invalid access."""
    program = tmp_path / "program"
    compile_cleanly(compiler, include, HERE / "program.c", "-o", program, "-lm")
    ran = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize(
    "compiler",
    [
        pytest.param((*C99, "-Wconversion"), marks=pytest.mark.needs("gcc")),
        pytest.param(CPP17, marks=pytest.mark.needs("g++")),
    ],
    ids=lambda argv: argv[0],
)
def test_all_headers_compile_together(compiler: tuple[str, ...], include: Path, tmp_path: Path) -> None:
    """A unit that includes everything has neither clashes nor warnings; one in C++ includes C++'s, too."""
    endings = ("h", "hpp") if compiler == CPP17 else ("h",)
    found = sorted(
        path.relative_to(include).as_posix() for ending in endings for path in include.glob(f"*/*/*.{ending}")
    )
    assert len(found) > 200
    source = tmp_path / "all.c"
    source.write_text("".join(f'#include "{header}"\n' for header in found), encoding="utf-8")
    compile_cleanly(compiler, include, "-fsyntax-only", source)


@pytest.mark.needs("gcc")
@pytest.mark.parametrize(
    "header",
    [
        *sorted(path.relative_to(RUNTIME).as_posix() for path in RUNTIME.glob("rosidl_runtime_c/*.h")),
        "example_interfaces/action/detail/fibonacci__functions.h",
        "example_interfaces/action/detail/fibonacci__struct.h",
        "example_interfaces/action/detail/fibonacci__type_support.h",
        "probe/msg/rosidl_generator_c__visibility_control.h",
        "probe/msg/wide.h",
    ],
)
def test_each_header_is_self_contained(header: str, include: Path, tmp_path: Path) -> None:
    source = tmp_path / f"{PurePosixPath(header).stem}.c"
    source.write_text(f'#include "{header}"\n#include "{header}"\nint used;\n', encoding="utf-8")
    compile_cleanly(C99, include, "-fsyntax-only", source)


@pytest.mark.needs("gcc")
def test_type_support_matches_the_rosidl_macros(include: Path, tmp_path: Path) -> None:
    """What the macros of rosidl_runtime_c expand to is declared, for messages, services and actions."""
    source = tmp_path / "main.c"
    lines = [
        '#include "example_interfaces/action/fibonacci.h"',
        '#include "std_srvs/srv/empty.h"',
        '#include "std_msgs/msg/string.h"',
        "const void * message(void) { return ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, String); }",
        "const void * service(void) { return ROSIDL_GET_SRV_TYPE_SUPPORT(std_srvs, srv, Empty); }",
        "const void * action(void)",
        "{ return ROSIDL_GET_ACTION_TYPE_SUPPORT(example_interfaces, Fibonacci); }",
    ]
    source.write_text("\n".join(lines) + "\n", encoding="utf-8")
    compile_cleanly(C99, include, "-fsyntax-only", source)


@pytest.mark.needs("gcc")
def test_functions_of_another_runtime_come_from_its_libraries(include: Path, tmp_path: Path) -> None:
    """If the headers of rosidl's own run time are found first, programs get its type support."""
    theirs = tmp_path / "rosidl_runtime_c" / "message_type_support_struct.h"
    theirs.parent.mkdir()
    theirs.write_text("typedef int rosidl_message_type_support_t;\n", encoding="utf-8")
    name = "rosidl_typesupport_c__get_message_type_support_handle__std_msgs__msg__String"
    source = tmp_path / "main.c"
    source.write_text(
        '#include "std_msgs/msg/string.h"\n'
        f"const int * {name}(void) {{static const int theirs = 7; return &theirs;}}\n"
        f"int main(void) {{return *{name}();}}\n",
        encoding="utf-8",
    )
    compile_cleanly((*C99, "-I", str(tmp_path)), include, source, "-o", tmp_path / "program")
    assert subprocess.run([tmp_path / "program"], check=False).returncode == 7
