"""Builds with a package cache: restored trees equal built ones, whatever goes wrong."""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran
from tests.evolving import PYTHON, differences, look
from tests.packages import manifest_text, write_files

pytestmark = pytest.mark.needs("cmake", "ninja", "gcc")

LIBRARY = """cmake_minimum_required(VERSION 3.18)
project(library C)
add_library(library SHARED library.c)
target_include_directories(library PUBLIC $<INSTALL_INTERFACE:include>)
install(TARGETS library EXPORT library DESTINATION lib)
install(FILES library.h DESTINATION include)
install(EXPORT library FILE libraryConfig.cmake DESTINATION lib/cmake/library)
install(CODE [[file(WRITE "${CMAKE_INSTALL_PREFIX}/share/library/unlisted" "${CMAKE_INSTALL_PREFIX}")]])
install(DIRECTORY DESTINATION share/library/hollow)
"""
USING = """cmake_minimum_required(VERSION 3.18)
project(using C)
find_package(library REQUIRED)
add_executable(using main.c)
target_link_libraries(using library)
install(TARGETS using DESTINATION bin)
"""
PLAIN = {
    "src/library/package.xml": manifest_text("library", build_type="cmake"),
    "src/library/CMakeLists.txt": LIBRARY,
    "src/library/library.c": "int answer() { return 42; }\n",
    "src/library/library.h": "int answer();\n",
    "src/using/package.xml": manifest_text("using", "<depend>library</depend>", build_type="cmake"),
    "src/using/CMakeLists.txt": USING,
    "src/using/main.c": "#include <library.h>\nint main() { return answer() - 42; }\n",
}
SPEAKING = """cmake_minimum_required(VERSION 3.18)
project(speaking C)
add_executable(speak main.c)
target_compile_definitions(speak PRIVATE HOME="${CMAKE_CURRENT_BINARY_DIR}")
install(TARGETS speak DESTINATION bin)
"""
BOUND = {
    "src/speaking/package.xml": manifest_text("speaking", build_type="cmake"),
    "src/speaking/CMakeLists.txt": SPEAKING,
    "src/speaking/main.c": "#include <stdio.h>\nint main() { puts(HOME); }\n",
}


class Users:
    """Builds with one cache, each in its own workspace."""

    def __init__(self, forge: Forge, cache: Path) -> None:
        self.forge = forge
        self.cache = cache

    def build(self, root: Path, *options: str, code: int = 0) -> Ran:
        """Build a workspace; what it leaves is to be a whole build."""
        ran = self.forge("build", "--cache", str(self.cache), *options, cwd=root)
        assert ran.code == code, ran.err
        return ran

    def begin_anew(self, root: Path) -> None:
        """Remove what was built, as a fresh clone has it."""
        for name in ("build", "install", "log"):
            shutil.rmtree(root / name, ignore_errors=True)


@pytest.fixture
def users(forge: Forge, tmp_path: Path) -> Users:
    return Users(forge, tmp_path / "cache")


def restored(ran: Ran) -> int:
    found = re.search(r"(\d+) packages? came from the cache", ran.out)
    return int(found[1]) if found else 0


@pytest.mark.parametrize("layout", [(), ("--merge-install",)])
def test_a_restored_tree_matches_the_built_one(users: Users, tmp_path: Path, layout: tuple[str, ...]) -> None:
    """At the same path to the byte; then there is nothing to do, and an edit is built."""
    root = write_files(tmp_path / "a b", {**PLAIN, **PYTHON})
    first = users.build(root, *layout)
    built = look(root / "install")
    assert restored(first) == 0
    users.begin_anew(root)
    ran = users.build(root, *layout)
    assert restored(ran) == ran.out.count("Finished <<<") > 0
    assert not list((root / "build").glob("*/CMakeCache.txt"))
    assert not differences(look(root / "install"), built)
    assert "unchanged" in users.build(root, *layout).out
    changed = next(path for path in sorted(root.glob("src/**/*.c")))
    changed.write_text(changed.read_text() + "int one_more() { return 1; }\n")
    assert restored(users.build(root, *layout)) == 0


def test_unrecorded_files_in_a_merged_prefix_are_not_cached(users: Users, tmp_path: Path) -> None:
    """Here, a static program writes it, which cannot be observed."""
    lists = (
        f"{LIBRARY}add_executable(writer writer.c)\ntarget_link_options(writer PRIVATE -static)\n"
        "install(CODE [[execute_process(COMMAND ./writer ${CMAKE_INSTALL_PREFIX}/share/library/unseen)]])\n"
    )
    code = (
        '#include <stdio.h>\nint main(int count, char ** words) { return !fopen(words[count - 1], "w"); }\n'
    )
    root = write_files(
        tmp_path / "ws", {**PLAIN, "src/library/CMakeLists.txt": lists, "src/library/writer.c": code}
    )
    ran = users.build(root, "--merge-install", "--explain", "--executor", "sequential")
    assert (
        "library: not in the cache; not cached: 'share/library/unseen' appeared during the build" in ran.out
    )
    built = look(root / "install")
    users.begin_anew(root)
    users.build(root, "--merge-install")
    assert not differences(look(root / "install"), built)


def test_a_package_that_read_a_file_before_its_owner_was_known_is_not_cached(
    users: Users, tmp_path: Path
) -> None:
    """Several packages install the file; which one is last shows only when all are built."""
    words = "install(FILES words DESTINATION share/common)\n"
    read = (
        "file(READ ${CMAKE_INSTALL_PREFIX}/share/common/words words)\n"
        "file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/read ${words})\n"
        "install(FILES ${CMAKE_CURRENT_BINARY_DIR}/read DESTINATION share/reader)\n"
    )
    slow = "add_custom_target(slow ALL COMMAND sleep 1)\n"
    files = {}
    for name, needs, rules in (("a", (), slow + words), ("b", (), words), ("reader", ("a", "b"), read)):
        depends = "".join(f"<depend>{need}</depend>" for need in needs)
        files[f"src/{name}/package.xml"] = manifest_text(name, depends, build_type="cmake")
        head = f"cmake_minimum_required(VERSION 3.18)\nproject({name} NONE)\n"
        files[f"src/{name}/CMakeLists.txt"] = head + rules
        files[f"src/{name}/words"] = name
    root = write_files(tmp_path / "ws", files)
    for _ in range(2):
        users.build(root, "--merge-install", "--parallel-workers", "2")
        assert (root / "install/share/reader/read").read_text() == "b"
        users.begin_anew(root)


def test_results_are_relocated_to_another_workspace_path(users: Users, tmp_path: Path) -> None:
    """After builds at two paths of different length and depth had the same results."""
    files = {**PLAIN, **PYTHON}
    one, two, three = (write_files(tmp_path / name, files) for name in ("one", "deeper/second", "x/y/third"))
    ran = users.build(one, "--explain")
    assert "using: not in the cache; cached for this path\n" in ran.out
    ran = users.build(two, "--explain")
    assert restored(ran) == 0
    assert (
        f"using: not in the cache for this path: only built in '{one}' so far; "
        f"cached for any path: the result is the same as in '{one}'\n"
    ) in ran.out
    ran = users.build(three)
    assert restored(ran) == ran.out.count("Finished <<<") > 0
    installed = [path for path in (three / "install").rglob("*") if path.is_file()]
    assert not any(bytes(root) in path.read_bytes() for path in installed for root in (one, two))
    subprocess.run(["sh", "-c", ". install/setup.sh"], cwd=three, check=True)
    users.begin_anew(three)
    shutil.rmtree(users.cache)
    users.build(three)
    assert restored(users.build(three)) == 0


def test_similar_paths_do_not_prove_path_independence(users: Users, tmp_path: Path) -> None:
    """In paths of equal length or depth, or with the same last name, what depends on them may be the same."""
    roots = ("one", "two", "deeper/one", "longer", "x/y/third")
    one, *similar, last = (write_files(tmp_path / name, PLAIN) for name in roots)
    users.build(one)
    for root in similar:
        ran = users.build(root, "--explain")
        assert restored(ran) == 0
        assert f"cached for this path: '{one}' is too similar to show that it does not matter" in ran.out
        users.begin_anew(root)
        assert restored(users.build(root)) == 2
    assert restored(users.build(last)) == 0


DEPENDENT = {
    "name": "get_filename_component(what ${CMAKE_SOURCE_DIR}/../.. ABSOLUTE)\n"
    "get_filename_component(what ${what} NAME)",
    "length": "string(LENGTH ${CMAKE_SOURCE_DIR} what)",
    "depth": "file(RELATIVE_PATH what ${CMAKE_INSTALL_PREFIX} /usr/share)",
    "digest": "string(MD5 what ${CMAKE_SOURCE_DIR})",
}
"""What may depend on a path without containing it."""


@pytest.mark.parametrize("what", DEPENDENT)
def test_path_dependent_results_are_reused_only_at_the_same_path(
    users: Users, tmp_path: Path, what: str
) -> None:
    lists = (
        f"cmake_minimum_required(VERSION 3.18)\nproject(speaking NONE)\n{DEPENDENT[what]}\n"
        "file(WRITE ${CMAKE_BINARY_DIR}/what ${what})\n"
        "install(FILES ${CMAKE_BINARY_DIR}/what DESTINATION share)\n"
    )
    files = {**BOUND, "src/speaking/CMakeLists.txt": lists}
    one, *others = (write_files(tmp_path / name, files) for name in ("one", "deeper/second", "x/y/third"))
    users.build(one)
    for root in others:
        ran = users.build(root, "--explain")
        assert restored(ran) == 0
        assert "; cached for this path only: 'share/what' " in ran.out
        built = look(root / "install")
        users.begin_anew(root)
        assert restored(users.build(root)) == 1
        assert not differences(look(root / "install"), built)
    assert "speaking: not in the cache for this path: 'share/what' depends on it;" in ran.out
    users.begin_anew(one)
    assert restored(users.build(one)) == 1


SEEN = {
    "nothing": ("", True),
    "an option": ('add_compile_options("-DPLACE=\\"${CMAKE_SOURCE_DIR}\\"")', False),
    "a file that is generated beside the code": (
        'file(WRITE ${CMAKE_SOURCE_DIR}/place.h "#define PLACE \\"${CMAKE_SOURCE_DIR}\\"\\n")\n'
        "include_directories(${CMAKE_SOURCE_DIR})",
        False,
    ),
    "a generated digest": (
        "string(MD5 place ${CMAKE_SOURCE_DIR})\n"
        'file(WRITE ${CMAKE_BINARY_DIR}/place.h "#define PLACE \\"${place}\\"\\n")\n'
        "include_directories(${CMAKE_BINARY_DIR})",
        False,
    ),
}
"""What of the path compilers can see, though the code does not use it yet."""
NUMBER = "#if __has_include(<place.h>)\n#include <place.h>\n#endif\nint main() { return %s; }\n"


@pytest.mark.parametrize("what", SEEN)
def test_code_changes_are_shared_if_the_build_scripts_are_path_independent(
    users: Users, tmp_path: Path, what: str
) -> None:
    """If the paths did not matter to them, and compilers cannot see any."""
    code, is_shared = SEEN[what]
    lists = SPEAKING.replace(
        'target_compile_definitions(speak PRIVATE HOME="${CMAKE_CURRENT_BINARY_DIR}")', ""
    )
    lists = lists.replace("add_executable", f"{code}\nadd_executable")
    files = {**BOUND, "src/speaking/CMakeLists.txt": lists, "src/speaking/main.c": NUMBER % "1"}
    names = ("one", "deeper/second", "x/y/third")
    one, two, three = (write_files(tmp_path / name, files) for name in names)
    users.build(one)
    assert "cached for any path" in users.build(two, "--explain").out
    assert restored(users.build(three)) == 1
    for root in (one, three):
        use = "1" if what == "nothing" else "sizeof(PLACE)"
        (root / "src/speaking/main.c").write_text(NUMBER % f"{use} + 1")
        (root / "src/speaking/place.h").unlink(missing_ok=True)
    users.begin_anew(one)
    ran = users.build(one, "--explain")
    assert restored(ran) == 0
    assert ("cached for any path: the same build scripts did not depend on it" in ran.out) == is_shared
    assert restored(users.build(three)) == is_shared
    for root in (one, three):
        path = root / "src/speaking/CMakeLists.txt"
        path.write_text(path.read_text() + "# another\n")
    users.begin_anew(one)
    assert "speaking: not in the cache; cached for this path\n" in users.build(one, "--explain").out
    assert restored(users.build(three)) == 0


@pytest.mark.parametrize("name", ["main.c", "copied.txt"])
def test_a_source_that_spells_the_path_of_its_workspace_is_not_shared(
    users: Users, tmp_path: Path, name: str
) -> None:
    """A clean build elsewhere installs it with this path, not with its own."""
    code = "add_executable(speak main.c)\ninstall(FILES main.c copied.txt DESTINATION share)\n"
    files = {
        **BOUND,
        "src/speaking/CMakeLists.txt": f"cmake_minimum_required(VERSION 3.16)\nproject(speaking C)\n{code}",
        "src/speaking/main.c": "int main() {}\n",
        "src/speaking/copied.txt": "",
    }
    names = ("one", "deeper/second", "x/y/third")
    one, two, three = (write_files(tmp_path / each, files) for each in names)
    users.build(one)
    assert "cached for any path" in users.build(two, "--explain").out
    for text, is_shared in (("// shared\n", True), (f"// {one}/install\n", False)):
        for root in (one, three):
            (root / "src/speaking" / name).write_text(f"int main() {{}}\n{text}")
        users.begin_anew(one)
        users.build(one)
        users.begin_anew(three)
        assert restored(users.build(three)) == is_shared
    assert (three / "src/speaking" / name).read_text() == (
        three / "install/speaking/share" / name
    ).read_text()


def test_a_path_in_a_dependencys_header_may_affect_other_code(users: Users, tmp_path: Path) -> None:
    generating = (
        'file(WRITE ${CMAKE_BINARY_DIR}/library.h "#define PLACE \\"${CMAKE_INSTALL_PREFIX}\\"\\n")\n'
        "install(FILES ${CMAKE_BINARY_DIR}/library.h DESTINATION include)"
    )
    lists = LIBRARY.replace("install(FILES library.h DESTINATION include)", generating)
    main = "#include <library.h>\nint main() { return 0; }\n"
    files = {**PLAIN, "src/library/CMakeLists.txt": lists, "src/using/main.c": main}
    names = ("one", "deeper/second", "x/y/third")
    one, two, three = (write_files(tmp_path / name, files) for name in names)
    users.build(one)
    assert users.build(two, "--explain").out.count("cached for any path") == 2
    assert restored(users.build(three)) == 2
    for root in (one, three):
        (root / "src/using/main.c").write_text(main.replace("0", "sizeof(PLACE)"))
        (root / "src/library/library.c").write_text("int answer() { return 43; }\n")
    users.begin_anew(one)
    ran = users.build(one, "--explain")
    assert "library: not in the cache; cached for any path: the same build scripts" in ran.out
    assert "using: not in the cache; cached for this path\n" in ran.out
    assert restored(users.build(three)) == 1


def test_a_later_build_may_disprove_path_independence(users: Users, tmp_path: Path) -> None:
    files = {**BOUND, "src/speaking/CMakeLists.txt": EXPECTING}
    names = ("one", "deeper/second", "x/y/z/expected", "fourth/of/these/paths/here")
    one, two, expected, last = (write_files(tmp_path / name, files) for name in names)
    for root in (one, two):
        assert restored(users.build(root)) == 0
    users.build(expected, "--force")
    assert restored(users.build(last)) == 0
    users.begin_anew(expected)
    assert restored(users.build(expected)) == 1
    assert (expected / "install/speaking/share/speaking/here").is_file()


EXPECTING = """cmake_minimum_required(VERSION 3.18)
project(speaking NONE)
if(CMAKE_SOURCE_DIR MATCHES expected)
  install(FILES main.c DESTINATION share/speaking RENAME here)
endif()
"""


def test_results_with_embedded_paths_are_reused_only_at_the_same_path(users: Users, tmp_path: Path) -> None:
    one, two = write_files(tmp_path / "one", BOUND), write_files(tmp_path / "deeper/second", BOUND)
    users.build(one)
    ran = users.build(two, "--explain")
    assert restored(ran) == 0
    assert f"; cached for this path only: 'bin/speak' differs from the one built in '{one}'" in ran.out
    users.begin_anew(two)
    assert restored(users.build(two)) == 1
    said = subprocess.run([two / "install/speaking/bin/speak"], check=True, capture_output=True, text=True)
    assert said.stdout == f"{two}/build/speaking\n"


def test_compiled_code_contains_no_source_paths(users: Users, tmp_path: Path) -> None:
    """__FILE__ and debug information are the same everywhere; the flags of the user stay."""
    main = "#include <stdio.h>\nint main() { puts(__FILE__); }\n"
    files = {**BOUND, "src/speaking/main.c": main}
    one, two, three = (write_files(tmp_path / name, files) for name in ("one", "deeper/second", "x/y/third"))
    flags = ("--cmake-args", "-D", "CMAKE_C_FLAGS=-g -DMINE=1")
    for root in (one, two):
        users.build(root, *flags)
    assert restored(users.build(three, *flags)) == 1
    said = subprocess.run([three / "install/speaking/bin/speak"], check=True, capture_output=True, text=True)
    assert said.stdout == "./src/speaking/main.c\n"
    ninja = (one / "build/speaking/build.ninja").read_text()
    assert "-g -DMINE=1" in ninja
    assert "-ffile-prefix-map=" in ninja


def test_paths_with_spaces_share_no_results(users: Users, tmp_path: Path) -> None:
    """Scripts written for other paths may lack the quotes that these need."""
    names = ("one", "deeper/second", "with blank", "x/y/with another blank")
    roots = [write_files(tmp_path / name, PLAIN) for name in names]
    assert [restored(users.build(root)) for root in roots] == [0, 0, 0, 0]
    users.begin_anew(roots[-1])
    assert restored(users.build(roots[-1])) == 2
    users.begin_anew(roots[-1])
    ran = users.build(roots[-1], "--force", "--explain")
    assert "using: cached for this path only: it contains blanks or special characters" in ran.out


@pytest.mark.parametrize("harm", ["flip", "cut", "remove"])
def test_a_corrupt_cache_causes_rebuilds(users: Users, tmp_path: Path, harm: str) -> None:
    root = write_files(tmp_path / "ws", PLAIN)
    users.build(root)
    built = look(root / "install")
    chance = random.Random(harm)
    for path in sorted(path for path in users.cache.rglob("*") if path.is_file()):
        if chance.random() < 0.5:
            spoil(path, harm)
    users.begin_anew(root)
    users.build(root)
    assert not differences(look(root / "install"), built)
    assert users.forge("cache", "verify", "--cache", str(users.cache), cwd=root).code in {0, 1}
    assert users.forge("cache", "verify", "--cache", str(users.cache), cwd=root).code == 0
    users.begin_anew(root)
    users.build(root)
    assert not differences(look(root / "install"), built)


def spoil(path: Path, harm: str) -> None:
    """Do a file some harm, as a failing disk or a stranger might."""
    content = bytearray(path.read_bytes())
    if harm == "remove":
        path.unlink()
    elif harm == "flip" and content:
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
    else:
        path.write_bytes(content[: len(content) // 2])


def test_an_unwritable_cache_is_reported_once(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", PLAIN)
    users.cache.write_text("a file is in the way")
    ran = users.build(root)
    assert ran.err.count("the cache: ") == 1
    assert "Traceback" not in ran.err


def test_an_invalid_url_is_reported_even_if_nothing_is_built(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", BOUND)
    users.build(root)
    ran = users.build(root, "--remote-cache", "/srv/cache", code=2)
    assert ran.err.startswith("error: the remote cache is not a valid URL\nhint: for example: ")


def test_force_ignores_the_cache(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", BOUND)
    users.build(root)
    users.begin_anew(root)
    assert restored(users.build(root, "--force")) == 0
    assert (root / "build/speaking/CMakeCache.txt").is_file()


def test_links_into_sources_are_not_cached(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", BOUND)
    assert (
        "speaking: not cached: installed with symbolic links"
        in users.build(root, "--symlink-install", "--explain").out
    )
    users.begin_anew(root)
    assert restored(users.build(root, "--symlink-install")) == 0


def test_external_files_are_part_of_the_cache_key(users: Users, tmp_path: Path) -> None:
    """Either state of it has its result; the older one is found again."""
    header = tmp_path / "outside" / "answer.h"
    write_files(header.parent, {"answer.h": '#define HOME "one"\n'})
    definitions = re.compile(r"target_compile_definitions.*")
    found = f"target_include_directories(speak PRIVATE {header.parent})"
    own = {
        "src/speaking/CMakeLists.txt": definitions.sub(found, SPEAKING),
        "src/speaking/main.c": "#include <answer.h>\n#include <stdio.h>\nint main() { puts(HOME); }\n",
    }
    root = write_files(tmp_path / "ws", {**BOUND, **own})
    seen = []
    for said, count in (("one", 0), ("two", 0), ("one", 1)):
        header.write_text(f'#define HOME "{said}"\n')
        users.begin_anew(root)
        assert restored(users.build(root)) == count
        seen.append(subprocess.check_output([root / "install/speaking/bin/speak"], text=True))
    assert seen == ["one\n", "two\n", "one\n"]


def test_files_written_outside_the_workspace_change_the_cache_key(users: Users, tmp_path: Path) -> None:
    """A package that reads it is not restored as it was, though another has looked at the file before."""
    header = tmp_path / "outside" / "answer.h"
    write_files(header.parent, {"answer.h": '#define HOME "one"\n'})
    found = f"target_include_directories(speak PRIVATE {header.parent})"
    cmake = re.sub(r"target_compile_definitions.*", found, SPEAKING)
    main = "#include <answer.h>\n#include <stdio.h>\nint main() { puts(HOME); }\n"
    files = {
        "src/writing/package.xml": manifest_text("writing", "<depend>early</depend>", build_type="cmake"),
        "src/writing/said": "one",
        "src/writing/CMakeLists.txt": f"""cmake_minimum_required(VERSION 3.18)
project(writing NONE)
file(READ said said)
file(WRITE "{header}" "#define HOME \\"${{said}}\\"\\n")
install(FILES package.xml DESTINATION share/writing)
""",
    }
    for name, needs in (("early", ""), ("late", "<depend>writing</depend>")):
        files |= {
            f"src/{name}/package.xml": manifest_text(name, needs, build_type="cmake"),
            f"src/{name}/CMakeLists.txt": cmake.replace("speaking", name),
            f"src/{name}/main.c": main,
        }
    root = write_files(tmp_path / "ws", files)
    users.build(root)
    users.begin_anew(root)
    (root / "src/writing/said").write_text("two")
    assert restored(users.build(root)) == 1
    assert subprocess.check_output([root / "install/late/bin/speak"], text=True) == "two\n"


def build_with_mask(root: Path, cache: Path, mask: int) -> str:
    """Build in a process that has a umask; return what was printed."""
    words = f'umask {mask:03o}; exec "$0" -m forge build --cache "$1"'
    argv = ["sh", "-c", words, sys.executable, str(cache)]
    return subprocess.run(argv, cwd=root, capture_output=True, text=True, check=True).stdout


def test_results_built_with_another_umask_are_not_used(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", {**PLAIN, **PYTHON})
    build_with_mask(root, users.cache, 0o022)
    clean = look(root / "install")
    users.begin_anew(root)
    assert "came from the cache" not in build_with_mask(root, users.cache, 0o077)
    assert differences(look(root / "install"), clean)
    users.begin_anew(root)
    assert "came from the cache" in build_with_mask(root, users.cache, 0o022)
    assert not differences(look(root / "install"), clean)


NATIVE = {
    "option": ("", "", ["--cmake-args", "-DCMAKE_C_FLAGS=-march=native"]),
    "code": ("", "string(CONCAT flag -march= native)\nadd_compile_options(${flag})", []),
    "need": ("target_compile_options(library PUBLIC -mtune=native)", "", []),
    "file": ("", "add_compile_options(@${CMAKE_CURRENT_SOURCE_DIR}/flags)", []),
    "look": ("", "file(READ /proc/cpuinfo about)", []),
    "none": ("# the native compiler", "", []),
}
"""Where a flag stands that means the processor at hand: in the library, in what uses it, in the options."""


@pytest.mark.parametrize("where", NATIVE)
def test_native_code_is_reused_only_on_the_same_processor(users: Users, tmp_path: Path, where: str) -> None:
    library, using, options = NATIVE[where]
    files = dict(PLAIN)
    files["src/library/CMakeLists.txt"] = LIBRARY.replace("install(TARGETS", f"{library}\ninstall(TARGETS")
    files["src/using/CMakeLists.txt"] = USING.replace("add_exec", f"{using}\nadd_exec")
    files["src/using/flags"] = "-march=native\n"
    root = write_files(tmp_path / "ws", files)
    users.build(root, *options)
    users.begin_anew(root)
    assert restored(users.build(root, *options)) == 2
    users.begin_anew(root)
    other = tmp_path / "cpuinfo"
    known = Path("/proc/cpuinfo").read_text()
    other.write_text(
        "".join(line for line in known.splitlines(keepends=True) if not re.match("model name|flags", line))
    )
    words = 'mount --bind "$1" /proc/cpuinfo || exit 77; shift; exec "$@"'
    build = [sys.executable, "-m", "forge", "build", "--cache", str(users.cache), *options]
    ran = subprocess.run(
        ["unshare", "--mount", "sh", "-c", words, "sh", str(other), *build],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode in {1, 77} and "Summary" not in ran.stdout:
        pytest.skip("nobody here may show another /proc/cpuinfo")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = re.search(r"(\d+) packages? came from the cache", ran.stdout)
    assert int(found[1] if found else 0) == {"option": 0, "need": 0, "none": 2}.get(where, 1)
    said = users.build(root, "--explain", *options).out
    assert ("the processor changed" in said) == (where != "none")


def test_a_cache_stays_within_its_size_limit(users: Users, tmp_path: Path) -> None:
    root = write_files(tmp_path / "ws", {**PLAIN, **BOUND})
    users.build(root)
    whole = sum(path.stat().st_size for path in users.cache.rglob("*") if path.is_file())
    users.begin_anew(root)
    shutil.rmtree(users.cache)
    users.build(root, "--cache-size", f"{whole // 2048}K")
    assert sum(path.stat().st_size for path in users.cache.rglob("*") if path.is_file()) < whole * 0.6
    users.begin_anew(root)
    assert restored(users.build(root)) > 0
    emptied = users.forge("cache", "prune", "--size", "0", "--cache", str(users.cache), cwd=root)
    assert "0 bytes left" in emptied.out
    stats = users.forge("cache", "stats", "--cache", str(users.cache), cwd=root)
    assert "0 bytes in 0 blobs" in stats.out


def test_concurrent_builds_share_a_cache_safely(users: Users, tmp_path: Path) -> None:
    roots = [write_files(tmp_path / f"ws{number}", PLAIN) for number in range(3)]
    running = [
        subprocess.Popen(
            [sys.executable, "-m", "forge", "build", "--cache", str(users.cache)],
            cwd=root,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for root in roots
    ]
    for process in running:
        _, err = process.communicate()
        assert (process.returncode, err) == (0, b"")
    trees = [look(root / "install") for root in roots]
    assert len({frozenset(tree) for tree in trees}) == 1
    assert users.forge("cache", "verify", "--cache", str(users.cache), cwd=tmp_path).code == 0


@pytest.mark.parametrize("seed", range(int(os.environ.get("FORGE_TEST_KILLS", "2"))))
def test_a_killed_restore_is_repeated(users: Users, tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    many = {f"src/speaking/data/{number}": "x" * number for number in range(1000)}
    text = SPEAKING + "install(DIRECTORY data DESTINATION share/speaking)\n"
    root = write_files(tmp_path / "ws", {**BOUND, **many, "src/speaking/CMakeLists.txt": text, **PLAIN})
    users.build(root)
    built = look(root / "install")
    users.begin_anew(root)
    argv = [sys.executable, "-m", "forge", "build", "--cache", str(users.cache)]
    process = subprocess.Popen(
        argv, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
    )
    assert process.stdout
    process.stdout.readline()
    time.sleep(chance.random() * 0.1)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    ran = users.build(root, *(("--cache", str(tmp_path / "none")) if chance.random() < 0.5 else ()))
    assert ran.code == 0
    assert not differences(look(root / "install"), built)
