"""Commands run again if something changed that they were observed to read, and only then."""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja", "gcc")

HEAD = "cmake_minimum_required(VERSION 3.16)\nproject(a C)\n"
FILES = {
    "src/a/package.xml": manifest_text("a", build_type="cmake"),
    "src/a/x.c": '#include "gen.h"\nint main(void) { return X; }\n',
    "src/a/value.txt": "3\n",
    "src/a/other.txt": "x\n",
    "src/a/gen.sh": 'echo "#define X $(cat "$1/value.txt")" > gen.h\nls "$1/parts" > parts.lst\n'
    '[ ! -e "$1/more" ] || echo "// more" >> gen.h\necho run >> runs.txt\n',
    "src/a/parts/one": "",
}
GENERATES = (
    HEAD
    + "add_custom_command(OUTPUT gen.h COMMAND sh ${CMAKE_SOURCE_DIR}/gen.sh ${CMAKE_SOURCE_DIR} VERBATIM)\n"
    "add_executable(x x.c ${CMAKE_BINARY_DIR}/gen.h)\n"
    "target_include_directories(x PRIVATE ${CMAKE_BINARY_DIR})\n"
    "install(TARGETS x DESTINATION bin)\n"
    "install(FILES ${CMAKE_BINARY_DIR}/gen.h ${CMAKE_BINARY_DIR}/parts.lst ${CMAKE_BINARY_DIR}/runs.txt"
    " DESTINATION share)\n"
)


def edit(root: Path, name: str, text: str) -> None:
    (root / "src/a" / name).write_text(text)


def ran(root: Path) -> str:
    """Return what CMake and ninja said of the last build."""
    return (root / "log/latest_build/a/stdout.log").read_text()


def built(forge: Forge, root: Path) -> object:
    assert forge("build", cwd=root).code == 0
    return look(root / "install")


def is_as_clean(forge: Forge, root: Path) -> bool:
    found = look(root / "install")
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    return found == built(forge, root)


EDITS = (
    ("value.txt", "4\n", "runs"),
    ("gen.sh", FILES["src/a/gen.sh"].replace("#define X", "#define X 1+"), "runs"),
    ("parts/two", "", "runs"),  # it lists the folder
    ("more", "", "runs"),  # it looked for this file
    ("other.txt", "y\n", "fresh"),
    ("new.txt", "y\n", "fresh"),
    ("CMakeLists.txt", GENERATES + "# a comment\n", "configured"),
)
"""Changed files, and what is done because of each."""


def test_a_command_reruns_only_if_its_inputs_change(forge: Forge, tree: Tree) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    for name, text, expected in EDITS:
        edit(root, name, text)
        built(forge, root)
        assert ("Generating gen.h" in ran(root)) == (expected == "runs"), name
        assert ("Configuring done" in ran(root)) == (expected == "configured"), name
        assert "Building C object" not in ran(root) or expected == "runs", name
    assert is_as_clean(forge, root)


OPTIONAL = "install(TARGETS x DESTINATION bin OPTIONAL)\n"
CODE = {
    "a command after linking appends": (
        "add_executable(x y.c)\nadd_custom_command(TARGET x POST_BUILD COMMAND echo built >> log.txt)\n"
        "install(FILES ${CMAKE_BINARY_DIR}/log.txt DESTINATION share)\n",
        ("y.c", "int main(void) { return 3; }\n"),
    ),
    "a linker script that CMake writes": (
        "file(READ value.txt value)\nfile(WRITE ${CMAKE_BINARY_DIR}/CMakeFiles/x.map"
        ' "VERSION_${value} { global: f; local: *; };")\nadd_library(x SHARED f.c)\n'
        "target_link_options(x PRIVATE -Wl,--version-script=${CMAKE_BINARY_DIR}/CMakeFiles/x.map)\n"
        "install(TARGETS x DESTINATION lib)\n",
        ("value.txt", "5"),
    ),
    "a generator that writes a folder": (
        "add_custom_command(OUTPUT stamp COMMAND sh ${CMAKE_SOURCE_DIR}/split.sh ${CMAKE_SOURCE_DIR}/parts"
        " DEPENDS ${CMAKE_SOURCE_DIR}/value.txt VERBATIM)\nadd_custom_target(all_parts ALL DEPENDS stamp)\n"
        "install(DIRECTORY ${CMAKE_BINARY_DIR}/out DESTINATION share)\n",
        ("parts/one", None),
    ),
    "a program of the package generates": (
        "add_executable(tool y.c)\nadd_custom_command(OUTPUT o.txt COMMAND sh -c"
        ' "./tool; echo $? > o.txt" VERBATIM)\nadd_custom_target(o ALL DEPENDS o.txt)\n'
        "add_dependencies(o tool)\ninstall(FILES ${CMAKE_BINARY_DIR}/o.txt DESTINATION share)\n",
        ("y.c", "int main(void) { return 7; }\n"),
    ),
    "a program that is no longer built": (
        f"add_executable(x y.c)\n{OPTIONAL}",
        ("CMakeLists.txt", f"{HEAD}add_executable(x EXCLUDE_FROM_ALL y.c)\n{OPTIONAL}"),
    ),
}


@pytest.mark.parametrize("name", CODE)
def test_builds_after_a_change_match_clean_ones(forge: Forge, tree: Tree, name: str) -> None:
    code, (file, text) = CODE[name]
    files = {
        **FILES,
        "src/a/y.c": "int main(void) { return 0; }\n",
        "src/a/f.c": "int f(void) { return 0; }\n",
        "src/a/split.sh": 'mkdir -p out; for f in "$1"/*; do cp "$f" out/; done; touch stamp\n',
        "src/a/parts/two": "",
    }
    root = tree({**files, "src/a/CMakeLists.txt": HEAD + code})
    built(forge, root)
    if text is None:
        (root / "src/a" / file).unlink()
    else:
        edit(root, file, text)
    built(forge, root)
    assert is_as_clean(forge, root)


SHARED = HEAD + (
    "add_custom_command(OUTPUT a.stamp COMMAND sh ${CMAKE_SOURCE_DIR}/a.sh ${CMAKE_SOURCE_DIR} VERBATIM)\n"
    "add_custom_command(OUTPUT b.stamp COMMAND sh ${CMAKE_SOURCE_DIR}/b.sh ${CMAKE_SOURCE_DIR}"
    " DEPENDS a.stamp VERBATIM)\nadd_custom_target(all_of_it ALL DEPENDS b.stamp)\n"
    "install(DIRECTORY ${CMAKE_BINARY_DIR}/gen DESTINATION share)\n"
)


@pytest.mark.parametrize("edits", [("value.txt", "CMakeLists.txt"), ("value.txt",), ("other.txt",)])
def test_commands_may_share_an_output_folder(forge: Forge, tree: Tree, edits: tuple[str, ...]) -> None:
    """The first one creates it; what the other writes in it stays or goes with the other."""
    files = {
        **FILES,
        "src/a/CMakeLists.txt": SHARED,
        "src/a/a.sh": 'mkdir -p gen\ncat "$1/other.txt" > gen/a.txt\ntouch a.stamp\n',
        "src/a/b.sh": 'read v < "$1/value.txt"\necho "$v" > gen/b.txt\n'
        'ln -s b.txt "gen/link $v"\ntouch b.stamp\n',
    }
    root = tree(files)
    built(forge, root)
    for name in edits:
        edit(root, name, "# 4\n" + files[f"src/a/{name}"])
    built(forge, root)
    assert is_as_clean(forge, root)


def test_a_build_folder_with_a_damaged_cache_starts_empty(forge: Forge, tree: Tree) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    for number, text in enumerate(("", "[]", "CMAKE_GENERATOR<")):
        (root / "build/a/CMakeCache.txt").write_text(text)
        edit(root, "value.txt", f"{number}\n")
        built(forge, root)
        assert "Building C object" in ran(root)
    assert is_as_clean(forge, root)


def test_a_file_outside_the_workspace_is_an_input(forge: Forge, tree: Tree) -> None:
    files = {
        **FILES,
        "src/a/gen.sh": 'echo "#define X $(cat ../../../value)" > gen.h; touch parts.lst runs.txt\n',
    }
    root = tree(
        {**{f"ws/{name}": text for name, text in files.items()}, "ws/src/a/CMakeLists.txt": GENERATES}
    )
    (root / "value").write_text("1\n")
    built(forge, root / "ws")
    (root / "value").write_text("2\n")
    built(forge, root / "ws")
    assert (root / "ws/install/a/share/gen.h").read_text() == "#define X 2\n"


SEEN: dict[str, tuple[str, Callable[[Path], object]]] = {
    "the mode of a folder": ("stat -c %a ../../../out", lambda out: out.chmod(0o700)),
    "the mode of a folder that is listed": (
        "tar -C ../../.. --mtime=@0 -c out | cksum",
        lambda out: (out / "inner").chmod(0o700),
    ),
    "the target of a link": ("cat ../../../out/link || true", lambda out: (out / "target").write_text("it")),
}


@pytest.mark.parametrize("what", SEEN)
def test_what_a_command_sees_outside_the_workspace_is_an_input(forge: Forge, tree: Tree, what: str) -> None:
    command, change = SEEN[what]
    files = {
        **FILES,
        "src/a/gen.sh": f'echo "#define X 1" > gen.h; touch parts.lst; ({command}) > runs.txt\n',
    }
    root = tree(
        {**{f"ws/{name}": text for name, text in files.items()}, "ws/src/a/CMakeLists.txt": GENERATES}
    )
    (root / "out/inner").mkdir(parents=True)
    (root / "out/link").symlink_to("target")
    built(forge, root / "ws")
    change(root / "out")
    built(forge, root / "ws")
    assert is_as_clean(forge, root / "ws")


@pytest.mark.parametrize(
    ("cmake", "expected"),
    [
        ("find_library(LIBRARY nowhere)", "unchanged"),
        ("file(GLOB FILES ${CMAKE_SOURCE_DIR}/../../../bin/*)", "finished"),
    ],
)
def test_a_new_program_on_path_is_an_input_only_of_commands_that_list_its_folder(
    forge: Forge, tree: Tree, cmake: str, expected: str
) -> None:
    files = {"src/a/package.xml": FILES["src/a/package.xml"], "src/a/CMakeLists.txt": f"{HEAD}{cmake}\n"}
    root = tree({**{f"ws/{name}": text for name, text in files.items()}, "bin/one": "#!/bin/sh\n"})
    env = {"PATH": f"{root}/bin{os.pathsep}{os.environ['PATH']}"}
    assert forge("build", cwd=root / "ws", env=env).code == 0
    (root / "bin/two").write_text("#!/bin/sh\n")
    assert f"1 package {expected}" in forge("build", cwd=root / "ws", env=env).out


GENERATOR = """missed=../../src/a/late
test -r $missed && value=$missed || value=../../../value
echo "#define X $(cat $value)" > gen.h; touch parts.lst runs.txt
cat < /dev/null >> /dev/fd/1
"""


def test_a_workspace_below_dev_is_observed(forge: Forge, tree: Tree) -> None:
    files = tree({**FILES, "src/a/CMakeLists.txt": GENERATES, "src/a/gen.sh": GENERATOR})
    with TemporaryDirectory(dir="/dev/shm") as folder:
        root = shutil.copytree(files, Path(folder) / "ws")
        for value in ("1", "2"):
            (root.parent / "value").write_text(value)
            built(forge, root)
            assert (root / "install/a/share/gen.h").read_text() == f"#define X {value}\n"
        (root / "src/a/late").write_text("3")
        built(forge, root)
        assert (root / "install/a/share/gen.h").read_text() == "#define X 3\n"
        assert "0 packages finished" in forge("build", cwd=root).out


ASKS = """import ctypes, importlib.metadata, os, sys
from importlib.metadata import entry_points, version
home = os.path.dirname(__file__)
entry_points()
with open("gen.h", "w") as file:
    print("// helper", version("helper"), "value", ctypes.CDLL(home + "/libv.so").v(), file=file)
"""


def distribution(name: str, version: str, entry: str = "") -> dict[str, str]:
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    info = f"lib/{name}-1.dist-info"
    return {f"{info}/METADATA": metadata, f"{info}/entry_points.txt": f"[x]\n{entry or name} = {name}\n"}


def test_python_builds_depend_on_requested_metadata_and_libraries(forge: Forge, tree: Tree) -> None:
    cmake = (
        f"{HEAD}add_custom_command(OUTPUT gen.h COMMAND python3 ${{CMAKE_SOURCE_DIR}}/../../tools/gen.py)\n"
    )
    cmake += "add_custom_target(g ALL DEPENDS gen.h)\n"
    cmake += "install(FILES ${CMAKE_BINARY_DIR}/gen.h DESTINATION share)\n"
    files = {**FILES, "src/a/CMakeLists.txt": cmake, "tools/gen.py": ASKS}
    root = tree({**files, **distribution("helper", "1"), **distribution("other", "1")})
    env = {"PYTHONPATH": f"{root}/lib"}

    def library(value: int) -> None:
        (root / "v.c").write_text(f"int v(void) {{ return {value}; }}\n")
        draft = root / "tools/draft.so"
        subprocess.run(("gcc", "-shared", "-o", draft, root / "v.c"), check=True)
        draft.rename(root / "tools/libv.so")

    def said() -> str:
        assert forge("build", "--base-paths", "src", cwd=root, env=env).code == 0
        return (root / "install/a/share/gen.h").read_text()

    library(1)
    assert said() == "// helper 1 value 1\n"
    tree(distribution("helper", "2"))
    assert said() == "// helper 2 value 1\n"
    library(2)
    assert said() == "// helper 2 value 2\n"
    for scanned in (distribution("other", "2", "y"), distribution("third", "1")):
        tree(scanned)
        assert "0 packages finished" in forge("build", "--base-paths", "src", cwd=root, env=env).out


PYTHON = """import importlib, os, sys
found = sorted(os.listdir(os.path.join(os.path.dirname(__file__), "data")))
found += [open(os.path.join(os.path.dirname(__file__), "code.pyc")).read()]
found += [importlib.import_module("by_" + "name").__file__]
for name in ("extra", "helper.late", "shadowed", "json"):
    try:
        found.append(__import__(name, fromlist=["VALUE"]).__file__)
    except ImportError:
        found.append("no " + name)
with open("gen.h", "w") as file:
    file.write("#define X 1\\n// " + " ".join(found))
"""
BY_PYTHON = {
    "CMake": "execute_process(COMMAND python3 ${S}/../../tools/gen.py)\n",
    "a command": "add_custom_command(OUTPUT gen.h COMMAND python3 ${S}/../../tools/gen.py VERBATIM)\n",
}
LOOKED_FOR = {
    "lib/extra.py": True,
    "lib/helper/late/__init__.py": True,
    "lib/shadowed.py": True,
    "lib/shadowed/__init__.py": True,
    "lib/by_name.py": True,
    "tools/code.pyc": True,
    "lib/other/__init__.py": False,
    "lib/extra.txt": False,
    "tools/data/new": True,
    "tools/json.py": True,
    "tools/new": False,
}
"""Names that appear in folders of Python, and whether the script would see them."""


@pytest.mark.parametrize("who", BY_PYTHON)
def test_modules_that_python_searches_for_are_inputs(forge: Forge, tree: Tree, who: str) -> None:
    cmake = f"{HEAD}set(S ${{CMAKE_SOURCE_DIR}})\n{BY_PYTHON[who]}add_custom_target(g ALL DEPENDS gen.h)\n"
    cmake += "install(FILES ${CMAKE_BINARY_DIR}/gen.h DESTINATION share)\n"
    files = {**FILES, "src/a/CMakeLists.txt": cmake, "tools/gen.py": PYTHON, "tools/data/one": ""}
    files |= {"lib/helper/__init__.py": "", "later/shadowed.py": "", "later/by_name.py": ""}
    files |= {"tools/code.pyc": "0"}
    root = tree(files)
    env = {"PYTHONPATH": f"{root}/lib:{root}/later", "PYTHONDONTWRITEBYTECODE": "1"}
    options = ("build", "--base-paths", "src")
    assert forge(*options, cwd=root, env=env).code == 0
    for name, is_seen in LOOKED_FOR.items():
        before = (root / "install/a/share/gen.h").read_text()
        tree({name: ""})
        ran = forge(*options, cwd=root, env=env)
        assert (name, "1 package finished" in ran.out) == (name, is_seen), ran.out
        assert (name, (root / "install/a/share/gen.h").read_text() != before) == (name, is_seen)
        assert "0 packages finished" in forge(*options, cwd=root, env=env).out, name


WAYS = """#define _GNU_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <fts.h>
#include <ftw.h>
#include <glob.h>
#include <mntent.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
extern char **environ;
static int count;
static char path[4096], buffer[4096];
static int copy(void *argument)
{
    int descriptor = open(path, O_RDONLY);
    return write(1, buffer, read(descriptor, buffer, sizeof buffer)) < 0;
}
static int visit(const char *path, const struct stat *status, int kind, struct FTW *place)
{
    return count++ < 0;
}
int main(int argc, char **argv)
{
    char *way = argv[1], *folder = argv[2], *walked[] = {folder, NULL}, name[] = "/tmp/waysXXXXXX", *stack;
    char *cat[] = {"cat", path, NULL}, *none[] = {NULL};
    struct dirent *item;
    DIR *list;
    int descriptor = -1;
    glob_t found;
    pid_t child;
    struct stat status;
    posix_spawn_file_actions_t actions;
    FTS *walk;
    FTSENT *entry;
    snprintf(path, sizeof path, "%s/file", folder);
    if (!strcmp(way, "syscall"))
        descriptor = syscall(SYS_openat, AT_FDCWD, path, O_RDONLY);
    else if (!strcmp(way, "proc") && !chdir(folder))
        descriptor = open("/proc/self/cwd/file", O_RDONLY);
    else if (!strcmp(way, "update"))
        descriptor = open(path, O_RDWR);
    else if (!strcmp(way, "mounts"))
        descriptor = fileno(setmntent(path, "r"));
    else if (!strcmp(way, "own link") && (unlink("own"), !symlink(path, "own")))
        descriptor = open("own", O_RDONLY);
    else if (!strcmp(way, "temporary link") && mkdtemp(name) && !chdir(name) && !symlink(path, "link")) {
        descriptor = open("link", O_RDONLY);
        unlink("link");
        rmdir(name);
    } else if (!strcmp(way, "descriptor")) {
        snprintf(path, sizeof path, "/dev/fd/%d/file", open(folder, O_RDONLY));
        descriptor = open(path, O_RDONLY);
    } else if (!strcmp(way, "kernel"))
        return syscall(SYS_execve, "/bin/cat", cat, none);
    else if (!strcmp(way, "kernel at"))
        return execveat(AT_FDCWD, "/bin/cat", cat, none, 0);
    else if (!strcmp(way, "copy") || !strcmp(way, "thread")) {
        stack = malloc(1 << 16);
        child = clone(copy, stack + (1 << 16), SIGCHLD | (*way == 't' ? CLONE_VM : 0), NULL);
        return waitpid(child, NULL, 0) != child;
    } else if (!strcmp(way, "kinds"))
        for (list = opendir(folder); (item = readdir(list));)
            count += strcmp(item->d_name, "file") ? 0 : item->d_type;
    else if (!strcmp(way, "spawn")) {
        char *words[] = {"cat", NULL};
        posix_spawn_file_actions_init(&actions);
        posix_spawn_file_actions_addopen(&actions, 0, path, O_RDONLY, 0);
        return posix_spawn(&child, "/bin/cat", &actions, NULL, words, environ)
            || waitpid(child, NULL, 0) != child;
    } else if (!strcmp(way, "size") && !stat(path, &status))
        count = status.st_size;
    else if (!strcmp(way, "mode"))
        count = access(path, X_OK);
    else if (!strcmp(way, "gone"))
        count = access(path, F_OK);
    else if (!strcmp(way, "link") || !strcmp(way, "real")) {
        snprintf(path, sizeof path, "%s/link", folder);
        if (*way == 'l')
            count = readlink(path, buffer, sizeof buffer - 1);
        else
            strcpy(buffer, strrchr(realpath(path, NULL), '/'));
    } else if (!strcmp(way, "names")) {
        descriptor = open(folder, O_RDONLY | O_DIRECTORY);
        count = syscall(SYS_getdents64, descriptor, buffer, sizeof buffer);
        return printf("%d\\n", count) < 0;
    } else if (!strcmp(way, "fts"))
        for (walk = fts_open(walked, FTS_PHYSICAL, NULL); (entry = fts_read(walk));)
            count++;
    else if (!strcmp(way, "nftw"))
        nftw(folder, visit, 8, FTW_PHYS);
    else if (!strcmp(way, "glob")) {
        snprintf(path, sizeof path, "%s/*/*.txt", folder);
        glob(path, 0, NULL, &found);
        count = found.gl_pathc;
    }
    if (descriptor >= 0 && read(descriptor, buffer, sizeof buffer - 1) < 0)
        return 1;
    printf("%d %s\\n", count, buffer);
    return 0;
}
"""


def _turn_link(folder: Path) -> None:
    (folder / "link").unlink()
    (folder / "link").symlink_to("two")


def _turn_file(folder: Path) -> None:
    (folder / "file").unlink()
    (folder / "file").mkdir()


READING = (
    *("syscall", "proc", "spawn", "size", "update", "mounts", "own link", "temporary link", "descriptor"),
    *("kernel", "kernel at", "copy", "thread"),
)
CHANGES: dict[str, Callable[[Path], object]] = {
    **dict.fromkeys(READING, lambda folder: (folder / "file").write_text("two")),
    "kinds": _turn_file,
    "mode": lambda folder: (folder / "file").chmod(0o755),
    "gone": lambda folder: (folder / "file").unlink(),
    **dict.fromkeys(("link", "real"), _turn_link),
    "names": lambda folder: (folder / "new").touch(),
    **dict.fromkeys(("fts", "nftw", "glob"), lambda folder: (folder / "two/new.txt").touch()),
}
"""Ways of a program to learn of a folder, and how each is changed."""


def test_all_ways_of_accessing_files_are_observed(forge: Forge, tree: Tree) -> None:
    commands = "".join(
        f'add_custom_command(OUTPUT "{way}" COMMAND ${{S}}/tools/ways "{way}"'
        f' "${{S}}/elsewhere/{way}" > "{way}")\n'
        f'install(FILES "${{CMAKE_BINARY_DIR}}/{way}" DESTINATION share)\n'
        for way in CHANGES
    )
    cmake = f"{HEAD}set(S ${{CMAKE_SOURCE_DIR}}/../..)\n{commands}"
    cmake += "add_custom_target(g ALL DEPENDS {})\n".format(" ".join(f'"{way}"' for way in CHANGES))
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake, "tools/ways.c": WAYS})
    subprocess.run(("gcc", "-w", "-o", root / "tools/ways", root / "tools/ways.c"), check=True)
    for way in CHANGES:
        folder = tree({f"elsewhere/{way}/{name}": "1" for name in ("file", "one/a", "two/a")})
        (folder / "elsewhere" / way / "link").symlink_to("one")
    assert forge("build", "--base-paths", "src", cwd=root).code == 0
    for way, change in CHANGES.items():
        before = (root / "install/a/share" / way).read_text()
        change(root / "elsewhere" / way)
        assert forge("build", "--base-paths", "src", cwd=root).code == 0
        assert (root / "install/a/share" / way).read_text() != before, way
    assert "0 packages finished" in forge("build", "--base-paths", "src", cwd=root).out


def test_reads_of_forked_processes_belong_to_their_command(forge: Forge, tree: Tree) -> None:
    commands = "".join(
        f"add_custom_command(OUTPUT {way} COMMAND ${{S}}/../../ways {way} ${{S}} > {way})\n"
        for way in ("copy", "thread")
    )
    cmake = f"{HEAD}set(S ${{CMAKE_SOURCE_DIR}})\n{commands}add_custom_target(g ALL DEPENDS copy thread)\n"
    cmake += "install(FILES ${CMAKE_BINARY_DIR}/copy ${CMAKE_BINARY_DIR}/thread DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake, "src/a/file": "one", "ways.c": WAYS})
    subprocess.run(("gcc", "-w", "-o", root / "ways", root / "ways.c"), check=True)
    built(forge, root)
    edit(root, "file", "two")
    built(forge, root)
    assert (root / "install/a/share/thread").read_text() == "two"
    assert is_as_clean(forge, root)


@pytest.mark.parametrize("cache", [(), ("--cache", "../cache")])
def test_a_file_written_into_another_package_must_exist(
    forge: Forge, tree: Tree, cache: tuple[str, ...]
) -> None:
    cmake = f"{HEAD}add_custom_command(OUTPUT o COMMAND sh ${{CMAKE_SOURCE_DIR}}/../gen.sh)\n"
    files = {
        "src/a/package.xml": manifest_text("a", build_type="cmake"),
        "src/a/CMakeLists.txt": f"{cmake}add_custom_target(g ALL DEPENDS o)\n",
        "src/gen.sh": 'echo "#define X 1" > "$(dirname "$0")/b/gen.h"; touch o\n',
        "src/b/package.xml": manifest_text("b", "<depend>a</depend>", build_type="cmake"),
        "src/b/CMakeLists.txt": f"{HEAD}add_executable(x x.c)\ninstall(TARGETS x DESTINATION bin)\n",
        "src/b/x.c": FILES["src/a/x.c"],
    }
    root = tree(files)
    for _ in range(2):  # a source of b has changed during the first build
        assert forge("build", *cache, cwd=root).code == 0
    assert "0 packages finished" in forge("build", *cache, cwd=root).out
    (root / "src/b/gen.h").unlink()
    if cache:
        shutil.rmtree(root / "build")
        shutil.rmtree(root / "install")
    ran = forge("build", *cache, cwd=root)
    assert (ran.code, (root / "src/b/gen.h").exists()) == (0, True), ran.out


LOADS = """#include <dlfcn.h>
#include <stdio.h>
int linked(void);
int main(void)
{
    void *library = dlopen("libplugin.so", RTLD_NOW);
    int (*plugin)(void) = library ? (int (*)(void))dlsym(library, "plugin") : NULL;
    printf("%d %d", linked(), plugin ? plugin() : -1);
    return 0;
}
"""


def test_programs_find_libraries_by_their_run_path(forge: Forge, tree: Tree) -> None:
    """Also if another folder of it has the library later."""
    cmake = (
        f"{HEAD}set(S ${{CMAKE_SOURCE_DIR}}/../..)\nadd_custom_command(OUTPUT o COMMAND ${{S}}/tools/x > o)\n"
    )
    cmake += "add_custom_target(g ALL DEPENDS o)\ninstall(FILES ${CMAKE_BINARY_DIR}/o DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake, "tools/x.c": LOADS, "tools/late/keep": ""})

    def library(folder: str, name: str, value: int) -> None:
        file = (
            tree({f"tools/{folder}/{name}.c": f"int {name}(void) {{ return {value}; }}\n"}) / "tools" / folder
        )
        words = ("-shared", "-fPIC", "-o", f"lib{name}.so", f"{name}.c")
        subprocess.run(("gcc", *words), cwd=file, check=True)

    library("lib", "linked", 1)
    path = "-Wl,--enable-new-dtags,-rpath,$ORIGIN/late:$ORIGIN/lib"
    words = ("-o", "x", "x.c", "-Llib", "-llinked", "-ldl", path)
    subprocess.run(("gcc", *words), cwd=root / "tools", check=True)
    result = root / "install/a/share/o"
    for folder, name, value, expected in (
        ("lib", "linked", 1, "1 -1"),
        ("lib", "plugin", 2, "1 2"),
        ("late", "plugin", 3, "1 3"),
        ("late", "linked", 4, "4 3"),
        ("late", "linked", 5, "5 3"),
    ):
        library(folder, name, value)
        assert forge("build", "--base-paths", "src", cwd=root).code == 0
        assert result.read_text() == expected
    assert "0 packages finished" in forge("build", "--base-paths", "src", cwd=root).out


@pytest.mark.needs("git")
def test_git_state_is_an_input_of_commands_that_query_it(forge: Forge, tree: Tree) -> None:
    cmake = f"{HEAD}execute_process(COMMAND git describe --tags WORKING_DIRECTORY ${{CMAKE_SOURCE_DIR}}\n"
    cmake += "  OUTPUT_FILE ${CMAKE_BINARY_DIR}/version)\n"
    cmake += "install(FILES ${CMAKE_BINARY_DIR}/version DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake})
    other = {path.replace("/a/", "/b/"): text.replace("git", "echo") for path, text in FILES.items()}
    other["src/b/package.xml"] = manifest_text("b", build_type="cmake")
    tree({**other, "src/b/CMakeLists.txt": "project(b NONE)\ninstall(FILES value.txt DESTINATION share)\n"})

    def git(*words: str) -> None:
        for package in ("a", "b"):
            argv = ("git", "-c", "user.name=a", "-c", "user.email=a@b.c", *words)
            subprocess.run(argv, cwd=root / "src" / package, check=True, capture_output=True)

    git("init")
    git("commit", "--allow-empty", "-m", "1")
    git("tag", "one")
    assert forge("build", cwd=root).code == 0
    git("commit", "--allow-empty", "-m", "2")
    git("tag", "two")
    ran = forge("build", cwd=root)
    assert "1 package finished, 1 package unchanged" in ran.out
    assert (root / "install/a/share/version").read_text() == "two\n"
    git("gc")
    assert forge("build", cwd=root).code == 0
    assert "0 packages finished" in forge("build", cwd=root).out


def test_a_file_written_only_if_missing_depends_on_its_inputs(forge: Forge, tree: Tree) -> None:
    script = '[ -e made ] || cp "$1/value.txt" made\n'
    cmake = f"{HEAD}add_custom_target(t ALL COMMAND sh ${{CMAKE_SOURCE_DIR}}/gen.sh ${{CMAKE_SOURCE_DIR}})\n"
    cmake += "install(FILES ${CMAKE_BINARY_DIR}/made other.txt DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake, "src/a/gen.sh": script})
    built(forge, root)
    edit(root, "other.txt", "changed\n")
    built(forge, root)
    edit(root, "value.txt", "4\n")
    built(forge, root)
    assert is_as_clean(forge, root)


@pytest.mark.needs("git")
@pytest.mark.parametrize("step", ["configure", "build"])
def test_an_external_file_whose_time_is_compared_is_an_input(forge: Forge, tree: Tree, step: str) -> None:
    """As git does: it opens a file only if its time differs from that in the index."""
    says = "git -C ${CMAKE_SOURCE_DIR}/../.. diff-files --name-only"
    cmake = {
        "configure": f"execute_process(COMMAND {says} OUTPUT_FILE ${{CMAKE_BINARY_DIR}}/version)\n",
        "build": f"add_custom_command(OUTPUT version COMMAND {says} > ${{CMAKE_BINARY_DIR}}/version)\n"
        "add_custom_target(v ALL DEPENDS version)\n",
    }[step]
    cmake = f"{HEAD}{cmake}install(FILES ${{CMAKE_BINARY_DIR}}/version DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake, "elsewhere/x": "1"})
    old = 1_600_000_000
    os.utime(root / "elsewhere/x", (old, old))
    for words in (("init",), ("add", "elsewhere", "src")):
        subprocess.run(("git", *words), cwd=root, check=True, capture_output=True)
    assert forge("build", cwd=root).code == 0
    assert "0 packages finished" in forge("build", cwd=root).out
    tree({"elsewhere/x": "2"})
    assert forge("build", cwd=root).code == 0
    assert (root / "install/a/share/version").read_text() == "elsewhere/x\n"


def test_an_edited_source_file_generated_by_cmake_is_regenerated(forge: Forge, tree: Tree) -> None:
    cmake = f"{HEAD}file(WRITE made.txt 1)\ninstall(FILES made.txt DESTINATION share)\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": cmake})
    built(forge, root)
    built(forge, root)
    edit(root, "made.txt", "2")
    built(forge, root)
    assert (root / "install/a/share/made.txt").read_text() == "1"


LATER = {
    "looked for": '[ ! -e x ] || echo "// found x" >> gen.h\n',
    "listed": 'ls d | sed "s#^#// #" >> gen.h\n',
}


@pytest.mark.parametrize("how", LATER)
def test_a_rerun_command_does_not_see_later_outputs(forge: Forge, tree: Tree, how: str) -> None:
    folder = "." if how == "looked for" else "d"
    script = f'mkdir -p d\necho "#define X $(cat "$1/value.txt")" > gen.h\n{LATER[how]}'
    text = (
        HEAD + "set(S ${CMAKE_SOURCE_DIR})\nadd_custom_command(OUTPUT gen.h COMMAND sh ${S}/gen.sh ${S})\n"
        "add_custom_target(first ALL DEPENDS gen.h)\nadd_executable(x x.c)\nadd_dependencies(x first)\n"
        f"set_target_properties(x PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${{CMAKE_BINARY_DIR}}/{folder})\n"
        "install(FILES ${CMAKE_BINARY_DIR}/gen.h DESTINATION share)\n"
    )
    source = "int main(void) { return 0; }\n"
    root = tree({**FILES, "src/a/CMakeLists.txt": text, "src/a/gen.sh": script, "src/a/x.c": source})
    built(forge, root)
    edit(root, "value.txt", "4\n")
    built(forge, root)
    assert is_as_clean(forge, root)


def test_sources_written_by_a_command_are_compiled_in_the_same_build(forge: Forge, tree: Tree) -> None:
    text = (
        HEAD
        + "set(S ${CMAKE_SOURCE_DIR})\nadd_custom_target(g ALL COMMAND cmake -E copy ${S}/v.txt ${S}/gen.h)\n"
        "add_executable(x x.c)\nadd_dependencies(x g)\ninstall(TARGETS x DESTINATION bin)\n"
    )
    root = tree({**FILES, "src/a/CMakeLists.txt": text, "src/a/v.txt": "#define X 1\n"})
    built(forge, root)
    edit(root, "v.txt", "#define X 2\n")
    built(forge, root)
    assert is_as_clean(forge, root)


def test_the_interpreter_of_a_script_is_an_input(forge: Forge, tree: Tree) -> None:
    text = HEAD + "add_custom_command(OUTPUT gen.h COMMAND ${CMAKE_SOURCE_DIR}/gen VERBATIM)\n"
    text += (
        "add_custom_target(t ALL DEPENDS gen.h)\ninstall(FILES ${CMAKE_BINARY_DIR}/gen.h DESTINATION share)\n"
    )
    root = tree({**FILES, "src/a/CMakeLists.txt": text})
    interpreter, script = root / "tools/run", root / "src/a/gen"
    interpreter.parent.mkdir()
    for value in (1, 2):
        (root / "t.c").write_text(
            f'#include <stdio.h>\nint main(void) {{ fputs("{value}", fopen("gen.h", "w")); return 0; }}\n'
        )
        program = root / f"run{value}"
        subprocess.run(["gcc", "-o", program, root / "t.c"], check=True)
        program.replace(interpreter)
        if value == 1:
            script.write_text(f"#!{interpreter}\n")
            script.chmod(0o755)
        built(forge, root)
    assert (root / "install/a/share/gen.h").read_text() == "2"


def test_an_edited_output_is_rebuilt_with_the_next_change(forge: Forge, tree: Tree) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    (root / "build/a/gen.h").write_text("#define X 7\n")
    edit(root, "x.c", FILES["src/a/x.c"] + "\n")
    built(forge, root)
    assert is_as_clean(forge, root)


def test_commands_that_rename_each_others_outputs_rerun_together(forge: Forge, tree: Tree) -> None:
    scripts = {
        "src/a/one.sh": 'cp "$1/value.txt" t\ntouch one\n',
        "src/a/two.sh": 'mv t u\ncat "$1/other.txt" >> u\ntouch two\n',
    }
    text = (
        HEAD + "set(S ${CMAKE_SOURCE_DIR})\n"
        "add_custom_command(OUTPUT one COMMAND sh ${S}/one.sh ${S})\n"
        "add_custom_command(OUTPUT two COMMAND sh ${S}/two.sh ${S} DEPENDS one)\n"
        "add_custom_target(t ALL DEPENDS two)\ninstall(FILES ${CMAKE_BINARY_DIR}/u DESTINATION share)\n"
    )
    root = tree({**FILES, **scripts, "src/a/CMakeLists.txt": text})
    built(forge, root)
    edit(root, "other.txt", "y\n")
    built(forge, root)
    assert (root / "install/a/share/u").read_text() == "3\ny\n"


def test_an_install_step_does_not_see_files_of_the_previous_one(forge: Forge, tree: Tree) -> None:
    text = (
        HEAD + "add_custom_command(OUTPUT log.txt COMMAND cmake -E touch log.txt)\n"
        "add_custom_target(t ALL DEPENDS log.txt)\n"
        'install(CODE "file(APPEND ${CMAKE_BINARY_DIR}/log.txt installed)")\n'
        'install(DIRECTORY ${CMAKE_BINARY_DIR}/ DESTINATION share FILES_MATCHING PATTERN "*.txt"\n'
        "        PATTERN CMakeFiles EXCLUDE PATTERN CMakeCache.txt EXCLUDE PATTERN .forge EXCLUDE)\n"
        "install(FILES value.txt DESTINATION share)\n"
    )
    root = tree({**FILES, "src/a/CMakeLists.txt": text})
    built(forge, root)
    edit(root, "value.txt", "4\n")
    built(forge, root)
    assert is_as_clean(forge, root)
