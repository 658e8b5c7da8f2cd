"""Commands run again if something changed that they were observed to read, and only then."""

import shutil
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


READ = {
    "an undeclared file": ("value.txt", "4\n"),
    "a script": ("gen.sh", FILES["src/a/gen.sh"].replace("#define X", "#define X 1+")),
    "a name in a folder": ("parts/two", ""),
    "a file that was looked for": ("more", ""),
}


@pytest.mark.parametrize("change", READ)
def test_a_command_runs_again_if_what_it_read_changed(forge: Forge, tree: Tree, change: str) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    edit(root, *READ[change])
    built(forge, root)
    assert "Generating gen.h" in ran(root)
    assert "Configuring done" not in ran(root)
    assert is_as_clean(forge, root)


NOT_READ = {
    "a file that nothing read": ("other.txt", "y\n"),
    "a new file that nothing looked for": ("new.txt", "y\n"),
    "a comment": ("CMakeLists.txt", GENERATES + "# a word\n"),
}


@pytest.mark.parametrize("change", NOT_READ)
def test_no_command_runs_again_for_other_changes(forge: Forge, tree: Tree, change: str) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    edit(root, *NOT_READ[change])
    built(forge, root)
    assert "Generating gen.h" not in ran(root)
    assert "Building C object" not in ran(root)
    assert ("Configuring done" in ran(root)) == (change == "a comment")
    assert is_as_clean(forge, root)


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
def test_commands_may_write_into_one_folder(forge: Forge, tree: Tree, edits: tuple[str, ...]) -> None:
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


@pytest.mark.parametrize("text", ["", "[]", "CMAKE_GENERATOR<"])
def test_a_build_folder_with_a_damaged_cache_starts_empty(forge: Forge, tree: Tree, text: str) -> None:
    root = tree({**FILES, "src/a/CMakeLists.txt": GENERATES})
    built(forge, root)
    (root / "build/a/CMakeCache.txt").write_text(text)
    edit(root, "value.txt", "4\n")
    built(forge, root)
    assert is_as_clean(forge, root)


def test_a_file_outside_of_the_workspace_is_an_input(forge: Forge, tree: Tree) -> None:
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
