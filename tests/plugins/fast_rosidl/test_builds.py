"""Packages whose interfaces a real rosidl generates: with forge's worker and units, and without."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import write_files
from tests.rosidl import DEBIAN, interface_package, underlay

pytestmark = [pytest.mark.slow, pytest.mark.needs(str(DEBIAN), "g++")]

FILES = {
    "msg/Plain.msg": '# A comment\nint32 X=3\nfloat64 a 1.5\nstring<=5 s "x"\nint8[3] arr [1, 2, 3]\n',
    "msg/Nested.msg": "fast_msgs/Plain[] plains\nwstring w\nfast_msgs/Plain[2] pair\n",
    "srv/Ask.srv": "int8 a\n---\nNested b\n",
}
SMALL = {"msg/Plain.msg": "int32 a\n"}
OWN_SOURCE = """
add_library(own SHARED own/a.c own/b.c)
install(TARGETS own DESTINATION lib)
"""
GENERATED_LIBRARY = """
set(folder "${CMAKE_CURRENT_BINARY_DIR}/rosidl_own")
file(WRITE "${folder}/a.c" "%s")
file(WRITE "${folder}/b.c" "static int one(void) { return 2; } int b(void) { return one(); }")
add_library(clash SHARED "${folder}/a.c" "${folder}/b.c")
install(TARGETS clash DESTINATION lib)
"""
CLASH = GENERATED_LIBRARY % "static int one(void) { return 1; } int a(void) { return one(); }"
BROKEN = GENERATED_LIBRARY % "int a(void) { return missing; }"
DESCRIBED = re.sub(r"\b([ab])\.c\b", r"\1__description.c", CLASH).replace("clash", "described")
BUILT = {
    **interface_package("fast_msgs", FILES, after=OWN_SOURCE + DESCRIBED),
    "src/fast_msgs/own/a.c": "static int one(void) { return 1; }\nint a(void) { return one(); }\n",
    "src/fast_msgs/own/b.c": "static int one(void) { return 2; }\nint b(void) { return one(); }\n",
}
GENERATED = ("rosidl_adapter", "rosidl_generator_c", "rosidl_generator_cpp")
INTROSPECTION = ("rosidl_typesupport_introspection_c", "rosidl_typesupport_introspection_cpp")


def build(root: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run forge with Debian's rosidl as the underlay."""
    environment = {**os.environ, **underlay()}
    argv = [sys.executable, "-m", "forge", "build", "--python", sys.executable, *options]
    return subprocess.run(argv, cwd=root, env=environment, capture_output=True, text=True, check=False)


def log(root: Path, package: str = "fast_msgs") -> str:
    """Return what the programs of the last build have printed."""
    return (root / "log/latest_build" / package / "stdout_stderr.log").read_text(encoding="utf-8")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def generated_files(folder: Path) -> dict[str, bytes]:
    """Return generated files; the list that rosidl_adapter writes has absolute paths."""
    return {path: data for path, data in contents(folder).items() if not path.endswith(".idls")}


def symbols(library: Path) -> list[str]:
    """Return the names that a library exports."""
    argv = ["nm", "-D", "--defined-only", "--format=just-symbols", str(library)]
    return sorted(subprocess.run(argv, capture_output=True, text=True, check=True).stdout.split())


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the workspace of a package with sources of its own that is built once for several tests."""
    root = write_files(tmp_path_factory.mktemp("built"), BUILT)
    done = build(root)
    assert done.returncode == 0, done.stderr
    return root


def test_accelerated_builds_match_rosidl(built: Path, tree: Tree) -> None:
    slow = tree(BUILT)
    done = build(slow, "--no-fast-rosidl")
    assert done.returncode == 0, done.stderr
    assert "forge: " not in log(built)
    for folder in (*GENERATED, *INTROSPECTION):
        generated = [generated_files(root / "build/fast_msgs" / folder) for root in (built, slow)]
        assert generated[0]
        assert generated[0] == generated[1]
    installed = [sorted(contents(root / "install/fast_msgs")) for root in (built, slow)]
    assert installed[0] == installed[1]
    libraries = sorted(path.name for path in (built / "install/fast_msgs/lib").glob("libfast_msgs*.so"))
    assert len(libraries) == 3  # C, and introspection of C and of C++
    for name in libraries:
        assert symbols(built / "install/fast_msgs/lib" / name) == symbols(
            slow / "install/fast_msgs/lib" / name
        )
    units = [list((root / "build/fast_msgs").rglob("unity_*.o")) for root in (built, slow)]
    assert units[0]
    assert not units[1]
    assert precompiled(built)
    assert not precompiled(slow)


def precompiled(root: Path) -> list[Path]:
    return list(root.glob("build/forge_toolchain/headers/*/*/*.gch"))


def test_precompiled_headers_are_not_inputs_of_the_package(built: Path) -> None:
    for path in precompiled(built):
        path.unlink()
    assert "1 package unchanged" in build(built).stdout


def test_printed_commands_work_outside_of_the_build(built: Path) -> None:
    environment = (built / "build/fast_msgs/.forge/environment.sh").read_text(encoding="utf-8")
    assert "FORGE_PRECOMPILED_HEADERS" not in environment
    assert "FORGE_ROSIDL_WORKER" not in environment


def test_compile_commands_name_every_generated_source(built: Path) -> None:
    entries = json.loads((built / "build/compile_commands.json").read_text(encoding="utf-8"))
    named = {Path(entry["file"]).name for entry in entries}
    assert {"plain__functions.c", "nested__functions.c", "ask__functions.c"} <= named


@pytest.mark.parametrize("name", ["own", "described"])
def test_user_sources_and_type_descriptions_are_compiled_separately(built: Path, name: str) -> None:
    """Debian's rosidl generates no descriptions yet: those of later distributions clash in one unit."""
    assert symbols(built / f"install/fast_msgs/lib/lib{name}.so") == ["a", "b"]


def test_a_changed_definition_is_regenerated_and_recompiled(built: Path) -> None:
    write_files(built, {"src/fast_msgs/msg/Plain.msg": "int32 renamed\n"})
    assert build(built).returncode == 0
    header = built / "install/fast_msgs/include/fast_msgs/fast_msgs/msg/detail/plain__struct.h"
    assert "int32_t renamed;" in header.read_text(encoding="utf-8")
    assert "1 package unchanged" in build(built).stdout


OWN_INTERFACES = """
set(sources)
foreach(name IN ITEMS a b c d e f g h i j k l)
  set(source "${CMAKE_CURRENT_BINARY_DIR}/rosidl_own/own/%s/detail/${name}.c")
  file(WRITE "${source}" "int ${name}(void) { return 1; }")
  list(APPEND sources "${source}")
endforeach()
add_library(own_%s SHARED ${sources})
"""


THIRD_PARTY = """
file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/arguments.json" "{}")
foreach(name third declined)
  add_custom_command(OUTPUT ${name}.txt
    COMMAND "${Python3_EXECUTABLE}" "${CMAKE_CURRENT_SOURCE_DIR}/${name}.py"
            --generator-arguments-file arguments.json
    COMMAND "${CMAKE_COMMAND}" -E echo "another command")
  add_custom_target(${name} ALL DEPENDS ${name}.txt)
endforeach()
"""
RUNS = "import sys\nprint('third party')\nopen('third.txt', 'w').write(sys.argv[1])\n"
FAILS_ONCE = """import os
if os.path.exists("tried"):
    print("the second time")
    open("declined.txt", "w")
else:
    open("tried", "w")
    print("in vain")
    raise ValueError("once")
"""


UNITS = {"msg": [12], "srv": [12], "action": [6, 6]}
"""The source of an action has those of two services and more, so fewer of them make a unit."""


@pytest.fixture(scope="module")
def more(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the built workspace of a package with more libraries and generators, for several tests."""
    after = CLASH + "".join(OWN_INTERFACES % (kind, kind) for kind in UNITS) + THIRD_PARTY
    files = interface_package("fast_msgs", SMALL, after=after)
    files |= {"src/fast_msgs/third.py": RUNS, "src/fast_msgs/declined.py": FAILS_ONCE}
    root = write_files(tmp_path_factory.mktemp("more"), files)
    done = build(root)
    assert done.returncode == 0, done.stderr
    return root


def test_messages_are_distributed_evenly_among_units(more: Path) -> None:
    for kind, sizes in UNITS.items():
        units = sorted((more / f"build/fast_msgs/CMakeFiles/own_{kind}.dir/Unity").glob("*.c"))
        assert [unit.read_text(encoding="utf-8").count("#include") for unit in units] == sizes


def test_third_party_generators_run_in_the_worker_or_in_their_own_process(more: Path) -> None:
    printed = log(more)
    assert printed.count("third party") == printed.count("the second time") == 1
    assert "in vain" not in printed
    assert "forge: runs declined.py in a separate process: ValueError: once" in printed.splitlines()
    assert printed.count("in a separate process") == 1


def test_sources_that_do_not_compile_together_are_compiled_separately(more: Path) -> None:
    line = "forge: the generated sources do not compile together; compiling them one by one"
    assert log(more).count(line) == 1
    assert symbols(more / "install/fast_msgs/lib/libclash.so") == ["a", "b"]
    write_files(more, {"src/fast_msgs/msg/Plain.msg": "int32 other\n"})
    assert build(more).returncode == 0
    assert line not in log(more)


def test_sources_that_do_not_compile_at_all_fail(tree: Tree) -> None:
    root = tree(interface_package("fast_msgs", SMALL, after=BROKEN))
    done = build(root)
    assert done.returncode == 1
    assert re.search("error: .missing. undeclared", done.stderr)


def test_an_invalid_definition_gives_the_error_of_rosidl(tree: Tree) -> None:
    root = tree(interface_package("fast_msgs", {"msg/Bad.idl": "module fast_msgs { module msg { }; };\n"}))
    done = build(root)
    assert done.returncode == 1
    assert "Error processing idl file" in log(root)
    assert "  first error in step 'build':\n    forge: " not in done.stderr


@pytest.mark.needs("colcon")
def test_colcon_and_forge_can_continue_each_others_builds(tree: Tree) -> None:
    root = tree(interface_package("fast_msgs", SMALL))
    environment = {**os.environ, **underlay()}
    argv = ["colcon", "build", "--cmake-args", f"-DPython3_EXECUTABLE={sys.executable}"]
    library = root / "install/fast_msgs/lib/libfast_msgs__rosidl_generator_c.so"
    for definition, tool in (("int32 a\n", "forge"), ("int64 b\n", "colcon"), ("int16 c\n", "forge")):
        tree({"src/fast_msgs/msg/Plain.msg": definition})
        if tool == "forge":
            done = build(root)
        else:
            # CMake installs a file again only if its time differs by at least a second.
            time.sleep(1.1)
            done = subprocess.run(
                argv, cwd=root, env=environment, capture_output=True, text=True, check=False
            )
        assert done.returncode == 0, done.stderr
        assert "fast_msgs__msg__Plain__init" in symbols(library)
        header = root / "install/fast_msgs/include/fast_msgs/fast_msgs/msg/detail/plain__struct.h"
        assert f"_t {definition.split()[1]};" in header.read_text(encoding="utf-8")
