"""While a package is built again, the installed one stays whole and can be used."""

import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests import opt_ros
from tests.conftest import Forge, Tree
from tests.e2e.test_exact_installs import LINKED, MERGED, build, cmake, hold_against_clean, look
from tests.e2e.test_opt_ros import shell
from tests.packages import manifest_text, write_files
from tests.rosidl import DEBIAN

pytestmark = [pytest.mark.needs("cmake")]

KILLS = int(os.environ.get("FORGE_TEST_KILLS", "2"))
FILES = 400
PROGRAM = """
add_library(greet SHARED greet.c)
add_executable(hello hello.c)
target_link_libraries(hello greet)
install(TARGETS greet hello)
install(FILES words.txt DESTINATION share/a)
"""
HELLO = "void greet(void); int main(void) { greet(); return 0; }\n"
GREET = '#include <stdio.h>\nvoid greet(void) { puts("%s"); }\n'


def inodes(prefix: Path) -> dict[str, tuple[int, int]]:
    files = (path for path in prefix.rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(prefix)): (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


@contextmanager
def repeating(look_once: Callable[[], Any], pause: float = 0.002) -> Iterator[list[Any]]:
    """Call a function again and again in a thread; collect what it returns."""
    returned, ended = [], threading.Event()

    def look_often() -> None:
        while not ended.is_set():
            returned.append(look_once())
            time.sleep(pause)

    thread = threading.Thread(target=look_often)
    thread.start()
    try:
        yield returned
    finally:
        ended.set()
        thread.join()


def hello(root: Path) -> subprocess.CompletedProcess[str]:
    # Not with os.environ, which a build in another thread changes.
    variables = {"LD_LIBRARY_PATH": str(root / "install/a/lib")}
    return subprocess.run(
        [root / "install/a/bin/hello"], env=variables, capture_output=True, text=True, check=False
    )


@pytest.mark.needs("g++")
@pytest.mark.parametrize("options", [(), (LINKED,)], ids=["copies", "links"])
def test_an_installed_program_can_be_started_throughout_its_rebuild(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    root = tree(
        cmake("a", PROGRAM, languages="C", **{"hello.c": HELLO, "greet.c": GREET % "0", "words.txt": ""})
    )
    build(forge, root, *options)
    with repeating(lambda: hello(root)) as said:
        for number in range(1, 4):
            tree({"src/a/greet.c": GREET % number, "src/a/hello.c": f"{HELLO}int more{number};\n"})
            build(forge, root, *options)
        tree({"src/a/greet.c": "broken"})
        assert forge("build", *options, cwd=root).code == 1
    assert {ran.returncode for ran in said} == {0}, [ran.stderr for ran in said if ran.returncode]
    assert hello(root).stdout == "3\n"


BREAKS: dict[str, dict[str, str]] = {
    "CMake": {"src/a/more.cmake": "message(FATAL_ERROR)\n"},
    "a compiler, after CMake ran": {"src/a/more.cmake": "add_compile_options(--wrong)\n"},
    "a compiler, in a folder that began empty": {"outside": "2", "src/a/greet.c": "wrong"},
}


@pytest.mark.parametrize("what", BREAKS)
def test_installed_links_lead_to_the_last_result_until_a_build_succeeds(
    forge: Forge, tree: Tree, what: str
) -> None:
    """Even if what they lead to in the build folder is gone."""
    body = f"include(more.cmake)\nfile(READ ${{CMAKE_SOURCE_DIR}}/../../outside text)\n{PROGRAM}"
    sources = {"hello.c": HELLO, "greet.c": GREET % "0", "words.txt": "", "more.cmake": ""}
    files = {**cmake("a", body, languages="C", **sources), "outside": "1"}
    root = tree(files)
    build(forge, root, LINKED)
    tree(BREAKS[what])
    for _ in range(2):
        assert forge("build", LINKED, cwd=root).code == 1
        assert hello(root).stdout == "0\n"
    tree({**files, "src/a/greet.c": GREET % "1"})
    hold_against_clean(forge, root, LINKED)
    assert hello(root).stdout == "1\n"
    tree({"src/a/greet.c": GREET % "2"})
    hold_against_clean(forge, root, LINKED)
    assert hello(root).stdout == "2\n"


@pytest.mark.needs("g++")
def test_unchanged_outputs_keep_their_inode_and_time(forge: Forge, tree: Tree) -> None:
    root = tree(
        cmake("a", PROGRAM, languages="C", **{"hello.c": HELLO, "greet.c": GREET % "0", "words.txt": ""})
    )
    build(forge, root)
    before = inodes(root / "install/a")
    for files, changed in (
        ({"src/a/words.txt": "new"}, {"share/a/words.txt"}),
        ({"src/a/greet.c": GREET % "1"}, {"lib/libgreet.so"}),
        ({"src/a/CMakeLists.txt": (root / "src/a/CMakeLists.txt").read_text() + "# a comment\n"}, set()),
    ):
        tree(files)
        build(forge, root)
        after = inodes(root / "install/a")
        differing = {path for path in before | after if before.get(path) != after.get(path)}
        # forge writes this file anew, with the same time.
        assert differing - {"share/a/package.dsv"} == changed
        assert before["share/a/package.dsv"][1] == after["share/a/package.dsv"][1]
        before = after


def test_build_steps_do_not_see_the_installed_package(forge: Forge, tree: Tree) -> None:
    """As in a clean build: neither CMake nor a shell, by no spelling of the path."""
    body = (
        "find_file(OLD words.txt PATHS ${CMAKE_INSTALL_PREFIX}/share/a NO_CACHE)\n"
        "file(GLOB there ${CMAKE_INSTALL_PREFIX}/*)\n"
        'execute_process(COMMAND sh -c "cd ${CMAKE_INSTALL_PREFIX}/..; ls a; cat ./a/share/a/words.txt; '
        'test -e a/share && echo there; mkdir -p made" OUTPUT_VARIABLE said ERROR_QUIET)\n'
        'file(WRITE ${CMAKE_BINARY_DIR}/said.txt "${OLD} ${there} ${said}")\n'
        "install(FILES words.txt ${CMAKE_BINARY_DIR}/said.txt DESTINATION share/a)\n"
    )
    root = tree(cmake("a", body, **{"words.txt": "1"}))
    build(forge, root)
    tree({"src/a/CMakeLists.txt": (root / "src/a/CMakeLists.txt").read_text() + "# a comment\n"})
    hold_against_clean(forge, root)


@pytest.mark.parametrize(
    "code",
    [
        "install(CODE [[file(WRITE ${CMAKE_INSTALL_PREFIX}/share/made.txt ${CMAKE_INSTALL_PREFIX})]])",
        'install(CODE "file(WRITE ${CMAKE_INSTALL_PREFIX}/share/made.txt 1)")',
        "install(FILES words.txt DESTINATION ${CMAKE_INSTALL_PREFIX}/other)",
        "file(COPY words.txt DESTINATION ${CMAKE_INSTALL_PREFIX}/x)",
        "add_custom_target(copy ALL cmake -E copy_directory ../d ${CMAKE_INSTALL_PREFIX}/x)",
    ],
)
def test_steps_that_use_the_prefix_install_as_in_a_clean_build(forge: Forge, tree: Tree, code: str) -> None:
    plain = "install(FILES words.txt DESTINATION share)\nfile(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/../d/e)\n"
    root = tree(cmake("a", plain, **{"words.txt": "1"}))
    build(forge, root)
    tree({**cmake("a", plain + code), "src/a/words.txt": "2"})
    (root / "install/a").mkdir(exist_ok=True)
    build(forge, root)
    tree({"src/a/words.txt": "3"})
    again = build(forge, root)
    assert again.out.count("Starting") == 1
    hold_against_clean(forge, root)


def test_a_link_with_a_changed_target_is_reinstalled(forge: Forge, tree: Tree) -> None:
    root = tree(cmake("a", "install(DIRECTORY d DESTINATION share)", **{"one/x": "1", "two/x": "2"}))
    link = root / "src/a/d"
    link.symlink_to("one")
    build(forge, root)
    link.unlink()
    link.symlink_to("two")
    hold_against_clean(forge, root)


SCRIPT = "#!/bin/sh\nexit 0\n"
AMENT = """find_package(ament_cmake REQUIRED)
find_package(ament_cmake_python REQUIRED)
install(DIRECTORY d DESTINATION share/a)
install(PROGRAMS run DESTINATION lib/a)
ament_python_install_package(a)
ament_package()
"""
CODE = r"""
configure_file(install.sh.in install.sh @ONLY)
install(CODE "execute_process(COMMAND sh -e ${CMAKE_BINARY_DIR}/install.sh COMMAND_ERROR_IS_FATAL ANY)")
install(CODE "file(COPY ${PROJECT_SOURCE_DIR}/d DESTINATION \${CMAKE_INSTALL_PREFIX}/share/a)")
"""
INSTALLER = """prefix=@CMAKE_INSTALL_PREFIX@
mkdir -p "$prefix/lib/a" "$prefix/share"
cp -p @PROJECT_SOURCE_DIR@/run "$prefix/lib/a/run"
cd "$prefix/lib/a"
./run
pwd > ../../share/where
(cd ../../.. && pwd) >> ../../share/where
cp -p run "$prefix/share/copy"
ln -s copy ../../share/link
mv "$prefix/share/copy" "$prefix/share/moved"
ln -sf moved ../../share/link
found=$(find "$prefix/lib/a" "$prefix/share/b" 2> /dev/null | sort)
echo "$found" > ../../share/list
chmod 750 "$prefix/share/moved"
"""


def prefix_of(root: Path, name: str, options: tuple[str, ...]) -> Path:
    return root / "install" / ("" if MERGED in options else name)


def startable(program: Path) -> bool:
    try:
        return subprocess.run([program], check=False).returncode == 0
    except OSError:
        return False


def never_fails(program: Path, build_often: Callable[[], None]) -> None:
    """Start a program all the time during some builds."""
    with repeating(lambda: startable(program), 0.02) as said:
        build_often()
    assert all(said)
    assert len(said) > 1


@pytest.mark.parametrize(
    ("body", "options"),
    [("", ()), ("", (LINKED, MERGED)), (CODE, (LINKED,)), (CODE, (MERGED,))],
    ids=["rules-copies", "rules-merged-links", "code-links", "code-merged"],
)
def test_install_rules_and_code_replace_only_changed_files(
    forge: Forge, tree: Tree, body: str, options: tuple[str, ...]
) -> None:
    """Whatever names the prefix, at configure time or later, finds the stage there."""
    rules = "install(DIRECTORY d DESTINATION share/a)\ninstall(PROGRAMS run DESTINATION lib/a)\n"
    root = tree(
        cmake("a", body or rules, "b", **{"d/x": "1", "d/y": "1", "run": SCRIPT, "install.sh.in": INSTALLER})
    )
    (root / "src/a/run").chmod(0o755)
    tree(cmake("b", "install(FILES x DESTINATION share/b)\ninstall(FILES x DESTINATION lib/a)", **{"x": "b"}))
    build(forge, root, *options)
    prefix = prefix_of(root, "a", options)
    before = inodes(prefix)

    def change() -> None:
        for number in range(2, 5):
            tree({"src/a/d/x": f"{number}", f"src/a/d/new{number}": ""})
            (root / f"src/a/d/new{number - 1}").unlink(missing_ok=True)
            build(forge, root, *options)
            assert (prefix / "share/a/d/x").read_text() == f"{number}"

    never_fails(prefix / "lib/a/run", change)
    after = inodes(prefix)
    same = {"lib/a/run", "share/a/d/y", "share/where", "share/moved", "share/a/package.sh"}
    assert all(after.get(path) == before.get(path) for path in same)
    assert "in place" not in (root / "build/.forge_installed/a/install_step").read_text()
    if body:
        assert (prefix / "share/where").read_text() == f"{prefix}/lib/a\n{prefix.parent}\n"
    hold_against_clean(forge, root, *options)


@pytest.mark.needs(str(DEBIAN), "g++")
@pytest.mark.parametrize("options", [(), (LINKED, MERGED)], ids=["copies", "merged-links"])
def test_programs_can_start_while_ament_of_a_distribution_installs(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    """Its own links and its bytecode, for which it names the prefix."""
    underlay, root = tmp_path / "opt/ros/humble", tmp_path / "ws"
    opt_ros.install(underlay, tmp_path)
    needs = ("ament_cmake", "ament_cmake_python")
    write_files(root, cmake("a", AMENT, **{"d/x": "1", "a/__init__.py": "", "run": SCRIPT}))
    manifest = manifest_text("a", *(f"<buildtool_depend>{need}</buildtool_depend>" for need in needs))
    write_files(root, {"src/a/package.xml": manifest})
    (root / "src/a/run").chmod(0o755)
    command = " ".join((f". {underlay}/setup.sh && forge build", *options))
    shell(command, root)

    def change() -> None:
        for number in range(2, 4):
            files = {"src/a/d/x": f"{number}", f"src/a/d/y{number}": "", "src/a/a/__init__.py": f"{number}"}
            write_files(root, files)
            shell(command, root)

    never_fails(prefix_of(root, "a", options) / "lib/a/run", change)
    assert "unchanged" in shell(command, root)
    found = look(root / "install")
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    shell(command, root)
    assert found == look(root / "install")


@pytest.mark.needs("cargo")
@pytest.mark.parametrize("options", [(), (MERGED,)], ids=["isolated", "merged"])
def test_rust_programs_can_start_during_their_rebuild(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    main = "src/p/src/main.rs"
    toml = '[package]\nname = "p"\nversion = "0.1.0"\nedition = "2021"\n'
    manifest = manifest_text("p", build_type="ament_cargo")
    root = tree({"src/p/package.xml": manifest, "src/p/Cargo.toml": toml, main: "fn main() {}\n"})
    build(forge, root, *options)

    def change() -> None:
        tree({main: "fn main() { println!(); }\n"})
        build(forge, root, *options)
        tree({main: "fn main() { broken }\n"})
        assert forge("build", *options, cwd=root).code == 1

    program = prefix_of(root, "p", options) / "bin/p"
    never_fails(program, change)
    assert subprocess.run([program], capture_output=True, check=True).stdout == b"\n"


@pytest.mark.needs("gcc")
@pytest.mark.parametrize("options", [(), (MERGED,)], ids=["isolated", "merged"])
def test_an_unobservable_program_is_started_once(forge: Forge, tree: Tree, options: tuple[str, ...]) -> None:
    """After it was seen, the package is not built in a stage, whose steps would run again in place."""
    body = (
        "add_custom_command(OUTPUT made COMMAND ${PROJECT_SOURCE_DIR}/copy DEPENDS words.txt)\n"
        "add_custom_target(all_of_it ALL DEPENDS made)\n"
        "install(FILES ${CMAKE_BINARY_DIR}/made DESTINATION share)\n"
    )
    root = tree(cmake("a", body, **{"words.txt": "1"}))
    tree({"c.c": '#include <stdio.h>\nint main(void) { puts("copied"); return !fopen("made", "w"); }\n'})
    subprocess.run(["gcc", "-static", "-o", root / "src/a/copy", root / "c.c"], check=True)
    build(forge, root, *options)
    tree({"src/a/words.txt": "2"})
    ran = build(forge, root, *options)
    assert "denied" not in ran.out + ran.err
    log = (root / "log/latest_build/a/stdout_stderr.log").read_text()
    assert log.count("copied") == 1


def test_cached_files_are_replaced_as_in_a_clean_build(forge: Forge, tree: Tree) -> None:
    root = tree(cmake("a", "install(DIRECTORY d/ DESTINATION share)", **{"d/x": "1", "d/y": "1"}))
    options = ("--cache", str(root / "cache"))
    build(forge, root, *options)
    for path, text in (("d/x", "2"), ("d/x", "1"), ("d/y", "3")):
        tree({f"src/a/{path}": text})
        build(forge, root, *options)
    assert (root / "install/a/share/x").read_text() == "1"
    assert (root / "install/a/share/y").read_text() == "3"


# --- any change of install rules


class Rules:
    """A package whose files and install rules change at random."""

    def __init__(self, chance: random.Random, home: Path) -> None:
        self.chance = chance
        self.home = home
        self.rules: list[str] = [self.rule() for _ in range(4)]

    def rule(self) -> str:
        where = f"DESTINATION share/{self.chance.choice('pqr')}"
        rights = self.chance.choice(("", "", " PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE"))
        match self.chance.randrange(8):
            case 0:
                return f"install(FILES f1 f2 {where}{rights})"
            case 1:
                return f"install(FILES f3 {where}{rights} RENAME n{self.chance.randrange(3)})"
            case 2:
                return f"install(PROGRAMS f4 {where})"
            case 3:
                source = self.chance.choice((" USE_SOURCE_PERMISSIONS", "", " FILES_MATCHING PATTERN *1*"))
                return f"install(DIRECTORY d {where}{source})"
            case 4:
                more = self.chance.choice(("", " PATTERN g2 EXCLUDE", " PATTERN g1 PERMISSIONS OWNER_READ"))
                return f"install(DIRECTORY d/ e {where}{more})"
            case 5:
                return f"install(FILES missing f5 {where} OPTIONAL)"
            case 6:
                return f"configure_file(f6 made @ONLY)\ninstall(FILES ${{CMAKE_BINARY_DIR}}/made {where})"
            case _:
                return f"install(DIRECTORY {where}/empty)"

    def change(self) -> None:
        match self.chance.randrange(6):
            case 0:
                self.rules[self.chance.randrange(len(self.rules))] = self.rule()
            case 1:
                path = self.home / f"f{self.chance.randrange(1, 7)}"
                path.chmod(self.chance.choice((0o644, 0o755)))
            case 2:
                path = self.home / self.chance.choice(("d/g3", "d/s/g1", "e/g1", "e/l", "d/new/g1"))
                if path.is_symlink() or path.exists():
                    path.unlink()
                elif path.name == "l":
                    path.symlink_to(self.chance.choice(("g1", "..", "nothing")))
                else:
                    path.parent.mkdir(exist_ok=True)
                    path.write_text("x")
            case 3:
                path = self.home / self.chance.choice(("d", "e")) / f"empty{self.chance.randrange(2)}"
                if path.exists():
                    path.rmdir()
                else:
                    path.mkdir(parents=True)
            case _:
                names = [f"f{number}" for number in range(1, 7)] + ["d/g1", "d/g2", "d/s/g1", "e/g1"]
                path = self.home / self.chance.choice(names)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(str(self.chance.randrange(3)))

    def write(self) -> None:
        text = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\n" + "\n".join(self.rules)
        path = self.home / "CMakeLists.txt"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


@pytest.mark.parametrize(
    "options",
    [(), (LINKED,), (MERGED,), (LINKED, MERGED)],
    ids=["copies", "links", "merged", "merged-links"],
)
@pytest.mark.parametrize("seed", range(int(os.environ.get("FORGE_TEST_EXAMPLES", "1"))))
def test_changed_files_and_rules_install_as_in_a_clean_build(
    forge: Forge, tree: Tree, seed: int, options: tuple[str, ...]
) -> None:
    names = [*(f"f{number}" for number in range(1, 7)), "d/g1", "d/g2", "d/s/g1", "e/g1"]
    root = tree(cmake("a", "", **dict.fromkeys(names, "0")))
    rules = Rules(random.Random(f"{seed} {options}"), root / "src/a")
    rules.write()
    build(forge, root, *options)
    for turn in range(8):
        for _ in range(rules.chance.choice((1, 1, 2))):
            rules.change()
        rules.write()
        build(forge, root, *options)
        # In CI, after every second change: a clean build takes as long as all else.
        if turn % 2 == 0 and "FORGE_TEST_EXAMPLES" not in os.environ:
            continue
        clean = root.parent / "clean"
        shutil.rmtree(clean, ignore_errors=True)
        shutil.copytree(root / "src", clean / "src", symlinks=True)
        build(forge, clean, *options)
        found, expected = (
            {
                path: {each: said.replace(str(place), "") for each, said in shown.items()}
                for path in "pqr"
                for shown in (look(prefix_of(place, "a", options) / "share" / path),)
            }
            for place in (root, clean)
        )
        assert found == expected, rules.rules


@pytest.mark.parametrize("options", [(), (MERGED,)], ids=["isolated", "merged"])
@pytest.mark.parametrize(
    "body",
    [
        "install(DIRECTORY d/ DESTINATION share)",
        'install(CODE "file(COPY ${PROJECT_SOURCE_DIR}/d/ DESTINATION ${CMAKE_INSTALL_PREFIX}/share)")',
    ],
    ids=["rules", "code"],
)
def test_a_kill_between_two_files_loses_no_file(
    forge: Forge, tree: Tree, body: str, options: tuple[str, ...]
) -> None:
    """The next build finishes what the killed one began."""
    count = FILES if "DIRECTORY" in body else FILES // 5
    files = {f"d/{number}": "1" for number in range(count)}
    root = tree(cmake("a", body, **files))
    build(forge, root, *options)
    chance, share = random.Random(1), prefix_of(root, "a", options) / "share"
    for turn in range(KILLS):
        tree({f"src/a/d/{number}": str(turn + 2) for number in range(count)})
        (root / "src/a/d" / f"more{turn}").write_text("1")
        running = subprocess.Popen(
            [sys.executable, "-m", "forge", "build", *options],
            cwd=root,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        newest = share / "0"
        while newest.read_text() == str(turn + 1) and running.poll() is None:
            pass
        time.sleep(chance.random() * 0.01)
        running.kill()
        running.wait()
        texts = {(share / f"{number}").read_text() for number in range(count)}
        assert texts <= {str(turn + 1), str(turn + 2)}
        build(forge, root, *options)
        assert {(share / f"{number}").read_text() for number in range(count)} == {str(turn + 2)}
    hold_against_clean(forge, root, *options)


SETUP = """import {imported}
from setuptools import setup

setup(
    name="p",
    version="0.1.0",
    packages=["p"],
    data_files=[("share/p", ["package.xml", "words.txt"])],
    entry_points={{"console_scripts": ["hello = p:main"]}},
)
"""


def python(imported: str = "os") -> dict[str, str]:
    return {
        "src/p/package.xml": manifest_text("p", build_type="ament_python"),
        "src/p/setup.py": SETUP.format(imported=imported),
        "src/p/setup.cfg": "[install]\ninstall_scripts=$base/lib/p\n",
        "src/p/p/__init__.py": "def main():\n    print(1)\n",
        "src/p/p/other.py": "",
        "src/p/words.txt": "1",
    }


def test_a_python_package_stays_usable_during_its_rebuild(forge: Forge, tree: Tree) -> None:
    root = tree(python())
    build(forge, root)
    prefix = root / "install/p"
    before, program = inodes(prefix), prefix / "lib/p/hello"
    with repeating(lambda: (program.is_file(), len([*prefix.rglob("__init__.py")]))) as said:
        tree({"src/p/p/__init__.py": "def main():\n    print(2)\n"})
        build(forge, root)
    assert {*said} == {(True, 1)}
    after = inodes(prefix)
    changed = {path for path in before | after if before.get(path) != after.get(path)}
    assert {Path(path).name for path in changed} - {"package.dsv", "RECORD"} == {"__init__.py"}
    (root / "src/p/p/other.py").unlink()
    tree({"src/p/setup.py": SETUP.format(imported="sys").replace("words.txt", "setup.cfg")})
    hold_against_clean(forge, root)


def test_a_setup_py_that_writes_to_its_prefix_installs_as_in_a_clean_build(forge: Forge, tree: Tree) -> None:
    root = tree(python())
    build(forge, root)
    tree(python("sys; open('words.txt', 'w').write(sys.prefix); import os"))
    build(forge, root)
    assert (root / "install/p/share/p/words.txt").read_text() == str(root / "install/p")
    hold_against_clean(forge, root)


@pytest.mark.parametrize("options", [(), (LINKED,)], ids=["copies", "links"])
def test_the_installed_manifest_follows_its_source(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    files = python()
    files["src/p/setup.py"] = files["src/p/setup.py"].replace('"package.xml", ', "")
    root = tree(files)
    build(forge, root, *options)
    manifest = files["src/p/package.xml"]
    tree({"src/p/package.xml": manifest.replace("</package>", "<!-- new --></package>")})
    build(forge, root, *options)
    assert "new" in (root / "install/p/share/p/package.xml").read_text()
    hold_against_clean(forge, root, *options)


@pytest.mark.parametrize("options", [(), (MERGED, "--no-observer")], ids=["isolated", "merged-unobserved"])
def test_an_edited_entry_of_the_ament_index_is_restored(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """One that the package does not install itself."""
    root = tree(python())
    build(forge, root, *options)
    (prefix_of(root, "p", options) / "share/ament_index/resource_index/packages/p").write_text("edited")
    hold_against_clean(forge, root, *options)


CAPABILITY = """
import os, sys
if os.geteuid() == 0:
    os.setxattr(sys.argv[1], "security.capability", bytes.fromhex("01000002000800" + "00" * 13))
"""


def test_file_capabilities_of_a_program_can_be_added_and_removed(forge: Forge, tree: Tree) -> None:
    """Only root may give them."""
    rules = "install(PROGRAMS x DESTINATION bin)\n"
    code = 'execute_process(COMMAND \\"{}\\" \\"{}\\" \\"\\${{CMAKE_INSTALL_PREFIX}}/bin/x\\")'
    root = tree(cmake("a", rules, **{"x": "#!/bin/sh\n", "cap.py": CAPABILITY}))
    program, description = root / "install/a/bin/x", root / "src/a/CMakeLists.txt"
    expected = ["security.capability"] if os.geteuid() == 0 else []
    without = description.read_text()
    build(forge, root)
    description.write_text(f'{without}install(CODE "{code.format(sys.executable, root / "src/a/cap.py")}")\n')
    build(forge, root)
    assert os.listxattr(program) == expected
    description.write_text(without)
    build(forge, root)
    assert os.listxattr(program) == []
