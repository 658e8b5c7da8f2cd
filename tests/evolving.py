"""A small workspace that changes as people change theirs, and what each change may cost.

Every edit is a function of the workspace and a number; it returns the packages that the next build may
run because of it. What it must run nobody says: the tree of a clean build tells if it ran too little.
"""

import hashlib
import itertools
import os
import re
import shutil
import stat
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.packages import manifest_text

VARIABLES = (
    ("CFLAGS", "-O1"),
    ("CMAKE_WORD", "{}"),
    ("FREE_WORD", "{}"),  # which only an observed build depends on
)
"""What edits set: variables that compilers read, and those that a CMakeLists.txt or a setup.py names."""
GATES = {"data-configure": "data", "base-build": "base", "base-install": "base"}
GATES |= {"listener-configure": "listener", "below_msgs-install": "below_msgs", "maker-build": "maker"}
"""Where a build waits, while somebody saves a file, and the package whose build reaches that."""

_BASE = """cmake_minimum_required(VERSION 3.18)
project(base C)
option(EXTRA "Install one file more" OFF)
set(LEVEL 1 CACHE STRING "How much")
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Debug CACHE STRING "What kind of build" FORCE)
endif()
file(GLOB sources ${CMAKE_CURRENT_SOURCE_DIR}/src/*.c)
add_custom_command(OUTPUT table.h
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/tools/table.sh > table.h)
add_library(base STATIC ${sources} ${CMAKE_CURRENT_BINARY_DIR}/table.h)
target_compile_definitions(base PRIVATE LEVEL=${LEVEL})
target_compile_options(base PRIVATE -Wa,-I${CMAKE_CURRENT_SOURCE_DIR}/raw)
target_include_directories(base PRIVATE early include private chosen
  ${CMAKE_CURRENT_BINARY_DIR} @OUTSIDE@/early @OUTSIDE@)
install(TARGETS base DESTINATION lib)
install(DIRECTORY include/ DESTINATION include)
install(FILES cmake/baseConfig.cmake DESTINATION share/base/cmake)
install(FILES flags.dsv DESTINATION share/base/environment)
install(SCRIPT tools/gate.cmake)
if(EXTRA)
  install(FILES package.xml DESTINATION share/base RENAME extra.xml)
endif()
"""
_CONFIG = """get_filename_component(base_prefix ${CMAKE_CURRENT_LIST_DIR}/../../.. ABSOLUTE)
add_library(base::base STATIC IMPORTED)
set_target_properties(base::base PROPERTIES IMPORTED_LOCATION ${base_prefix}/lib/libbase.a
  INTERFACE_INCLUDE_DIRECTORIES "${base_prefix}/include/first;${base_prefix}/include")
"""
_SOURCE = """#include "base/base.h"
#include "inner.h"
#include "part.h"
#include "table.h"
#include <outer.h>
#if __has_include("maybe.h")
#include "maybe.h"
#else
#define MAYBE 0
#endif
asm(".data\\n.incbin \\"blob.bin\\"\\n.text");
int base(void) {{ return BASE + INNER + PART + TABLE + OUTER + MAYBE + LEVEL + {}; }}
"""
_TABLE = """here=$(dirname "$0")
sh "$here/gate.sh" base-build
echo "#define TABLE $(cat "$here/../raw/table.txt")"
"""
_GATE = """# Waits while the test saves something.
gate=@GATES@/$1
if [ -d "$gate" ]; then
  touch "$gate/reached"
  until [ ! -d "$gate" ]; do sleep 0.02; done
fi
"""
_GATE_SCRIPT = "execute_process(COMMAND sh ${{CMAKE_CURRENT_LIST_DIR}}/gate.sh {}-install)\n"
_USER = """cmake_minimum_required(VERSION 3.18)
project(user C)
find_package(base REQUIRED)
find_package(low REQUIRED)
find_file(found_maybe base/maybe.h PATHS ${base_prefix}/include NO_DEFAULT_PATH)
if(found_maybe)
  add_definitions(-DFOUND)
endif()
add_executable(main src/main.c)
target_include_directories(main PRIVATE ${low_INCLUDE_DIRS})
target_link_libraries(main base::base)
add_executable(other src/other.c)
target_link_libraries(other -L${base_prefix}/lib -lbase)
install(TARGETS main other DESTINATION lib/user)
install(PROGRAMS scripts/run.sh DESTINATION lib/user)
"""
_MAIN = """#include "base/base.h"
#include <low/low.h>
#if __has_include(<base/maybe.h>)
#include <base/maybe.h>
#endif
#ifndef HOOK
#define HOOK 0
#endif
int main(void) {{ return base() + BASE + LOW + HOOK + {}; }}
"""
_LOW = """cmake_minimum_required(VERSION 3.18)
project(low NONE)
install(DIRECTORY include/ DESTINATION include)
install(FILES lowConfig.cmake DESTINATION share/low/cmake)
"""
_LOW_CONFIG = """get_filename_component(low_INCLUDE_DIRS ${CMAKE_CURRENT_LIST_DIR}/../../../include ABSOLUTE)
"""
_DATA = """cmake_minimum_required(VERSION 3.18)
project(data NONE)
file(GLOB found ${CMAKE_CURRENT_SOURCE_DIR}/files/*.txt)
file(READ ${CMAKE_CURRENT_SOURCE_DIR}/read/version.txt version)
file(STRINGS ${CMAKE_CURRENT_SOURCE_DIR}/read/lines.txt lines)
execute_process(COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/tools/say.sh OUTPUT_VARIABLE spoken)
install(FILES ${found} DESTINATION share/data/files)
install(DIRECTORY tree DESTINATION share/data USE_SOURCE_PERMISSIONS)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/words.txt
  "${EXTRA} ${CMAKE_BUILD_TYPE} $ENV{CMAKE_WORD} $ENV{FREE_WORD} ${version} ${lines} ${spoken}")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/words.txt DESTINATION share/data)
install(FILES dataConfig.cmake DESTINATION share/data/cmake)
"""
_SAY = """here=$(dirname "$0")
sh "$here/gate.sh" data-configure
cat "$here/../read/spoken.txt"
"""
_READER = """cmake_minimum_required(VERSION 3.18)
project(reader NONE)
find_package(data REQUIRED)
file(READ ${data_words} text)
configure_file(reader.txt.in reader.txt)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/reader.txt DESTINATION share/reader)
"""
_MAKER = """cmake_minimum_required(VERSION 3.18)
project(maker NONE)
include(cmake/more.cmake)
set(tools ${CMAKE_CURRENT_SOURCE_DIR}/tools)
add_custom_command(OUTPUT first.txt COMMAND sh ${tools}/first.sh ${MORE})
add_custom_command(OUTPUT second.txt DEPENDS first.txt COMMAND cat first.txt side.txt > second.txt)
add_custom_command(OUTPUT found.txt COMMAND sh ${tools}/found.sh)
add_custom_command(OUTPUT tree.stamp COMMAND sh ${tools}/tree.sh)
add_custom_target(everything ALL DEPENDS second.txt found.txt tree.stamp)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/second.txt ${CMAKE_CURRENT_BINARY_DIR}/found.txt
  DESTINATION share/maker)
install(DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/tree DESTINATION share/maker)
install(PROGRAMS tools/say DESTINATION lib/maker)
install(FILES makerConfig.cmake DESTINATION share/maker/cmake)
install(CODE "file(READ ${CMAKE_CURRENT_SOURCE_DIR}/undeclared/post.txt text)
  file(WRITE \\$ENV{DESTDIR}\\${CMAKE_INSTALL_PREFIX}/share/maker/post.txt \\${text})")
"""
_MAKER_CONFIG = """get_filename_component(maker_prefix ${CMAKE_CURRENT_LIST_DIR}/../../.. ABSOLUTE)
"""
_FIRST = """here=$(dirname "$0")
sh "$here/gate.sh" maker-build
cat "$here/../undeclared/first.txt" > first.txt
echo "$1" >> first.txt
cp "$here/../undeclared/side.txt" side.txt
"""
_FOUND = """here=$(dirname "$0")
cat "$here/../early/found.txt" > found.txt 2>/dev/null || cat "$here/../late/found.txt" > found.txt
"""
_TREE = """here=$(dirname "$0")
mkdir -p tree
cp "$here"/../lists/* tree
touch tree.stamp
"""
_TAKER = """cmake_minimum_required(VERSION 3.18)
project(taker NONE)
find_package(maker REQUIRED)
execute_process(COMMAND ${maker_prefix}/lib/maker/say OUTPUT_VARIABLE said)
add_custom_command(OUTPUT taken.txt
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/take.sh ${maker_prefix}/share/maker > taken.txt)
add_custom_target(everything ALL DEPENDS taken.txt)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/taken.txt DESTINATION share/taker)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/said.txt "${said}")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/said.txt DESTINATION share/taker)
"""
_SETUP = """import os
from glob import glob
from setuptools import find_packages, setup

setup(
    name="script",
    version="0.1.0",
    description=os.environ.get("FREE_WORD", "none"),
    packages=find_packages(),
    data_files=[("share/script/data", sorted(glob("data/*"))), ("share/script", ["package.xml"])],
    entry_points={"console_scripts": ["say = script.say:main"]},
)
"""

PLAIN: Mapping[str, str] = {
    "src/base/package.xml": manifest_text("base", build_type="cmake"),
    "src/base/colcon.pkg": '{"hooks": ["share/base/environment/flags.dsv"]}\n',
    "src/base/CMakeLists.txt": _BASE,
    "src/base/cmake/baseConfig.cmake": _CONFIG,
    "src/base/flags.dsv": "set;CFLAGS;-DHOOK=1\n",
    "src/base/include/base/base.h": "#pragma once\n#define BASE 1\nint base(void);\n",
    "src/base/include/first/base/first.h": "#define FIRST\n",
    "src/base/private/inner.h": "#define INNER 1\n",
    "src/base/one/part.h": "#define PART 1\n",
    "src/base/two/part.h": "#define PART 2\n",
    "src/base/raw/blob.bin": "1\n",
    "src/base/raw/table.txt": "1\n",
    "src/base/tools/gate.sh": _GATE,
    "src/base/tools/gate.cmake": _GATE_SCRIPT.format("base"),
    "src/base/tools/table.sh": _TABLE,
    "src/base/chosen": "-> one",
    "src/base/src/base.c": _SOURCE.format(1),
    "src/user/package.xml": manifest_text(
        "user", "<depend>base</depend>", "<depend>low</depend>", build_type="cmake"
    ),
    "src/user/CMakeLists.txt": _USER,
    "src/user/scripts/run.sh": "#!/bin/sh\necho run\n",
    "src/user/src/main.c": _MAIN.format(0),
    "src/user/src/other.c": "int base(void);\nint main(void) { return base(); }\n",
    "src/data/package.xml": manifest_text("data", build_type="cmake"),
    "src/data/CMakeLists.txt": _DATA,
    "src/data/dataConfig.cmake": "set(data_words ${CMAKE_CURRENT_LIST_DIR}/../words.txt)\n",
    "src/data/files/one.txt": "1\n",
    "src/data/tree/deep/leaf.txt": "1\n",
    "src/data/read/version.txt": "1\n",
    "src/data/read/lines.txt": "1\n",
    "src/data/read/spoken.txt": "1\n",
    "src/data/tools/gate.sh": _GATE,
    "src/data/tools/say.sh": _SAY,
    "src/reader/package.xml": manifest_text("reader", "<depend>data</depend>", build_type="cmake"),
    "src/reader/CMakeLists.txt": _READER,
    "src/reader/reader.txt.in": "${text} as reader has it\n",
}
PYTHON: Mapping[str, str] = {
    "src/script/package.xml": manifest_text(
        "script", "<exec_depend>data</exec_depend>", build_type="ament_python"
    ),
    "src/script/setup.py": _SETUP,
    "src/script/script/__init__.py": "",
    "src/script/script/say.py": "def main():\n    print(1)\n",
    "src/script/data/one.txt": "1\n",
    "src/script/resource/script": "",
}
MADE: Mapping[str, str] = {
    "src/maker/package.xml": manifest_text("maker", build_type="cmake"),
    "src/maker/CMakeLists.txt": _MAKER,
    "src/maker/makerConfig.cmake": _MAKER_CONFIG,
    "src/maker/cmake/more.cmake": "set(MORE 1)\n",
    "src/maker/undeclared/first.txt": "1\n",
    "src/maker/undeclared/side.txt": "1\n",
    "src/maker/undeclared/post.txt": "1\n",
    "src/maker/late/found.txt": "1\n",
    "src/maker/lists/one.txt": "1\n",
    "src/maker/tools/first.sh": _FIRST,
    "src/maker/tools/found.sh": _FOUND,
    "src/maker/tools/tree.sh": _TREE,
    "src/maker/tools/gate.sh": _GATE,
    "src/maker/tools/say": "#!/bin/sh\necho 1\n",
    "src/taker/package.xml": manifest_text("taker", "<depend>maker</depend>", build_type="cmake"),
    "src/taker/CMakeLists.txt": _TAKER,
    "src/taker/take.sh": "ls $1/tree\ncat $1/second.txt $1/tree/*\n",
}
"""Commands that declare little of what they read and write, and a user of what they made."""
_INTERFACES = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
find_package(rosidl_default_generators REQUIRED)
{more}
file(GLOB found RELATIVE ${{CMAKE_CURRENT_SOURCE_DIR}} msg/*.msg)
rosidl_generate_interfaces(${{PROJECT_NAME}} ${{found}} {depends})
ament_package()
"""
_LISTENER = """cmake_minimum_required(VERSION 3.18)
project(listener CXX)
find_package(ament_cmake REQUIRED)
find_package(above_msgs REQUIRED)
add_executable(listener src/main.cpp)
ament_target_dependencies(listener above_msgs)
install(TARGETS listener DESTINATION lib/${PROJECT_NAME})
execute_process(COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/tools/gate.sh listener-configure)
ament_package()
"""
_INTERFACE_LINES = (
    "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
    "<exec_depend>rosidl_default_runtime</exec_depend>",
    "<member_of_group>rosidl_interface_packages</member_of_group>",
)
MESSAGES: Mapping[str, str] = {
    "src/below_msgs/package.xml": manifest_text("below_msgs", *_INTERFACE_LINES),
    "src/below_msgs/CMakeLists.txt": _INTERFACES.format(
        name="below_msgs", more="install(SCRIPT tools/gate.cmake)", depends=""
    ),
    "src/below_msgs/tools/gate.sh": _GATE,
    "src/below_msgs/tools/gate.cmake": _GATE_SCRIPT.format("below_msgs"),
    "src/below_msgs/msg/Below.msg": "int32 x\n",
    "src/above_msgs/package.xml": manifest_text(
        "above_msgs", *_INTERFACE_LINES, "<depend>below_msgs</depend>", "<depend>low_msgs</depend>"
    ),
    "src/above_msgs/CMakeLists.txt": _INTERFACES.format(
        name="above_msgs",
        more="find_package(below_msgs REQUIRED)\nfind_package(low_msgs REQUIRED)",
        depends="DEPENDENCIES below_msgs low_msgs",
    ),
    "src/above_msgs/msg/Above.msg": "below_msgs/Below[3] all\nlow_msgs/Low low\n",
    "src/listener/package.xml": manifest_text(
        "listener", "<buildtool_depend>ament_cmake</buildtool_depend>", "<depend>above_msgs</depend>"
    ),
    "src/listener/CMakeLists.txt": _LISTENER,
    "src/listener/tools/gate.sh": _GATE,
    "src/listener/src/main.cpp": "#include <above_msgs/msg/above.hpp>\n"
    "int main() { return sizeof(above_msgs::msg::Above); }\n",
}

LOW: Mapping[str, str] = {
    "low/package.xml": manifest_text("low", build_type="cmake"),
    "low/CMakeLists.txt": _LOW,
    "low/lowConfig.cmake": _LOW_CONFIG,
    "low/include/low/low.h": "#define LOW {}\n",
}
"""A package that an underlay has, and that may be cloned into the workspace."""
LOW_MSGS: Mapping[str, str] = {
    "low_msgs/package.xml": manifest_text("low_msgs", *_INTERFACE_LINES),
    "low_msgs/CMakeLists.txt": _INTERFACES.format(name="low_msgs", more="", depends=""),
    "low_msgs/msg/Low.msg": "int32 x\nint32 NUMBER={}\n",
}

NEEDS = {
    "low": (),
    "low_msgs": (),
    "base": (),
    "user": ("base", "low"),
    "data": (),
    "reader": ("data",),
    "script": ("data",),
    "maker": (),
    "taker": ("maker",),
    "below_msgs": (),
    "above_msgs": ("below_msgs", "low_msgs"),
    "listener": ("above_msgs", "below_msgs", "low_msgs"),
}


@dataclass(frozen=True, slots=True)
class Save:
    """Somebody saves a file, or puts back what it was, while a build waits at a gate."""

    gate: str
    path: Path
    content: bytes
    keeps_time: bool = False

    def __call__(self) -> None:
        if not self.path.parent.is_dir():
            return
        before = self.path.stat() if self.path.exists() else None
        self.path.write_bytes(self.content)
        if before and self.keeps_time:
            os.utime(self.path, ns=(before.st_atime_ns, before.st_mtime_ns))


@dataclass(slots=True)
class Evolving:
    """A workspace below `root`/ws, with what the next build is told and what it may run."""

    root: Path
    merged: bool = False
    symlink: bool = False
    observed: bool = True
    """If builds are observed: without, they are not told of some changes outside of the workspace."""
    arguments: set[str] = field(default_factory=set)
    variables: dict[str, str] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    low: Mapping[str, str] = field(default_factory=dict)
    """The package of the underlay, for those who clone it."""
    underlays: tuple[Path, ...] = ()
    """What the underlay may say: two prefixes."""
    saves: list[Save] = field(default_factory=list)
    """What is saved while the next build runs."""
    needs: dict[str, tuple[str, ...]] = field(default_factory=lambda: dict(NEEDS))
    """What may change a package; a need that was there once stays, which allows too much at worst."""

    @property
    def home(self) -> Path:
        return self.root / "ws"

    @property
    def outside(self) -> Path:
        """A header that is nobody's, as those of the system are."""
        return self.root / "outside" / "outer.h"

    @property
    def under(self) -> Path:
        return self.root / "under"

    @property
    def gates(self) -> Path:
        """Where the folders are that builds wait for."""
        # Nobody observes what is looked for in /proc.
        return Path(f"/proc/self/root/dev/shm/forge{self.root}/gates")

    @property
    def packages(self) -> tuple[str, ...]:
        return tuple(name for name in NEEDS if (self.home / "src" / name).is_dir())

    def write(self, files: Mapping[str, str]) -> None:
        """Make the workspace anew from a table of paths and texts."""
        shutil.rmtree(self.root, ignore_errors=True)
        self.outside.parent.mkdir(parents=True)
        self.outside.write_text("#define OUTER 1\n", encoding="utf-8")
        for name, text in files.items():
            path = self.home / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if text.startswith("-> "):
                path.symlink_to(text[3:])
                continue
            said = text.replace("@OUTSIDE@", str(self.outside.parent)).replace("@GATES@", str(self.gates))
            path.write_text(said, encoding="utf-8")
            if text.startswith("#!"):
                path.chmod(0o755)
        if self.underlays:
            shutil.copytree(self.underlays[0], self.under, symlinks=True)

    @contextmanager
    def saving(self) -> Iterator[set[str]]:
        """Save files while a build runs; yield the packages that this concerns, or none.

        Where the build does not reach a gate, files are saved when it has ended.
        """
        waiting, self.saves = self.saves, []
        for save in waiting:
            (self.gates / save.gate).mkdir(parents=True, exist_ok=True)
        ended = threading.Event()
        saver = threading.Thread(target=self._save, args=(waiting, ended))
        saver.start()
        try:
            yield {
                name
                for save in waiting
                for name in (
                    self.above("base", "data")
                    if save.path == self.outside
                    else self.above(save.path.relative_to(self.home / "src").parts[0])
                )
            }
        finally:
            ended.set()
            saver.join()

    def _save(self, waiting: Sequence[Save], ended: threading.Event) -> None:
        folders = [self.gates / save.gate for save in waiting]
        for gate, saves in itertools.groupby(waiting, key=lambda save: save.gate):
            folder = self.gates / gate
            # The build may be at a later gate, if the command before this one did not have to run.
            while not any((each / "reached").exists() for each in folders) and not ended.wait(0.01):
                pass
            for save in saves:
                save()
                time.sleep(0.05)
            shutil.rmtree(folder)

    def options(self) -> tuple[str, ...]:
        words = ["--merge-install"] if self.merged else []
        words += ["--symlink-install"] if self.symlink else []
        return (*words, *(["--cmake-args", *sorted(self.arguments)] if self.arguments else ()))

    def above(self, *names: str) -> set[str]:
        """Return the packages and all that need them, of those that there are."""
        found: set[str] = set()
        waiting = [*names]
        while waiting:
            name = waiting.pop()
            found.add(name)
            waiting += [user for user in NEEDS if name in self.needs[user] and user not in found]
        return found.intersection(self.packages)

    def key(self) -> str:
        """Return a digest of everything that a clean build depends on."""
        said: list[object] = [self.options(), sorted(self.variables.items())]
        folders = ("outside", "private", "under", "ws/src")
        said += [look(self.root / name) for name in folders]
        return hashlib.sha256(repr(said).encode()).hexdigest()


Entry = tuple[str, ...]


def look(folder: Path) -> dict[str, Entry]:
    """Return everything below a folder: kinds, modes, contents, targets of links; but no times."""
    found: dict[str, Entry] = {}
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(place, name)
            status = path.lstat()
            where = str(path.relative_to(folder))
            if stat.S_ISLNK(status.st_mode):
                found[where] = ("link", str(path.readlink()))
            elif stat.S_ISDIR(status.st_mode):
                found[where] = ("folder",)
            else:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                found[where] = ("file", f"{stat.S_IMODE(status.st_mode):o}", digest)
    return found


def differences(actual: Mapping[str, Entry], expected: Mapping[str, Entry]) -> list[str]:
    """Return what is not as in a clean build, one line each; folders count by what is in them."""
    actual, expected = (
        {name: entry for name, entry in tree.items() if entry != ("folder",)} for tree in (actual, expected)
    )
    lines = [f"left behind: {name}" for name in sorted(actual.keys() - expected.keys())]
    lines += [f"missing: {name}" for name in sorted(expected.keys() - actual.keys())]
    both = sorted(name for name in actual.keys() & expected.keys() if actual[name] != expected[name])
    return lines + [f"different: {name}: {actual[name]}, not {expected[name]}" for name in both]


Edit = "Callable[[Evolving, int], set[str]]"


def _touch(workspace: Evolving, number: int) -> set[str]:
    os.utime(_sources(workspace)[number % len(_sources(workspace))])
    return set()


def _touch_old(workspace: Evolving, number: int) -> set[str]:
    os.utime(_sources(workspace)[number % len(_sources(workspace))], (1, 1))
    return set()


def _remark(workspace: Evolving, number: int) -> set[str]:
    """Change a text in a way that changes nothing that is installed."""
    own = [
        path
        for path in _sources(workspace)
        if path.name in {"CMakeLists.txt", "base.c", "main.c", "main.cpp"}
    ]
    if not own:
        return set()
    path = own[number % len(own)]
    with path.open("a", encoding="utf-8") as stream:
        stream.write(f"{'#' if path.suffix == '.txt' else '//'} {number}\n")
    return {_package(workspace, path)}


def _change(workspace: Evolving, number: int) -> set[str]:
    path = _changeable(workspace, number)
    if path is None:
        return set()
    _rewrite(path, number)
    return workspace.above(_package(workspace, path))


def _replace_by_older(workspace: Evolving, number: int) -> set[str]:
    """Put another file in its place that carries an old time, as tools do that keep times."""
    path = _changeable(workspace, number)
    if path is None:
        return set()
    other = workspace.root / "other"
    shutil.copyfile(path, other)
    other.chmod(path.stat().st_mode)
    _rewrite(other, number, like=path)
    os.utime(other, (1_000_000_000 + number, 1_000_000_000 + number))
    other.replace(path)
    return workspace.above(_package(workspace, path))


def _change_in_place_keeping_times(workspace: Evolving, number: int) -> set[str]:
    """Change what a file says and set its time back, as an editor with a bad clock would."""
    path = _changeable(workspace, number)
    if path is None:
        return set()
    before = path.stat()
    _rewrite(path, number)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    return workspace.above(_package(workspace, path))


def _add(workspace: Evolving, number: int) -> set[str]:
    """Add a file that a file(GLOB) finds; the time it carries may be old."""
    new = [
        ("base", f"src/added_{number % 3}.c", f"int added_{number % 3}(void) {{ return {number}; }}\n"),
        ("base", f"include/base/added_{number % 3}.h", f"#define ADDED {number}\n"),
        ("data", f"files/added_{number % 3}.txt", f"{number}\n"),
        ("data", f"tree/deep/{number % 3}/added.txt", f"{number}\n"),
        ("maker", f"lists/added_{number % 3}.txt", f"{number}\n"),
        ("script", f"data/added_{number % 3}.txt", f"{number}\n"),
        ("script", f"script/added_{number % 3}.py", f"NUMBER = {number}\n"),
        ("below_msgs", f"msg/Added{number % 3}.msg", f"int32 NUMBER={number}\n"),
        ("above_msgs", f"msg/Added{number % 3}.msg", "below_msgs/Below one\n"),
    ]
    new = [entry for entry in new if entry[0] in workspace.packages]
    if not new:
        return set()
    package, name, text = new[number % len(new)]
    path = workspace.home / "src" / package / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(text, encoding="utf-8")
    if number % 2:
        os.utime(path, (1_000_000_000, 1_000_000_000))
    return workspace.above(package)


def _remove(workspace: Evolving, number: int) -> set[str]:
    added = [path for path in _sources(workspace) if "dded" in path.name]
    if not added:
        return set()
    path = added[number % len(added)]
    path.unlink()
    return workspace.above(_package(workspace, path))


def _rename(workspace: Evolving, number: int) -> set[str]:
    """Give an added file another name; its time stays."""
    added = [path for path in _sources(workspace) if "dded" in path.name]
    if not added:
        return set()
    path = added[number % len(added)]
    path.replace(
        path.with_name(path.name.replace("dded", "ddedAgain" if "Again" not in path.name else "dded"))
    )
    return workspace.above(_package(workspace, path))


def _link(workspace: Evolving, number: int) -> set[str]:
    """Replace a data file by a link to the header outside, whose text then counts as the package's."""
    path = workspace.home / "src/data/files/linked.txt"
    if not path.parent.is_dir():
        return set()
    if path.is_symlink():
        path.unlink()
    else:
        path.symlink_to(workspace.outside if number % 2 else workspace.home / "src/data/package.xml")
    return workspace.above("data")


def _link_folder(workspace: Evolving, number: int) -> set[str]:
    """Make a folder of headers a link to one outside of the package, or a folder again; or change that."""
    folder = workspace.home / "src/base/private"
    away = workspace.root / "private"
    if not folder.is_dir():
        return set()
    if folder.is_symlink() and number % 2:
        _rewrite(folder / "inner.h", number)
        if number % 4 == 1:
            os.utime(folder / "inner.h", (1_000_000_000, 1_000_000_000))
    elif folder.is_symlink():
        folder.unlink()
        shutil.move(away, folder)
    else:
        shutil.move(folder, away)
        folder.symlink_to(away)
    return workspace.above("base")


def _default(workspace: Evolving, number: int) -> set[str]:
    """Change what an option, a cached variable or the build type is unless somebody says otherwise."""
    path = workspace.home / "src/base/CMakeLists.txt"
    if not path.is_file():
        return set()
    text = path.read_text(encoding="utf-8")
    if number % 3 == 0:
        text = re.sub(r"(more\") \w+\)", rf"\1 {'ON' if number % 2 else 'OFF'})", text)
    elif number % 3 == 1:
        text = re.sub(r"LEVEL \d CACHE", f"LEVEL {number % 10} CACHE", text)
    else:
        text = re.sub(r"_TYPE \w+ CACHE", f"_TYPE {'Debug' if number % 2 else 'Release'} CACHE", text)
    path.write_text(text, encoding="utf-8")
    return workspace.above("base")


_SHADOWS = (
    ("base/early/inner.h", "#define INNER {}\n"),
    ("base/src/inner.h", "#define INNER {}\n"),
    ("base/early/part.h", "#define PART {}\n"),
    ("base/private/part.h", "#define PART {}\n"),
    ("base/early/outer.h", "#define OUTER {}\n"),
    ("base/early/maybe.h", "#define MAYBE {}\n"),
    ("base/include/first/base/base.h", "#pragma once\n#define BASE {}\nint base(void);\n"),
    ("base/include/base/maybe.h", "#define HOOK {}\n"),
    ("base/../../../outside/early/outer.h", "#define OUTER {}\n"),
    ("maker/early/found.txt", "{}\n"),
)


def _shadow(workspace: Evolving, number: int) -> set[str]:
    """Put a header where it is found before another one, or at last; or remove it again."""
    shadows = [
        entry
        for entry in _SHADOWS
        if entry[0].split("/")[0] in workspace.packages and (workspace.observed or ".." not in entry[0])
    ]
    if not shadows:
        return set()
    name, text = shadows[number % len(shadows)]
    path = workspace.home / "src" / name
    if path.exists():
        path.unlink()
        return workspace.above(name.split("/")[0])
    moved = workspace.root / "moved"
    moved.write_text(text.format(number), encoding="utf-8")
    if number % 2:
        os.utime(moved, (1_000_000_000, 1_000_000_000))
    path.parent.mkdir(parents=True, exist_ok=True)
    moved.replace(path)
    return workspace.above(name.split("/")[0])


_SWAPPED = (
    ("base/one", "base/two"),
    ("base/one/part.h", "base/two/part.h"),
    ("base/raw/blob.bin", "base/raw/table.txt"),
    ("data/read/version.txt", "data/read/lines.txt"),
    ("data/read/spoken.txt", "data/files/one.txt"),
    ("maker/undeclared/side.txt", "maker/undeclared/post.txt"),
)


def _swap(workspace: Evolving, number: int) -> set[str]:
    """Let two files or folders change places by renaming: all times stay."""
    pairs = [pair for pair in _SWAPPED if pair[0].split("/")[0] in workspace.packages]
    if not pairs:
        return set()
    one, other = (workspace.home / "src" / name for name in pairs[number % len(pairs)])
    if not (one.exists() and other.exists()):
        return set()
    _exchange(workspace, one, other)
    return workspace.above(_package(workspace, one))


def _exchange(workspace: Evolving, one: Path, other: Path) -> None:
    moved = workspace.root / "moved"
    one.rename(moved)
    other.rename(one)
    moved.rename(other)


def _swap_package(workspace: Evolving, number: int) -> set[str]:
    """Put an older copy of a package in its place, or the newer one again, as 'mv' does."""
    name = workspace.packages[number % len(workspace.packages)]
    if name in workspace.broken:
        return set()
    home, other = workspace.home / "src" / name, workspace.root / "older" / name
    if not other.is_dir():
        shutil.copytree(home, other, symlinks=True)
        for path in other.rglob("*"):
            if path.name in _CHANGEABLE and not path.is_symlink():
                _rewrite(path, number)
            os.utime(path, (1_000_000_000, 1_000_000_000), follow_symlinks=False)
    _exchange(workspace, home, other)
    return workspace.above(name)


def _switch_link(workspace: Evolving, number: int) -> set[str]:
    """Let a link to a folder of headers lead to another one."""
    path = workspace.home / "src/base/chosen"
    if not path.is_symlink():
        return set()
    path.unlink()
    path.symlink_to(("one", "two")[number % 2])
    return workspace.above("base")


def _underlay(workspace: Evolving, number: int) -> set[str]:
    """Let the underlay say something else: all of it comes anew, with old times, or single files change."""
    state = workspace.underlays[number % 2]
    if number % 4 < 2:
        shutil.rmtree(workspace.under)
        shutil.copytree(state, workspace.under, symlinks=True)
    else:
        for name, entry in look(state).items():
            if entry[0] == "file" and look(workspace.under).get(name) != entry:
                shutil.copyfile(state / name, workspace.under / name)
    return workspace.above("low", "low_msgs")


def _overlay(workspace: Evolving, number: int) -> set[str]:
    """Clone a package of the underlay into the workspace, or remove the clone."""
    name = "low" if "low/package.xml" in workspace.low else "low_msgs"
    home = workspace.home / "src" / name
    concerned = workspace.above(name)
    if home.is_dir():
        shutil.rmtree(home)
        workspace.broken.discard(name)
        return concerned
    for path, text in workspace.low.items():
        target = workspace.home / "src" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        said = text.format(number % 10) if target.suffix in {".h", ".msg"} else text
        target.write_text(said, encoding="utf-8")
    return workspace.above(name)


_REACHED = {
    "data-configure": "src/data/read/spoken.txt",
    "base-build": "src/base/raw/table.txt",
    "base-install": "src/base/raw/table.txt",
    "listener-configure": "src/listener/src/main.cpp",
    "below_msgs-install": "src/below_msgs/msg/Below.msg",
    "maker-build": "src/maker/undeclared/first.txt",
}
"""What has to change for a build to reach a gate."""


def _save(workspace: Evolving, number: int) -> set[str]:
    """Save a file while the next build runs, and perhaps put back what it was."""
    gates = [gate for gate, package in GATES.items() if package in workspace.packages]
    if workspace.saves or not gates:
        return set()
    gate = gates[number % len(gates)]
    changed = workspace.home / _REACHED[gate]
    if changed.name == "main.cpp":
        with changed.open("a", encoding="utf-8") as stream:
            stream.write(f"// {number}\n")
    else:
        _rewrite(changed, number)
    kind, number = number % 4, number // 4
    saved = _changeable(workspace, number)
    if number % 5 == 0 and "base" in workspace.packages:
        saved, content = workspace.outside, f"#define OUTER {number}\n"
    elif kind == 2 and "base" in workspace.packages:
        saved = workspace.home / f"src/base/src/added_{number % 3}.c"
        content = f"int added_{number % 3}(void) {{ return {number}; }}\n"
    elif saved is None:
        return workspace.above(GATES[gate])
    else:
        content = _said(saved, number)
    workspace.saves.append(Save(gate, saved, content.encode(), keeps_time=kind == 3))
    if kind == 1 and saved.exists():
        later = "base-install" if gate == "base-build" else gate
        workspace.saves.append(Save(later, saved, saved.read_bytes()))
    return workspace.above(GATES[gate])


def _mode(workspace: Evolving, number: int) -> set[str]:
    """Make a file executable, or no longer so."""
    paths = [workspace.home / "src/data/tree/deep/leaf.txt", workspace.home / "src/user/scripts/run.sh"]
    path = paths[number % 2]
    if not path.exists():
        return set()
    path.chmod(stat.S_IMODE(path.stat().st_mode) ^ 0o100)
    return workspace.above(_package(workspace, path))


def _manifest(workspace: Evolving, number: int) -> set[str]:
    name = workspace.packages[number % len(workspace.packages)]
    path = workspace.home / "src" / name / "package.xml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("0.1.0", f"0.1.{number}", 1), encoding="utf-8")
    return workspace.above(name)


def _dependency(workspace: Evolving, number: int) -> set[str]:
    """Let a package need another one to run, or no longer."""
    name = ("user", "script", "listener")[number % 3]
    other = ("reader", "user", "below_msgs")[number % 3]
    path = workspace.home / "src" / name / "package.xml"
    if not path.is_file() or other not in workspace.packages:
        return set()
    text = path.read_text(encoding="utf-8")
    line = f"  <exec_depend>{other}</exec_depend>\n"
    path.write_text(
        text.replace(line, "") if line in text else text.replace("  <export>", f"{line}  <export>"),
        encoding="utf-8",
    )
    workspace.needs[name] = (*workspace.needs[name], other)
    return workspace.above(name)


def _argument(workspace: Evolving, number: int) -> set[str]:
    words = ("-DEXTRA=ON", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_C_FLAGS=-DFLAG")
    workspace.arguments ^= {words[number % 3]}
    return set(workspace.packages)


def _variable(workspace: Evolving, number: int) -> set[str]:
    name, value = VARIABLES[number % (len(VARIABLES) if workspace.observed else 2)]
    value = value.format(number % 4)
    if workspace.variables.get(name) == value:
        del workspace.variables[name]
    else:
        workspace.variables[name] = value
    if name == "FREE_WORD":
        return workspace.above("data", "script")  # which name it; no compiler reads it
    return set(workspace.packages)


def _links(workspace: Evolving, number: int) -> set[str]:
    del number
    workspace.symlink = not workspace.symlink
    return set(workspace.packages)


def _outer(workspace: Evolving, number: int) -> set[str]:
    """Change the header outside, perhaps with an old time."""
    workspace.outside.write_text(f"#define OUTER {number}\n", encoding="utf-8")
    if number % 2:
        os.utime(workspace.outside, (1_000_000_000, 1_000_000_000))
    return workspace.above("base", "data")


def _delete_installed(workspace: Evolving, number: int) -> set[str]:
    """Remove an installed file; only its package is built again."""
    owned = _installed(workspace)
    if not owned:
        return set()
    path, package = owned[number % len(owned)]
    path.unlink()
    return {package}


def _overwrite_installed(workspace: Evolving, number: int) -> set[str]:
    # An edited file that is no longer installed stays, so none whose source may be removed.
    owned = [
        (path, package)
        for path, package in _installed(workspace)
        if not path.is_symlink() and "dded" not in path.name
    ]
    if not owned:
        return set()
    path, package = owned[number % len(owned)]
    path.chmod(0o644)
    path.write_text(f"{number}", encoding="utf-8")
    return {package}


def _delete_built(workspace: Evolving, number: int) -> set[str]:
    name = workspace.packages[number % len(workspace.packages)]
    shutil.rmtree(workspace.home / "build" / name, ignore_errors=True)
    return {name}


def _lose(workspace: Evolving, number: int) -> set[str]:
    """Lose what forge remembers."""
    path = workspace.home / "build" / ("forge_journal.jsonl", "forge_files.json")[number % 2]
    path.unlink(missing_ok=True)
    return set() if number % 2 else set(workspace.packages)


def _garble(workspace: Evolving, number: int) -> set[str]:
    """Cut the journal in the middle of a line, as a full disk does."""
    path = workspace.home / "build" / "forge_journal.jsonl"
    if path.is_file():
        content = path.read_bytes()
        path.write_bytes(content[: len(content) * (1 + number % 7) // 8])
    return set(workspace.packages)


def _break(workspace: Evolving, number: int) -> set[str]:
    """Break or repair a package; which steps run until the next successful build is not predicted."""
    name = workspace.packages[number % len(workspace.packages)]
    path = workspace.home / "src" / name / ("setup.py" if name == "script" else "CMakeLists.txt")
    text = path.read_text(encoding="utf-8")
    wrong = "raise SystemExit(1)\n" if name == "script" else "message(FATAL_ERROR wrong)\n"
    if name in workspace.broken:
        path.write_text(text.replace(wrong, ""), encoding="utf-8")
        workspace.broken.discard(name)
    else:
        path.write_text(text + wrong, encoding="utf-8")
        workspace.broken.add(name)
    return workspace.above(name)


def _keep(workspace: Evolving, number: int) -> set[str]:
    """Keep the sources as a branch to come back to."""
    del number
    branch = workspace.root / "branch"
    shutil.rmtree(branch, ignore_errors=True)
    shutil.copytree(workspace.home / "src", branch, symlinks=True)
    (workspace.root / "broken").write_text(" ".join(sorted(workspace.broken)), encoding="utf-8")
    return set()


def _switch(workspace: Evolving, number: int) -> set[str]:
    """Come back to the kept branch: what differs is replaced, with the times that it had."""
    branch, source = workspace.root / "branch", workspace.home / "src"
    if not branch.is_dir():
        return set()
    now, then = look(source), look(branch)
    if any(then.get(n) != e and ("link" in (e[0], then.get(n, ("",))[0])) for n, e in now.items()):
        return set()
    changed = set()
    for name in sorted(now.keys() - then.keys(), reverse=True):
        path = source / name
        path.rmdir() if now[name] == ("folder",) else path.unlink()
        changed.add(Path(name).parts[0])
    for name, entry in sorted(then.items()):
        if now.get(name) == entry:
            continue
        changed.add(Path(name).parts[0])
        if entry == ("folder",):
            (source / name).mkdir()
        else:
            copy = shutil.copy2 if number % 2 else shutil.copy
            (source / name).unlink(missing_ok=True)
            copy(branch / name, source / name)
    workspace.broken = set((workspace.root / "broken").read_text(encoding="utf-8").split())
    return workspace.above(*changed)


EDITS = {
    edit.__name__.strip("_"): edit
    for edit in (
        _touch,
        _touch_old,
        _remark,
        _change,
        _replace_by_older,
        _change_in_place_keeping_times,
        _add,
        _remove,
        _rename,
        _link,
        _link_folder,
        _default,
        _shadow,
        _swap,
        _swap_package,
        _switch_link,
        _underlay,
        _overlay,
        _save,
        _mode,
        _manifest,
        _dependency,
        _argument,
        _variable,
        _links,
        _outer,
        _delete_installed,
        _overwrite_installed,
        _delete_built,
        _lose,
        _garble,
        _break,
        _keep,
        _switch,
    )
}


def _sources(workspace: Evolving) -> list[Path]:
    return sorted(p for p in (workspace.home / "src").rglob("*") if p.is_file() and not p.is_symlink())


def _package(workspace: Evolving, path: Path) -> str:
    return path.relative_to(workspace.home / "src").parts[0]


_CHANGEABLE = {
    "base.h": "#pragma once\n#define BASE {}\nint base(void);\n",
    "base.c": _SOURCE,
    "inner.h": "#define INNER {}\n",
    "main.c": _MAIN,
    "part.h": "#define PART {}\n",
    "table.txt": "{}\n",
    "blob.bin": "{}\n",
    "flags.dsv": "set;CFLAGS;-DHOOK={}\n",
    "version.txt": "{}\n",
    "lines.txt": "{}\n",
    "spoken.txt": "{}\n",
    "low.h": "#define LOW {}\n",
    "leaf.txt": "{}\n",
    "first.txt": "{}\n",
    "side.txt": "{}\n",
    "post.txt": "{}\n",
    "found.txt": "{}\n",
    "more.cmake": "set(MORE {})\n",
    "say": "#!/bin/sh\necho {}\n",
    "one.txt": "{}\n",
    "reader.txt.in": "${{text}} {}\n",
    "say.py": "def main():\n    print({})\n",
    "setup.py": _SETUP.replace("{", "{{").replace("}", "}}").replace("say =", "say_{} ="),
    "Below.msg": "int32 x\nint32 NUMBER={}\n",
    "Above.msg": "below_msgs/Below[3] all\nlow_msgs/Low low\nint32 NUMBER={}\n",
    "Low.msg": "int32 x\nint32 NUMBER={}\n",
}
"""What files say after a change: the number is in it. A length stays as it was where that is easy."""


def _changeable(workspace: Evolving, number: int) -> Path | None:
    paths = [
        path
        for path in _sources(workspace)
        if path.name in _CHANGEABLE and _package(workspace, path) not in workspace.broken
    ]
    return paths[number % len(paths)] if paths else None


def _rewrite(path: Path, number: int, like: Path | None = None) -> None:
    path.write_text(_said(like or path, number), encoding="utf-8")


def _said(path: Path, number: int) -> str:
    return _CHANGEABLE[path.name].format(number % 10)


def _installed(workspace: Evolving) -> list[tuple[Path, str]]:
    """Return the installed files that belong to one package for sure, with it."""
    # Without the observer, nobody knows whose file this is in a merged prefix: no manifest lists it.
    unknown = {"post.txt"} if workspace.merged and not workspace.observed else set[str]()
    found = []
    for path in sorted((workspace.home / "install").rglob("*")):
        if path.is_dir() and not path.is_symlink():
            continue
        owners = [
            n for n in workspace.packages if n in path.relative_to(workspace.home / "install").parts[:-1]
        ]
        if len(owners) == 1 and path.name not in unknown:
            found.append((path, owners[0]))
    return found
