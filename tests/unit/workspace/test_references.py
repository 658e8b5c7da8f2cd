"""Paths outside of the workspace in the text of a build script."""

from __future__ import annotations

import pytest

from forge.workspace.references import (
    in_find_module,
    in_lists,
    in_module,
    in_python,
    in_settings,
    in_shell,
    reader_of,
    reader_of_script,
)


@pytest.mark.parametrize(
    "text",
    [
        "add_definitions(-DV=$ENV{FOO})",
        "if(DEFINED ENV{FOO})",
        "set(x $ENV{ FOO })",
        "find_path(x y.h HINTS ENV FOO)",
        'add_custom_command(OUTPUT x COMMAND sh -c "echo $FOO" VERBATIM)',
        "add_custom_command(OUTPUT x COMMAND sh -c [[echo $${FOO}]])",
        'file(GENERATE OUTPUT x CONTENT "\\${FOO}")',
        "execute_process(COMMAND printenv FOO)",
    ],
)
def test_environment_variables_of_cmake_code_are_found(text: str) -> None:
    assert "FOO" in in_lists(text).variables


@pytest.mark.parametrize(
    "text",
    [
        'x = os.environ["FOO"]',
        "x = os.environ.get('FOO', '')",
        'x = os.getenv("FOO")',
        "x = environ.setdefault('FOO', '1')",
        "x = 'foo' if 'FOO' in os.environ else ''",
        "env = os.environ\nx = env.get('FOO')",
    ],
)
def test_environment_variables_of_python_code_are_found(text: str) -> None:
    assert in_python(text).variables == {"FOO"}


def test_environment_variables_of_settings_and_scripts_are_found() -> None:
    assert in_settings('dependencies = ["x @ {env:FOO}"]').variables == {"FOO"}
    assert in_shell("echo $A ${B} $(C)\n").variables == {"A", "B", "C"}


def test_packages_named_by_find_package_are_found() -> None:
    text = "find_package(A 1.2 REQUIRED)\nfind_dependency( B )\npkg_check_modules(C REQUIRED c)\n"
    assert in_lists(text).packages == {"A", "B", "C"}


def test_references_of_installable_cmake_files_apply_to_dependents() -> None:
    text = "set(x $ENV{FOO})\nfind_dependency(zed)"
    assert in_module(text).exported == {"FOO"}
    assert in_module(text).exported_packages == {"zed"}
    assert in_lists(text).exported == frozenset()
    written = 'file(WRITE xConfig.cmake "set(v \\$ENV{FOO})")\nament_export_dependencies(zed yam)'
    assert in_lists(written).exported == {"FOO"}
    assert in_lists(written).exported_packages == {"zed", "yam"}


@pytest.mark.parametrize(
    "text",
    [
        "find_program(T NAMES other mytool)",
        "execute_process(COMMAND mytool --flag)",
        'add_custom_command(OUTPUT v.h COMMAND sh -c "echo \\\\#define V `mytool` > v.h" VERBATIM)',
        "set(ENV{CC} mytool)",
        "add_custom_target(x COMMAND env CC=mytool ls)",
    ],
)
def test_possible_program_names_are_found(text: str) -> None:
    assert "mytool" in in_lists(text).words


def test_programs_are_searched_only_in_python_files_that_start_processes() -> None:
    assert "mytool" in in_python("import subprocess\nsubprocess.run(['mytool', 'x'])").words
    assert "mytool" in in_python("os.system('cd x && mytool')").words
    assert in_python("setup(name='mytool')").words == frozenset()


def test_programs_of_a_find_module_come_from_find_program() -> None:
    found = in_find_module("find_program(X NAMES doxygen)\nset(Y graphviz)\nset(Z $ENV{ROOT})")
    assert found.words & {"doxygen", "graphviz"} == {"doxygen"}
    assert found.variables == {"ROOT"}


def test_scripts_and_included_files() -> None:
    text = 'execute_process(COMMAND sh ${X}/gen.sh)\ninclude(../../common.cmake)\nadd_subdirectory("a b")'
    assert in_lists(text).scripts == {"gen.sh"}
    assert {"../../common.cmake", "a"} <= in_lists(text).included


def test_scripts_that_a_build_may_run_are_found() -> None:
    always = [
        "CMakeLists.txt",
        "x.cmake",
        "xConfig.cmake.in",
        "Makefile.am",
        "x.mk",
    ]
    assert all(reader_of(name, top=False) for name in always)
    assert all(
        reader_of(name, top=True) for name in ("setup.py", "conftest.py", "setup.cfg", "pyproject.toml")
    )
    assert not any(reader_of(name, top=False) for name in ("setup.py", "setup.cfg", "x.cpp"))
    assert reader_of("x.cpp", top=True) is None
    assert (reader_of_script("gen.py"), reader_of_script("gen.sh")) == (in_python, in_shell)
    assert reader_of_script("x.cpp") is None
