"""A small workspace that changes as people change theirs, and what each change may cost.

Every edit is a function of the workspace and a number; it returns the packages that the next build may
run because of it. What it must run nobody says: the tree of a clean build tells if it ran too little.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tests.packages import manifest_text

if TYPE_CHECKING:
    from collections.abc import Mapping

ENVIRONMENT = ("CXXFLAGS", "CMAKE_WORD")
"""Variables that edits set: one that compilers read, one that a CMakeLists.txt of ours does."""

_BASE = """cmake_minimum_required(VERSION 3.18)
project(base CXX)
option(EXTRA "Install one file more" OFF)
file(GLOB sources ${CMAKE_CURRENT_SOURCE_DIR}/src/*.cpp)
add_library(base STATIC ${sources})
target_include_directories(base PRIVATE include private @OUTSIDE@)
install(TARGETS base DESTINATION lib)
install(DIRECTORY include/ DESTINATION include)
install(FILES cmake/baseConfig.cmake DESTINATION share/base/cmake)
if(EXTRA)
  install(FILES package.xml DESTINATION share/base RENAME extra.xml)
endif()
"""
_CONFIG = """get_filename_component(base_prefix ${CMAKE_CURRENT_LIST_DIR}/../../.. ABSOLUTE)
add_library(base::base STATIC IMPORTED)
set_target_properties(base::base PROPERTIES IMPORTED_LOCATION ${base_prefix}/lib/libbase.a
  INTERFACE_INCLUDE_DIRECTORIES ${base_prefix}/include)
"""
_SOURCE = """#include "base/base.hpp"
#include "inner.hpp"
#include <outer.h>
int base() {{ return BASE + INNER + OUTER + {}; }}
"""
_USER = """cmake_minimum_required(VERSION 3.18)
project(user CXX)
find_package(base REQUIRED)
add_executable(main src/main.cpp)
target_link_libraries(main base::base)
install(TARGETS main DESTINATION lib/user)
install(PROGRAMS scripts/run.sh DESTINATION lib/user)
"""
_DATA = """cmake_minimum_required(VERSION 3.18)
project(data NONE)
file(GLOB found ${CMAKE_CURRENT_SOURCE_DIR}/files/*.txt)
install(FILES ${found} DESTINATION share/data/files)
install(DIRECTORY tree DESTINATION share/data USE_SOURCE_PERMISSIONS)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/words.txt "${EXTRA} ${CMAKE_BUILD_TYPE} $ENV{CMAKE_WORD}")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/words.txt DESTINATION share/data)
install(FILES dataConfig.cmake DESTINATION share/data/cmake)
"""
_READER = """cmake_minimum_required(VERSION 3.18)
project(reader NONE)
find_package(data REQUIRED)
file(READ ${data_words} text)
configure_file(reader.txt.in reader.txt)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/reader.txt DESTINATION share/reader)
"""
_SETUP = """from glob import glob
from setuptools import find_packages, setup

setup(
    name="script",
    version="0.1.0",
    packages=find_packages(),
    data_files=[("share/script/data", sorted(glob("data/*"))), ("share/script", ["package.xml"])],
    entry_points={"console_scripts": ["say = script.say:main"]},
)
"""

PLAIN: Mapping[str, str] = {
    "src/base/package.xml": manifest_text("base", build_type="cmake"),
    "src/base/CMakeLists.txt": _BASE,
    "src/base/cmake/baseConfig.cmake": _CONFIG,
    "src/base/include/base/base.hpp": "#pragma once\n#define BASE 1\nint base();\n",
    "src/base/private/inner.hpp": "#define INNER 1\n",
    "src/base/src/base.cpp": _SOURCE.format(1),
    "src/user/package.xml": manifest_text("user", "<depend>base</depend>", build_type="cmake"),
    "src/user/CMakeLists.txt": _USER,
    "src/user/scripts/run.sh": "#!/bin/sh\necho run\n",
    "src/user/src/main.cpp": '#include "base/base.hpp"\nint main() { return base() + BASE; }\n',
    "src/data/package.xml": manifest_text("data", build_type="cmake"),
    "src/data/CMakeLists.txt": _DATA,
    "src/data/dataConfig.cmake": "set(data_words ${CMAKE_CURRENT_LIST_DIR}/../words.txt)\n",
    "src/data/files/one.txt": "1\n",
    "src/data/tree/deep/leaf.txt": "1\n",
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
ament_package()
"""
_INTERFACE_LINES = (
    "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
    "<exec_depend>rosidl_default_runtime</exec_depend>",
    "<member_of_group>rosidl_interface_packages</member_of_group>",
)
MESSAGES: Mapping[str, str] = {
    "src/below_msgs/package.xml": manifest_text("below_msgs", *_INTERFACE_LINES),
    "src/below_msgs/CMakeLists.txt": _INTERFACES.format(name="below_msgs", more="", depends=""),
    "src/below_msgs/msg/Below.msg": "int32 x\n",
    "src/above_msgs/package.xml": manifest_text(
        "above_msgs", *_INTERFACE_LINES, "<depend>below_msgs</depend>"
    ),
    "src/above_msgs/CMakeLists.txt": _INTERFACES.format(
        name="above_msgs", more="find_package(below_msgs REQUIRED)", depends="DEPENDENCIES below_msgs"
    ),
    "src/above_msgs/msg/Above.msg": "below_msgs/Below[3] all\n",
    "src/listener/package.xml": manifest_text(
        "listener", "<buildtool_depend>ament_cmake</buildtool_depend>", "<depend>above_msgs</depend>"
    ),
    "src/listener/CMakeLists.txt": _LISTENER,
    "src/listener/src/main.cpp": "#include <above_msgs/msg/above.hpp>\n"
    "int main() { return sizeof(above_msgs::msg::Above); }\n",
}

NEEDS = {
    "base": (),
    "user": ("base",),
    "data": (),
    "reader": ("data",),
    "script": ("data",),
    "below_msgs": (),
    "above_msgs": ("below_msgs",),
    "listener": ("above_msgs", "below_msgs"),
}


@dataclass(slots=True)
class Evolving:
    """A workspace below `root`/ws, with what the next build is told and what it may run."""

    root: Path
    merged: bool = False
    symlink: bool = False
    arguments: set[str] = field(default_factory=set)
    variables: dict[str, str] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    needs: dict[str, tuple[str, ...]] = field(default_factory=lambda: dict(NEEDS))
    """What may change a package; a need that was there once stays, which allows too much at worst."""

    @property
    def home(self) -> Path:
        """The workspace itself."""
        return self.root / "ws"

    @property
    def outside(self) -> Path:
        """A header that is nobody's, as those of the system are."""
        return self.root / "outside" / "outer.h"

    @property
    def packages(self) -> tuple[str, ...]:
        """The packages that there are."""
        return tuple(name for name in NEEDS if (self.home / "src" / name).is_dir())

    def write(self, files: Mapping[str, str]) -> None:
        """Make the workspace anew from a table of paths and texts."""
        shutil.rmtree(self.root, ignore_errors=True)
        self.outside.parent.mkdir(parents=True)
        self.outside.write_text("#define OUTER 1\n", encoding="utf-8")
        for name, text in files.items():
            path = self.home / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text.replace("@OUTSIDE@", str(self.outside.parent)), encoding="utf-8")
            if text.startswith("#!"):
                path.chmod(0o755)

    def options(self) -> tuple[str, ...]:
        """Return the words of the next build."""
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
        said = [self.options(), sorted(self.variables.items()), self.outside.read_text(encoding="utf-8")]
        linked = look(self.root / "private")
        return hashlib.sha256(repr((said, linked, look(self.home / "src"))).encode()).hexdigest()


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
    own = [path for path in _sources(workspace) if path.name in {"CMakeLists.txt", "base.cpp", "main.cpp"}]
    if not own:
        return set()
    path = own[number % len(own)]
    with path.open("a", encoding="utf-8") as stream:
        stream.write(f"{'#' if path.suffix == '.txt' else '//'} {number}\n")
    return {_package(workspace, path)}


def _change(workspace: Evolving, number: int) -> set[str]:
    """Change what a file says, in place."""
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
        ("base", f"src/added_{number % 3}.cpp", f"int added_{number % 3}() {{ return {number}; }}\n"),
        ("base", f"include/base/added_{number % 3}.hpp", f"#define ADDED {number}\n"),
        ("data", f"files/added_{number % 3}.txt", f"{number}\n"),
        ("data", f"tree/deep/{number % 3}/added.txt", f"{number}\n"),
        ("script", f"data/added_{number % 3}.txt", f"{number}\n"),
        ("script", f"script/added_{number % 3}.py", f"NUMBER = {number}\n"),
        ("below_msgs", f"msg/Added{number % 3}.msg", f"int32 NUMBER={number}\n"),
        ("above_msgs", f"msg/Added{number % 3}.msg", "below_msgs/Below one\n"),
    ]
    new = [entry for entry in new if entry[0] in workspace.packages]
    package, name, text = new[number % len(new)]
    path = workspace.home / "src" / package / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(text, encoding="utf-8")
    if number % 2:
        os.utime(path, (1_000_000_000, 1_000_000_000))
    return workspace.above(package)


def _remove(workspace: Evolving, number: int) -> set[str]:
    """Remove a file that was added."""
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
        _rewrite(folder / "inner.hpp", number)
        if number % 4 == 1:
            os.utime(folder / "inner.hpp", (1_000_000_000, 1_000_000_000))
    elif folder.is_symlink():
        folder.unlink()
        shutil.move(away, folder)
    else:
        shutil.move(folder, away)
        folder.symlink_to(away)
    return workspace.above("base")


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
    words = ("-DEXTRA=ON", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS=-DFLAG")
    workspace.arguments ^= {words[number % 3]}
    return set(workspace.packages)


def _variable(workspace: Evolving, number: int) -> set[str]:
    name, value = (("CXXFLAGS", "-O1"), ("CMAKE_WORD", str(number % 4)))[number % 2]
    if workspace.variables.get(name) == value:
        del workspace.variables[name]
    else:
        workspace.variables[name] = value
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
    """Remove an installed file; its package puts it back, and nobody else is concerned."""
    owned = _installed(workspace)
    if not owned:
        return set()
    path, package = owned[number % len(owned)]
    path.unlink()
    return {package}


def _overwrite_installed(workspace: Evolving, number: int) -> set[str]:
    """Write something else into an installed file."""
    owned = [(path, package) for path, package in _installed(workspace) if not path.is_symlink()]
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
    """Break a package, or mend it; from one good build to the next nobody knows what runs."""
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
    """Return the files of all packages, sorted."""
    return sorted(p for p in (workspace.home / "src").rglob("*") if p.is_file() and not p.is_symlink())


def _package(workspace: Evolving, path: Path) -> str:
    return path.relative_to(workspace.home / "src").parts[0]


_CHANGEABLE = {
    "base.hpp": "#pragma once\n#define BASE {}\nint base();\n",
    "base.cpp": _SOURCE,
    "inner.hpp": "#define INNER {}\n",
    "main.cpp": '#include "base/base.hpp"\nint main() {{ return base() + BASE + {}; }}\n',
    "leaf.txt": "{}\n",
    "one.txt": "{}\n",
    "reader.txt.in": "${{text}} {}\n",
    "say.py": "def main():\n    print({})\n",
    "setup.py": _SETUP.replace("{", "{{").replace("}", "}}").replace("say =", "say_{} ="),
    "Below.msg": "int32 x\nint32 NUMBER={}\n",
    "Above.msg": "below_msgs/Below[3] all\nint32 NUMBER={}\n",
}
"""What files say after a change: the number is in it. A length stays as it was where that is easy."""


def _changeable(workspace: Evolving, number: int) -> Path | None:
    def can(path: Path) -> bool:
        own = path.name in _CHANGEABLE and _package(workspace, path) not in workspace.broken
        return own and not (path.name == "main.cpp" and _package(workspace, path) == "listener")

    paths = [path for path in _sources(workspace) if can(path)]
    return paths[number % len(paths)] if paths else None


def _rewrite(path: Path, number: int, like: Path | None = None) -> None:
    path.write_text(_CHANGEABLE[(like or path).name].format(number % 10), encoding="utf-8")


def _installed(workspace: Evolving) -> list[tuple[Path, str]]:
    """Return the installed files that belong to one package for sure, with it."""
    found = []
    for path in sorted((workspace.home / "install").rglob("*")):
        if path.is_dir() and not path.is_symlink():
            continue
        owners = [
            n for n in workspace.packages if n in path.relative_to(workspace.home / "install").parts[:-1]
        ]
        if len(owners) == 1:
            found.append((path, owners[0]))
    return found
