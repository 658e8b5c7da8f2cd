"""Commands that change, list and append to the files of others are rebuilt as in a clean build."""

import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja")

HEAD = "cmake_minimum_required(VERSION 3.16)\nproject({} NONE)\n"
INSTALL = """install(DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/ DESTINATION share/x USE_SOURCE_PERMISSIONS
  FILES_MATCHING PATTERN "*.out")
"""
CODE = {
    "patches": 'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/f.out "A A")\n',
    "chmods": 'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/f.out "text")\n',
    "removes": 'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/f.out "text")\n',
    "appends": 'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/f.out "text")\n',
}
"""What CMake does before a command changes it."""
SCRIPTS = {
    "patches": (("sed -i s/A/B/ f.out",), "sed -i s/A/C/ f.out"),
    "chmods": (("chmod +x f.out",), ":"),
    "removes": (("rm f.out",), ":"),
    "appends": (("echo j >> f.out",), "echo k >> f.out"),
    "lists": (("mkdir -p made; echo 1 > made/a", "ls made > list.out"), "mkdir -p made; echo 1 > made/b"),
    "lists_new": (("mkdir -p made", "ls made > list.out"), "mkdir -p made; echo 1 > made/b"),
    "looks": ((":", "cat made.txt > f.out 2> /dev/null || echo none > f.out"), "echo 1 > made.txt"),
    "links": (("echo f > a.out", "ln a.out b.out", "echo g >> b.out"), "echo h > a.out"),
}
"""Commands that run one after another, and the first of them after an edit."""


def package(name: str) -> dict[str, str]:
    """Return a package with a command for each script."""
    code, texts = HEAD.format(name) + CODE.get(name, ""), {}
    for number, script in enumerate(SCRIPTS[name][0]):
        texts[f"src/{name}/{number}.sh"] = f"{script}\ntouch {number}.stamp\n"
        code += (
            f"add_custom_command(OUTPUT {number}.stamp COMMAND sh ${{CMAKE_CURRENT_SOURCE_DIR}}/{number}.sh\n"
            f"  DEPENDS {number}.sh)\nadd_custom_target(t{number} ALL DEPENDS {number}.stamp)\n"
        )
        code += f"add_dependencies(t{number} t{number - 1})\n" if number else ""
    manifest = {f"src/{name}/package.xml": manifest_text(name, build_type="cmake")}
    return {**manifest, **texts, f"src/{name}/CMakeLists.txt": code + INSTALL}


def rebuilt_and_clean(forge: Forge, root: Path) -> tuple[object, object]:
    """Return what the next build installs, and what a build in empty folders does."""
    ran = forge("build", cwd=root)
    assert ran.code == 0, ran.out + ran.err
    found = look(root / "install")
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    assert forge("build", cwd=root).code == 0
    return found, look(root / "install")


def test_edited_commands_find_the_files_of_others_as_in_a_clean_build(forge: Forge, built: Tree) -> None:
    root = built({path: text for name in SCRIPTS for path, text in package(name).items()})
    for name, (_, edited) in SCRIPTS.items():
        (root / f"src/{name}/0.sh").write_text(f"{edited}\ntouch 0.stamp\n")
    found, clean = rebuilt_and_clean(forge, root)
    assert found == clean


def test_unrelated_edits_change_nothing_in_files_that_commands_share(forge: Forge, built: Tree) -> None:
    texts = {path: text for name in SCRIPTS for path, text in package(name).items()}
    for name in SCRIPTS:
        texts[f"src/{name}/CMakeLists.txt"] += (
            "add_custom_command(OUTPUT z.out COMMAND ${CMAKE_COMMAND} -E copy\n"
            "  ${CMAKE_CURRENT_SOURCE_DIR}/z.in z.out DEPENDS z.in)\n"
            "add_custom_target(z ALL DEPENDS z.out)\n"
            "add_custom_target(always ALL COMMAND echo x >> count.out)\n"
        )
        texts[f"src/{name}/z.in"] = "1"
    root = built(texts)
    for name in SCRIPTS:
        (root / f"src/{name}/z.in").write_text("2")
    found, clean = rebuilt_and_clean(forge, root)
    assert found == clean
