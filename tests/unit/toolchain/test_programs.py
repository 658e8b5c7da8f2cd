"""The programs of a build, and which compilers its packages need."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.base.own_environment import extra_command
from forge.toolchain.programs import find_tools, ninja_first
from forge.workspace.cmake_text import any_enables_cxx, enables_cxx
from forge.workspace.model import Package
from tests.conftest import Tree
from tests.packages import package

PROGRAM = "#!/bin/sh\n"


def beside_nothing(monkeypatch: pytest.MonkeyPatch, root: Path) -> None:
    """Pretend that the interpreter that runs forge has no programs and no wheels beside it."""
    monkeypatch.setattr(sys, "executable", str(root / "nowhere" / "python"))
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.delitem(sys.modules, "cmake", raising=False)


def compiled(root: Path, project: str) -> Package:
    made = replace(package("a", build_type="cmake"), path=root / "a")
    made.path.mkdir(exist_ok=True)
    (made.path / "CMakeLists.txt").write_text(project)
    return made


def test_CMAKE_COMMAND_selects_a_different_cmake(tree: Tree) -> None:
    root = tree({"bin/make": PROGRAM})
    tools = find_tools(
        [package("a")], {"PATH": str(root / "bin"), "CMAKE_COMMAND": "/opt/cmake", "CXX": "cc"}
    )
    assert tools is not None
    assert tools.cmake == Path("/opt/cmake")


def test_all_missing_programs_are_reported_together_with_hints(
    tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree({})
    beside_nothing(monkeypatch, root)
    packages = [compiled(root, "project(a)"), package("b")]
    with pytest.raises(HostError) as error:
        find_tools(packages, {"PATH": str(root)})
    assert [problem.message for problem in error.value.problems] == [
        "CMake not found; 'a' and 1 more package need it",
        "no C++ compiler found; 'a' needs one",
    ]
    assert extra_command("cmake") in (error.value.problems[0].hint or "")


def test_the_ninja_of_forge_precedes_the_system_ninja(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """A distribution's ninja rarely supports the jobserver."""
    root = tree(
        {
            "bin/cmake": PROGRAM,
            "bin/ninja": PROGRAM,
            "site/ninja/__init__.py": "",
            "venv/bin/ninja": PROGRAM,
        }
    )
    beside_nothing(monkeypatch, root)
    monkeypatch.setattr(sys, "path", [str(root / "site")])
    monkeypatch.setattr(sys, "executable", str(root / "venv/bin/python"))
    found = find_tools([package("a")], {"PATH": str(root / "bin")})
    named = find_tools([package("a")], {"PATH": str(root / "bin"), "NINJA": "/mine/ninja"})
    assert found is not None
    assert named is not None
    assert (found.ninja, named.ninja) == (root / "venv/bin/ninja", Path("/mine/ninja"))


def test_programs_started_by_a_package_find_the_same_ninja(tree: Tree) -> None:
    root = tree({"bin/ninja": PROGRAM, "venv/bin/ninja": PROGRAM})
    for name in ("bin/ninja", "venv/bin/ninja"):
        (root / name).chmod(0o755)
    variables = {"PATH": str(root / "bin")}
    assert ninja_first(root / "bin/ninja", root / "programs", variables) == {}
    found = ninja_first(root / "venv/bin/ninja", root / "programs", variables)
    first, *rest = found["PATH"].split(":")
    assert (Path(first) / "ninja").resolve() == (root / "venv/bin/ninja").resolve()
    assert [one.name for one in Path(first).iterdir()] == ["ninja"]
    assert rest == [str(root / "bin")]


def test_the_cmake_of_the_wheel_is_found(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tree(
        {"site/cmake/__init__.py": "", "site/cmake/data/bin/cmake": PROGRAM, "venv/bin/ninja": PROGRAM}
    )
    beside_nothing(monkeypatch, root)
    monkeypatch.setattr(sys, "path", [str(root / "site")])
    monkeypatch.setattr(sys, "executable", str(root / "venv/bin/python"))
    tools = find_tools([package("a")], {"PATH": ""})
    assert tools is not None
    assert tools.cmake == root / "site/cmake/data/bin/cmake"
    assert tools.ninja == root / "venv/bin/ninja"


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("project(a)", ("-DCMAKE_CXX_COMPILER=/opt/gcc/bin/g++",)),
        ("project(a)", ("-DCMAKE_TOOLCHAIN_FILE=/x.cmake",)),
        ("project(a)", ("-C", "x.cmake")),
        ("set(CMAKE_CXX_COMPILER /opt/x)\nproject(a)", ()),
        ("include(x.cmake)\nproject(a)", ()),
        ("project(a LANGUAGES CUDA)", ()),
        ("project(a Fortran)", ()),
        ("#[[\nproject(a)\n]]\nproject(a NONE)", ()),
        ("if(x)\nproject(a)\nelse()\nproject(a NONE)\nendif()", ()),
    ],
)
def test_a_compiler_set_explicitly_need_not_be_on_path(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, text: str, arguments: tuple[str, ...]
) -> None:
    root = tree({"bin/cmake": PROGRAM, "bin/make": PROGRAM})
    beside_nothing(monkeypatch, root)
    made, variables = compiled(root, text), {"PATH": str(root / "bin")}
    assert find_tools([made], variables, cmake_args=arguments) is not None
    made = replace(made, settings={"cmake-args": list(arguments)})
    assert find_tools([made], variables) is not None


def test_ninja_or_make_is_needed_unless_an_argument_names_another_program(
    tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree({"bin/cmake": PROGRAM})
    beside_nothing(monkeypatch, root)
    with pytest.raises(HostError, match="neither Ninja nor make found"):
        find_tools([package("a")], {"PATH": str(root / "bin")})
    named = ("-DCMAKE_MAKE_PROGRAM=/opt/ninja",)
    assert find_tools([package("a")], {"PATH": str(root / "bin")}, cmake_args=named) is not None


@pytest.mark.parametrize(
    "text",
    [
        "project(x)",
        "project(x VERSION 1.2)",
        'PROJECT(x VERSION 1 DESCRIPTION "A C library" HOMEPAGE_URL https://x.org)',
        "project(x C CXX)",
        "project(x LANGUAGES\n  CXX)",
        "project(x LANGUAGES C CUDA)",
        "project(x ${languages})",
        "project(x C)\nenable_language(CXX OPTIONAL)",
    ],
)
def test_projects_that_enable_cxx_are_recognized(text: str) -> None:
    assert enables_cxx(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "project(x C)",
        'project(x DESCRIPTION "of (two)" LANGUAGES C)',
        "project(x NONE)",
        "project(x C)  # project(y)",
        'project(x VERSION 1 DESCRIPTION "With CXX" LANGUAGES C ASM)\nenable_language(Fortran OPTIONAL)',
    ],
)
def test_projects_without_cxx_are_recognized(text: str) -> None:
    assert not enables_cxx(text)


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"CMakeLists.txt": "project(x C)", "sub/CMakeLists.txt": "add_library(y y.c)"}, False),
        ({"CMakeLists.txt": "project(x C)", "sub/CMakeLists.txt": "project(y CXX)"}, True),
        ({"CMakeLists.txt": "project(x C)", "cmake/more.cmake": "enable_language(CXX)"}, True),
        ({"CMakeLists.txt": "add_library(y y.c)"}, True),
        ({"CMakeLists.txt": "project(x NONE)"}, False),
        ({}, False),
    ],
)
def test_languages_are_searched_in_all_cmake_files_of_a_package(
    tree: Tree, files: dict[str, str], expected: bool
) -> None:
    found = replace(package("x", build_type="cmake"), path=tree(files))
    assert any_enables_cxx([found]) == expected
