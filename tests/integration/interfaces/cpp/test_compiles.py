"""Generated C++ compiles, and a program uses it as ROS programs do."""

import subprocess
from collections.abc import Iterator
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
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    TypeName,
    messages_of,
)
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import resolve
from tests.generated import catalog_of, difficult_constants, embedded_catalog

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
PACKAGES = (
    "action_msgs",
    "builtin_interfaces",
    "example_interfaces",
    "geometry_msgs",
    "rcl_interfaces",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "unique_identifier_msgs",
)
SAMPLE = (
    "example_interfaces/action/detail/fibonacci__builder.hpp",
    "example_interfaces/action/detail/fibonacci__cdr.hpp",
    "example_interfaces/action/detail/fibonacci__struct.hpp",
    "example_interfaces/action/detail/fibonacci__traits.hpp",
    "example_interfaces/action/detail/fibonacci__type_support.hpp",
    "rcl_interfaces/msg/detail/parameter_descriptor__struct.hpp",
    "sensor_msgs/msg/image.hpp",
    "std_msgs/msg/rosidl_generator_cpp__visibility_control.hpp",
    "std_srvs/srv/detail/empty__traits.hpp",
)

MEMBERS = """\
bool flag {flag}
byte octet {octet}
int8 i8 {i8}
int64 i64 {i64}
uint64 u64 {u64}
float32 single {tenth}
float64 real {tenth}
string text {text}
wstring wide {wide}
int32[3] three {three}
int32[] many {many}
int32[<=4] some {some}
bool[] flags {flags}
string[2] pair {pair}
string[] words {words}
"""
VALUES = {
    "flag": "true",
    "octet": "255",
    "i8": "-128",
    "i64": "-9223372036854775808",
    "u64": "18446744073709551615",
    "tenth": "0.1",
    "text": 'it\'s "so"',
    "wide": '"Hellö wörld!"',
    "three": "[1, -2, -2147483648]",
    "many": "[7]",
    "some": "[5, 6]",
    "flags": "[true, false]",
    "pair": '["a,b", c]',
    "words": "[x, y]",
}
NAMES = [
    "build",
    "builder",
    "data",
    "geometry_msgs",
    "init",
    "main",
    "message",
    "move",
    "msg",
    "name",
    "probe",
    "rosidl_runtime_cpp",
    "size_t",
    "std",
    "string",
    "type",
    "uint8_t",
    "vector",
]
DEFINITIONS = {
    "Bounded": "string<=3[<=2] words\nwstring<=4 wide\nint8[<=3] some\n",
    "Defaults": MEMBERS.format_map(VALUES),
    "Empty": "",
    "HTTPServer": "int64 low -9223372036854775808\nuint64 high\nfloat32 bad nan\nfloat64 far -inf\n",
    "Names": "".join(f"uint8 {name}\n" for name in NAMES) + "geometry_msgs/Point point\n",
    "Nest": "Defaults one\nDefaults[2] fixed\nDefaults[<=2] few\nDefaults[] any\nEmpty[] nothing\n",
    "Nothings": "Empty one\nEmpty[] several\n",
    "Plain": MEMBERS.format_map(dict.fromkeys(VALUES, "")),
    "Points": "geometry_msgs/Point[] items\n",
    "Small": "int8 i8 -5\nuint8 u8 200\nbyte octet 10\nbyte[] octets\nuint8[] numbers\nuint8[] none\n"
    "float64[2] reals\nstring[] names\nbool[<=2] flags\n"
    "geometry_msgs/Point point\ngeometry_msgs/Point[] points\n",
    "Strings": "string text\nstring[] words\n",
}


def wide() -> Message:
    """Return a message of the types that exist only in IDL."""
    fields = (
        Field("letter", Primitive("wchar")),
        Field("letters", Sequence(Primitive("wchar"))),
        Field("text", String(wide=True)),
        Field("signs", Array(Primitive("char"), 2)),
    )
    return Message(TypeName("probe", "msg", "Wide"), fields)


def catalogs() -> Iterator[Catalog]:
    """Yield the packages that the program uses."""
    yield from map(embedded_catalog, PACKAGES)
    definitions = {f"msg/{name}.msg": text for name, text in DEFINITIONS.items()}
    yield catalog_of("probe", definitions, difficult_constants(), wide())


@pytest.fixture(scope="module")
def include(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate all headers of all packages once."""
    folder = tmp_path_factory.mktemp("include")
    for catalog in (*catalogs(), *odd_packages()):
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    return folder


def odd_packages() -> Iterator[Catalog]:
    """Yield packages named like the namespaces inside a package."""
    for package in ("action", "builder", "detail", "msg", "srv"):
        own = Named(TypeName(package, "msg", "Inner"))
        inner = Message(own.name, (Field("x", Primitive("int8")),))
        outer = Message(TypeName(package, "msg", "Outer"), (Field("one", own), Field("all", Sequence(own))))
        service = Service(
            TypeName(package, "srv", "Ask"),
            Message(TypeName(package, "srv", "Ask_Request"), (Field("one", own),)),
            Message(TypeName(package, "srv", "Ask_Response")),
        )
        interfaces = (inner, outer, service)
        known = {message.name: message for each in interfaces for message in messages_of(each)}
        yield Catalog(package, {each.name: each for each in interfaces}, known, {})


def compile_cleanly(compiler: str, standard: str, include: Path, *arguments: str | Path) -> None:
    """Run the compiler with strict warnings; fail with its output."""
    folders = ("-I", include, "-I", RUNTIME)
    argv = [compiler, f"-std={standard}", *WARNINGS, *folders, *arguments]
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.parametrize(
    ("compiler", "standard", "optimization"),
    [
        pytest.param("g++", "c++17", "-O1", marks=pytest.mark.needs("g++")),
        pytest.param("clang++", "c++20", "-O0", marks=pytest.mark.needs("clang++")),
    ],
)
def test_a_ros_style_program_compiles_and_runs(
    compiler: str, standard: str, optimization: str, include: Path, tmp_path: Path
) -> None:
    """The headers compile without warnings, optimized by GCC, and all checks of the program pass."""
    program = tmp_path / "program"
    compile_cleanly(compiler, standard, include, optimization, HERE / "program.cpp", "-o", program)
    ran = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize("standard", ["c++17", "c++20"])
@pytest.mark.needs("g++")
def test_messages_can_be_hashed_and_formatted(standard: str, include: Path, tmp_path: Path) -> None:
    """In both standards; `std::hash` and `std::format` only in the newer one."""
    program = tmp_path / "extras"
    compile_cleanly("g++", standard, include, HERE / "extras.cpp", "-o", program)
    ran = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.needs("g++")
def test_programs_can_ask_for_definitions_and_units(tmp_path: Path) -> None:
    """Also of the parts of services and actions; the text is that of the file, with all its signs."""
    odd = '# \u00e4 \U0001f600 ??/ "q" \\u \\\r\n#\t*/ %s \x1b\n\n'
    texts = {
        "msg/A.msg": f"{odd}int8 speed  # how fast [m/s]\nint8 other\nint8 small  # [\u00b5m]\n",
        "msg/E.msg": "",
        "srv/S.srv": f"int8 a  # [m]\n---\n{odd}int8 b  # [K]\n",
        "action/G.action": "int8 a\n---\nint8 b  # [s]\n---\nint8 c",
    }
    sources = [Source("p", path, Path(path), text) for path, text in texts.items()]
    for file in cpp.files(resolve("p", parse_all(sources), Library())):
        write_if_changed(tmp_path / file.path, file.text)
    for catalog in catalogs():
        if catalog.package in {"action_msgs", "builtin_interfaces", "unique_identifier_msgs"}:
            for file in cpp.files(catalog):
                write_if_changed(tmp_path / file.path, file.text)
    program, source = tmp_path / "program", tmp_path / "main.cpp"
    asked = (
        *("msg::A", "msg::E", "srv::S", "srv::S::Response"),
        *("action::G", "action::G::Feedback", "action::G::Impl::SendGoalService::Request"),
    )
    headers = ("action/g.hpp", "msg/a.hpp", "msg/e.hpp", "srv/s.hpp")
    source.write_text(
        "#include <iostream>\n"
        + "".join(f'#include "p/{each}"\n' for each in headers)
        + "using namespace rosidl_generator_traits;\n"
        + 'static_assert(unit<p::msg::A>("speed") == "m/s" && unit<p::msg::A>("other").empty());\n'
        + 'static_assert(unit<p::msg::A>("small") == "\\302\\265m" && unit<p::msg::E>("x").empty());\n'
        + 'static_assert(unit<p::srv::S::Response>("b") == "K" && unit<p::action::G::Result>("b") == "s");\n'
        + 'static_assert(unit<p::srv::S::Response>("a").empty() && unit<p::srv::S>("a").empty());\n'
        + "int main()\n{\n"
        + "".join(f"  std::cout << definition<p::{each}>() << '\\0';\n" for each in asked)
        + "}\n",
        encoding="utf-8",
    )
    compile_cleanly("g++", "c++17", tmp_path, "-DROSIDL_RUNTIME_CPP_DEFINITIONS", source, "-o", program)
    ran = subprocess.run([program], capture_output=True, check=True)
    a, e, s, g = texts.values()
    assert ran.stdout.decode().split("\0") == [a, e, s, s, g, g, g, ""]


@pytest.mark.needs("g++")
def test_each_header_is_self_contained(include: Path, tmp_path: Path) -> None:
    sources = []
    for header in SAMPLE:
        source = tmp_path / f"{PurePosixPath(header).stem}.cpp"
        source.write_text(f'#include "{header}"\n', encoding="utf-8")
        sources.append(source)
    compile_cleanly("g++", "c++17", include, "-fsyntax-only", *sources)


@pytest.mark.parametrize(
    "compiler", [pytest.param(name, marks=pytest.mark.needs(name)) for name in ("g++", "clang++")]
)
@pytest.mark.parametrize(
    "header",
    [
        *("std_msgs/msg/string.hpp", "probe/msg/bounded.hpp", "rosidl_runtime_cpp/yaml.hpp"),
        "rosidl_runtime_cpp/format.hpp",
        *sorted(path.relative_to(RUNTIME).as_posix() for path in RUNTIME.glob("forge_cdr/**/*.hpp")),
    ],
)
def test_older_standards_are_rejected_with_a_remedy(
    header: str, compiler: str, include: Path, tmp_path: Path
) -> None:
    """The first error names it, whichever header comes first."""
    source = tmp_path / "main.cpp"
    source.write_text(f'#include "{header}"\n', encoding="utf-8")
    argv = (compiler, "-std=c++14", "-fsyntax-only", "-I", include, "-I", RUNTIME, source)
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    first = next((line for line in done.stderr.splitlines() if "error:" in line), "")
    assert "generated messages need C++17: set(CMAKE_CXX_STANDARD 17)" in first


@pytest.mark.needs("g++")
def test_all_headers_compile_together(include: Path, tmp_path: Path) -> None:
    """A file that includes all headers compiles without warnings, even with the macros of Windows."""
    headers = sorted(path.relative_to(include).as_posix() for path in include.glob("*/*/*.hpp"))
    assert len(headers) > 100
    macros = "".join(f"#define {name} (0)\n" for name in ("DELETE", "ERROR", "NO_ERROR"))
    source = tmp_path / "all.cpp"
    source.write_text(macros + "".join(f'#include "{header}"\n' for header in headers), encoding="utf-8")
    compile_cleanly("g++", "c++17", include, "-fsyntax-only", source)


@pytest.mark.needs("gcc")
def test_type_support_can_be_declared_in_c(tmp_path: Path) -> None:
    """The headers of rosidl_runtime_c are C99, and their macros give rosidl's names."""
    headers = sorted(path.relative_to(RUNTIME).as_posix() for path in RUNTIME.glob("rosidl_runtime_c/*.h"))
    macro = "ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME(rosidl_typesupport_c, std_msgs, msg, String)"
    name = "rosidl_typesupport_c__get_message_type_support_handle__std_msgs__msg__String"
    source = tmp_path / "main.c"
    lines = [f'#include "{header}"' for header in headers]
    lines += [f"const rosidl_message_type_support_t * {macro}(void);"]
    lines += [f"const void * use(void) {{ return {name}(); }}"]
    lines += ["const void * get(void) { return ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, String); }"]
    source.write_text("\n".join(lines) + "\n", encoding="utf-8")
    compile_cleanly("gcc", "c99", tmp_path, "-fsyntax-only", source)
