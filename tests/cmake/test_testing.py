"""Tests and linters: a missing tool never stops CMake, and every test leaves a result."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from .conftest import EMBEDDED, Ament, Project

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

RUNNER = EMBEDDED / "ament_cmake/cmake/ament/run_test.py"
LINT_DEPENDS = "<test_depend>ament_lint_auto</test_depend><test_depend>ament_lint_common</test_depend>"
LINT_AUTO = "find_package(ament_lint_auto REQUIRED)\nament_lint_auto_find_test_dependencies()\n"


def registered(project: Project) -> dict[str, dict[str, object]]:
    """Return the registered tests with their properties."""
    argv = ["ctest", "--show-only=json-v1"]
    ran = subprocess.run(argv, cwd=project.build, capture_output=True, text=True, check=True)
    listed = json.loads(ran.stdout)
    return {
        test["name"]: {entry["name"]: entry["value"] for entry in test.get("properties", [])}
        for test in listed["tests"]
    }


def results_of(project: Project) -> str:
    """Return the output of `forge test-result --verbose`."""
    argv = [sys.executable, "-m", "forge", "test-result", "--verbose"]
    workspace = project.build.parents[1]
    return subprocess.run(argv, cwd=workspace, capture_output=True, text=True, check=False).stdout


def skipped(project: Project) -> list[str]:
    """Return its sorted lines about skipped tests."""
    listed = results_of(project).partition("Skipped:\n")[2].splitlines()
    return sorted(line.removeprefix("- ") for line in listed if line.startswith("- "))


def run(result: Path, *words: str) -> tuple[int, str]:
    """Run the wrapper; return its exit code and what the result file tells."""
    done = subprocess.run(
        [sys.executable, str(RUNNER), str(result), "--package-name", "demo", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    suite = next(ET.parse(result).iter("testsuite"))
    told = (
        "failed" if suite.get("failures") != "0" else "skipped" if suite.get("skipped") == "1" else "passed"
    )
    return done.returncode, told


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--command", "true"], 0, "failed"),
        (["--generate-result-on-success", "--command", "true"], 0, "passed"),
        (["--generate-result-on-success", "--command", "false"], 1, "failed"),
        (["--skip-return-code", "3", "--command", "sh", "-c", "exit 3"], 3, "skipped"),
        (["--skip-test", "--command", "false"], 0, "skipped"),
        (["--command", "no-such-program"], 1, "failed"),
    ],
)
def test_every_test_command_leaves_a_result(tmp_path: Path, words: list[str], code: int, told: str) -> None:
    result = tmp_path / "deep" / "one.xml"
    result.parent.mkdir()
    result.write_text("<testsuite tests='1' failures='0'/>", encoding="utf-8")  # of an earlier run
    if told == "failed" and code == 0:
        code = 1  # a result that tells of failures fails the test
    assert run(result, *words) == (code, told)


def test_failures_in_results_fail_the_test(tmp_path: Path) -> None:
    result = tmp_path / "one.gtest.xml"
    text = '<testsuites><testsuite failures=\\"1\\"><testcase classname=\\"A\\"/></testsuite></testsuites>'
    code, told = run(result, "--command", "sh", "-c", f'echo "{text}" > {result}')
    assert (code, told) == (1, "failed")
    assert 'classname="demo.A"' in result.read_text(encoding="utf-8")


def test_variables_are_set_and_appended(tmp_path: Path) -> None:
    script = 'test "$A" = "1;2" && test "$B" = "" && test "$C" = "x:y"'
    words = ["--env", "A=1", "2", "B=", "C=x", "--append-env", "C=y", "--generate-result-on-success"]
    assert run(tmp_path / "r.xml", *words, "--command", "sh", "-c", script) == (0, "passed")


@pytest.mark.newest_cmake
def test_ament_add_test_registers_a_test_with_its_properties(ament: Ament) -> None:
    demo = ament(
        "ament_add_test(one COMMAND true ENV A= B=$<CONFIG> TIMEOUT 5 GENERATE_RESULT_FOR_RETURN_CODE_ZERO)\n"
        "ament_add_test(two COMMAND false SKIP_TEST)\nament_add_test_label(two a b)\n"
        "ament_add_test(three COMMAND env APPEND_LIBRARY_DIRS /x OUTPUT_FILE ${CMAKE_BINARY_DIR}/out.txt"
        " GENERATE_RESULT_FOR_RETURN_CODE_ZERO)\nament_package()"
    )
    outcome = demo.configure()
    demo.make()
    tests = registered(demo)
    assert tests["one"]["TIMEOUT"] == 5.0
    assert tests["two"]["LABELS"] == ["a", "b"]
    outcome = demo.test()
    assert outcome.code == 0, outcome.text
    assert "two (Skipped)" in outcome.text
    assert (demo.build / "test_results/demo/one.xml").is_file()
    assert ":/x\n" in (demo.build / "out.txt").read_text(encoding="utf-8")


GTEST = """
find_package(ament_cmake_gtest REQUIRED)
find_package(ament_cmake_gmock REQUIRED)
find_package(ament_cmake_google_benchmark REQUIRED)
set(CMAKE_DISABLE_FIND_PACKAGE_GTest ON)
set(CMAKE_DISABLE_FIND_PACKAGE_benchmark ON)
set(gtest_SOURCES "")
ament_add_gtest(one one.cpp ENV A=1 APPEND_LIBRARY_DIRS /x)
target_link_libraries(one m)
target_include_directories(one PRIVATE include)
set_tests_properties(one PROPERTIES TIMEOUT 7)
ament_add_gtest_executable(two one.cpp)
ament_add_gtest_test(two TEST_NAME two_again)
ament_add_gtest_test(not_there)
ament_add_gmock(three one.cpp)
ament_add_google_benchmark(four one.cpp)
ament_add_google_benchmark_executable(five one.cpp)
ament_add_google_benchmark_test(five TIMEOUT 9)
ament_add_google_benchmark_test(not_there)
ament_package()
"""


@pytest.mark.needs("g++")
def test_missing_google_test_skips_tests_but_defines_targets(ament: Ament) -> None:
    demo = ament(GTEST, files={"one.cpp": "#include <gtest/gtest.h>\n"})
    outcome = demo.configure()
    assert outcome.text.count("'gtest' was not found: tests that need it are skipped") == 1
    demo.make()
    tests = registered(demo)
    assert tests["one"]["TIMEOUT"] == 7.0
    assert tests.keys() == {"one", "two_again", "three", "four", "five"}
    ran = demo.test()
    assert ran.code == 0, ran.text
    assert ran.text.count("***Skipped") == 5
    assert {"demo one: gtest was not found", "demo three: gmock was not found"} <= {*skipped(demo)}


FAKE_GTEST = """
add_library(gtest INTERFACE)
target_include_directories(gtest INTERFACE "${CMAKE_CURRENT_SOURCE_DIR}")
add_library(gtest_main STATIC gtest_main.cpp)
"""


@pytest.mark.needs("g++")
@pytest.mark.newest_cmake
def test_google_test_is_built_in_place_from_its_sources(ament: Ament) -> None:
    demo = ament(
        "find_package(ament_cmake_gtest REQUIRED)\nament_add_gtest(one one.cpp TIMEOUT 9)\n"
        "target_link_libraries(one m)\nament_find_gtest()\n"
        'message(STATUS "libraries=${GTEST_BOTH_LIBRARIES}")',
        files={
            "one.cpp": "#include <fake.h>\n",
            "fake/CMakeLists.txt": FAKE_GTEST,
            "fake/fake.h": "",
            "fake/gtest_main.cpp": "#include <cstdio>\n#include <cstring>\nint main(int, char ** argv) {\n"
            "std::FILE * f = std::fopen(std::strchr(argv[1], ':') + 1, \"w\");\n"
            'std::fputs("<testsuites><testsuite failures=\\"0\\"/></testsuites>", f); std::fclose(f); }\n',
        },
    )
    demo = replace(demo, variables={"GTEST_DIR": str(demo.source / "fake")})
    outcome = demo.configure()
    assert outcome.said("libraries") == "gtest_main;gtest"
    demo.make()
    assert demo.test().code == 0
    assert registered(demo)["one"]["LABELS"] == ["gtest"]


INSTALLED_GTEST = """
add_library(GTest::gtest INTERFACE IMPORTED)
set_property(TARGET GTest::gtest PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${CMAKE_CURRENT_LIST_DIR}")
add_library(GTest::gtest_main INTERFACE IMPORTED)
"""


@pytest.mark.needs("g++")
def test_an_installed_google_test_takes_precedence_over_system_sources(ament: Ament) -> None:
    """Also under the short names, and in folders that do not know of each other."""
    demo = ament(
        "find_package(ament_cmake_gtest REQUIRED)\nset(GTest_DIR ${CMAKE_CURRENT_SOURCE_DIR}/installed)\n"
        "add_subdirectory(a)\nadd_subdirectory(b)",
        files={
            "a/CMakeLists.txt": "ament_add_gtest(one ../one.cpp)\ntarget_link_libraries(one gtest)",
            "b/CMakeLists.txt": "ament_add_gtest(two ../one.cpp)\n"
            'message(STATUS "libraries=${GTEST_BOTH_LIBRARIES} ${GTEST_INCLUDE_DIRS}")',
            "one.cpp": "#include <fake.h>\nint main() {}\n",
            "installed/GTestConfig.cmake": INSTALLED_GTEST,
            "installed/fake.h": "",
        },
    )
    outcome = demo.configure()
    assert outcome.said("libraries") == f"gtest_main;gtest {demo.source}/installed"
    demo.make()
    assert registered(demo).keys() == {"one", "two"}


CATCH2 = "find_package(ament_cmake_catch2 REQUIRED)\n"
CASES = """
TEST_CASE("addition") { CHECK(1 + 1 == 2); }
TEST_CASE("the environment") { CHECK(std::getenv("A") == std::string("1")); }
"""
CATCH2_TEST = f"#include <catch2/catch.hpp>\n#include <cstdlib>\n#include <string>\n{CASES}"


@pytest.mark.needs("g++")
@pytest.mark.needs("/usr/include/catch2/catch.hpp")
def test_catch2_runs_and_leaves_results(ament: Ament) -> None:
    """With a main() of the package or without; targets are linked further in either way.

    Compiling a main() of Catch2 takes many seconds: two and three share one, and main.cpp only names it.
    """
    demo = ament(
        f"{CATCH2}ament_add_catch2(one one.cpp ENV A=1 TIMEOUT 9)\ntarget_link_libraries(one PRIVATE m)\n"
        "ament_add_catch2(two one.cpp main.cpp ENV A=2 WORKING_DIRECTORY ${CMAKE_SOURCE_DIR})\n"
        "target_link_libraries(two run)\n"
        "add_subdirectory(deeper)\nament_add_catch2(four four.cpp SKIP_TEST)\nament_package()",
        files={
            "one.cpp": CATCH2_TEST,
            "four.cpp": "",
            "main.cpp": "#define CATCH_CONFIG_MAIN\n",
            "run.cpp": "#define CATCH_CONFIG_RUNNER\n#include <catch2/catch.hpp>\n"
            "int main(int argc, char ** argv) { return Catch::Session().run(argc, argv); }\n",
            "deeper/CMakeLists.txt": "add_library(run STATIC ../run.cpp)\n"
            "ament_add_catch2(three ../one.cpp SKIP_LINKING_MAIN_LIBRARIES APPEND_ENV A=1)\n"
            "target_link_libraries(three run)\n",
        },
    )
    demo.configure("-DCMAKE_BUILD_TYPE=None")
    demo.make()
    tests = registered(demo)
    assert tests.keys() == {"one", "two", "three", "four"}
    assert tests["one"]["TIMEOUT"] == 9.0
    assert tests["one"]["LABELS"] == ["catch2"]
    assert tests["two"]["WORKING_DIRECTORY"] == str(demo.source)
    ran = demo.test()
    assert "The following tests FAILED:\n\t  2 - two" in ran.text
    assert "four (Skipped)" in ran.text
    result = ET.fromstring((demo.build / "test_results/demo/two.catch2.xml").read_text("utf-8"))
    assert [(case.get("name"), len(case.findall("failure"))) for case in result.iter("testcase")] == [
        ("addition", 0),
        ("the environment", 1),
    ]
    told = results_of(demo)
    assert "two.catch2.xml: 2 tests, 0 errors, 1 failure, 0 skipped" in told
    assert "the environment" in told
    assert "Summary: 7 tests, 0 errors, 1 failure, 1 skipped" in told, "each test once"


@pytest.mark.needs("g++")
def test_missing_catch2_skips_tests_but_defines_targets(ament: Ament) -> None:
    """But not those of a package with its own copy."""
    demo = ament(
        f"{CATCH2}set(CMAKE_DISABLE_FIND_PACKAGE_Catch2 ON)\n"
        "ament_add_catch2(one one.cpp ENV A=1)\ntarget_link_libraries(one m)\n"
        "ament_add_catch2_executable(two one.cpp main.cpp)\nament_add_catch2_test(two TEST_NAME two_again)\n"
        "ament_add_catch2_test(not_there)\nament_add_catch2(own own.cpp)\n",
        files={
            "one.cpp": "#include <catch2/missing.hpp>\n",
            "main.cpp": "#define CATCH_CONFIG_MAIN\n#include <catch2/missing.hpp>\n",
            "own.cpp": '#define CATCH_CONFIG_MAIN\n#include "own/catch.hpp"\n',
            "own/catch.hpp": FAKE_CATCH2_MAIN,
        },
    )
    outcome = demo.configure()
    assert outcome.text.count("'Catch2' was not found: tests that need it are skipped") == 1
    demo.make()
    assert registered(demo).keys() == {"one", "two_again", "own"}
    ran = demo.test()
    assert ran.code == 0, ran.text
    assert skipped(demo) == ["demo one: Catch2 was not found", "demo two_again: Catch2 was not found"]


FAKE_CATCH2_MAIN = """
#include <cstdio>
int main(int, char ** argv) {
std::FILE * f = std::fopen(argv[4], "w");
std::fputs("<testsuites><testsuite failures=\\"0\\" tests=\\"0\\"/></testsuites>", f); std::fclose(f); }
"""
CATCH2_3 = """
add_library(Catch2::Catch2 INTERFACE IMPORTED)
set_property(TARGET Catch2::Catch2 PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${CMAKE_CURRENT_LIST_DIR}")
add_library(catch2_main STATIC "${CMAKE_CURRENT_LIST_DIR}/main.cpp")
add_library(Catch2::Catch2WithMain ALIAS catch2_main)
"""


@pytest.mark.needs("g++")
def test_catch2_version_3_main_is_linked(ament: Ament) -> None:
    demo = ament(
        f"set(Catch2_DIR ${{CMAKE_CURRENT_SOURCE_DIR}}/installed)\n{CATCH2}ament_add_catch2(one one.cpp)\n"
        "ament_add_catch2(two two.cpp SKIP_LINKING_MAIN_LIBRARIES)",
        files={
            "one.cpp": "#include <catch2/catch_test_macros.hpp>\n",
            "two.cpp": f"#include <catch2/catch_test_macros.hpp>\n{FAKE_CATCH2_MAIN}",
            "installed/Catch2Config.cmake": CATCH2_3,
            "installed/catch2/catch_test_macros.hpp": "",
            "installed/main.cpp": FAKE_CATCH2_MAIN,
        },
    )
    demo.configure()
    demo.make()
    ran = demo.test()
    assert ran.code == 0, ran.text
    assert registered(demo).keys() == {"one", "two"}


@pytest.mark.newest_cmake
def test_pytest_runs_and_leaves_a_result(ament: Ament) -> None:
    demo = ament(
        "find_package(ament_cmake_pytest REQUIRED)\n"
        "ament_add_pytest_test(one test_one.py ENV A=1 WERROR ON)\nament_package()",
        files={"test_one.py": "import os\n\ndef test_it():\n    assert os.environ['A'] == '1'\n"},
    )
    demo.configure()
    outcome = demo.test()
    assert outcome.code == 0, outcome.text
    assert 'classname="demo.' in (demo.build / "test_results/demo/one.xunit.xml").read_text(encoding="utf-8")


def test_pytest_is_detected_without_importing_it(ament: Ament, tmp_path: Path) -> None:
    """Its import reads the metadata of all distributions, also of packages that are not declared."""
    modules = tmp_path / "modules"
    for name in ("pytest", "pytest_cov"):
        (modules / name).mkdir(parents=True)
        (modules / name / "__init__.py").write_text("raise SystemExit('imported')", encoding="utf-8")
    info = modules / "pytest_cov-7.8.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: pytest-cov\nVersion: 7.8\n", encoding="utf-8")
    demo = ament(
        "ament_has_pytest(found)\nament_get_pytest_cov_version(version)\n"
        'message(STATUS "found ${found} ${version}")'
    )
    demo = replace(demo, variables={"PYTHONPATH": str(modules)})
    assert "-- found TRUE 7.8\n" in demo.configure().text


def test_missing_pytest_gives_a_warning_and_no_test(ament: Ament) -> None:
    demo = ament(
        "ament_add_pytest_test(one test_one.py PYTHON_EXECUTABLE /bin/false)\nament_add_nose_test(two x)",
        files={"test_one.py": ""},
    )
    outcome = demo.configure()
    assert "'one' is skipped: '/bin/false' has no pytest" in outcome.flat
    assert registered(demo) == {}


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    """Return a folder with what a build takes and no linters, for PATH."""
    folder = tmp_path / "tools"
    folder.mkdir()
    for name in ("cmake", "ctest", "make", "ninja", "sh"):
        if found := shutil.which(name):
            (folder / name).symlink_to(found)
    return folder


def test_missing_linters_are_reported_in_one_line(ament: Ament, tools: Path) -> None:
    demo = ament(f"{LINT_AUTO}ament_package()", manifest=LINT_DEPENDS, files={"x.py": "", "y.hpp": ""})
    demo = replace(demo, variables={"PATH": str(tools)})
    outcome = demo.configure()
    assert outcome.text.count("Linters that are not installed") == 1
    assert registered(demo) == {}


def test_an_explicitly_requested_linter_is_a_skipped_test(ament: Ament, tools: Path) -> None:
    demo = ament(
        "find_package(ament_cmake_cppcheck REQUIRED)\nfind_package(ament_cmake_pep257 REQUIRED)\n"
        "ament_cppcheck(LANGUAGE c++ INCLUDE_DIRS a b)\n"
        "set_tests_properties(cppcheck PROPERTIES TIMEOUT 400)\n"
        "ament_pep257(TESTNAME docs EXCLUDE x)\nament_copyright(TESTNAME license)\nament_package()"
    )
    demo = replace(demo, variables={"PATH": str(tools)})
    demo.configure()
    assert registered(demo)["cppcheck"]["TIMEOUT"] == 400.0
    assert demo.test().text.count("***Skipped") == 3
    assert skipped(demo) == [
        "demo cppcheck: cppcheck is not installed",
        "demo docs: pydocstyle is not installed",
        "demo license: ament_copyright is not installed",
    ]


@pytest.fixture
def linters(tmp_path: Path) -> Path:
    """Return a folder with linters that write what they were told."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in ("copyright", "cppcheck", "flake8", "uncrustify", "lint_cmake", "xmllint"):
        program = folder / f"ament_{tool}"
        program.write_text(
            '#!/bin/sh\necho "$0 $@"\necho \'<testsuite failures="0"/>\' > "$2"\n', encoding="utf-8"
        )
        program.chmod(0o755)
    return folder


def test_linters_run_last_and_can_be_disabled(ament: Ament, linters: Path, tools: Path) -> None:
    demo = ament(
        "set(ament_cmake_copyright_FOUND TRUE)\n"
        f"{LINT_AUTO}"
        "if(TEST xmllint)\nmessage(FATAL_ERROR early)\nendif()\n"
        "list(APPEND AMENT_LINT_AUTO_EXCLUDE ament_cmake_uncrustify)\n"
        "set(ament_cmake_cppcheck_ADDITIONAL_INCLUDE_DIRS inc)\n"
        "ament_package()\n"
        'message(STATUS "found=${demo_FOUND_TEST_DEPENDS}")\n'
        "if(TEST cppcheck)\nset_tests_properties(cppcheck PROPERTIES TIMEOUT 9)\nendif()",
        manifest=LINT_DEPENDS,
        files={"src/y.hpp": ""},
    )
    demo = replace(demo, variables={"PATH": f"{linters}:{tools}"})
    outcome = demo.configure()
    assert outcome.said("found") == "ament_lint_auto;ament_lint_common"
    tests = registered(demo)
    assert tests.keys() == {"cppcheck", "lint_cmake", "xmllint"}
    assert tests["cppcheck"]["LABELS"] == ["cppcheck", "linter"]
    assert demo.test().code == 0
    assert "--include_dirs inc" in (demo.build / "ament_cppcheck/cppcheck.txt").read_text(encoding="utf-8")


COMPLAINT = '#!/bin/sh\nfor file; do :; done\necho "$file:3:1: too $1"\nexit 1\n'


def test_installed_linters_are_run(ament: Ament, tmp_path: Path, tools: Path) -> None:
    """Without ament's own programs: files are found, options translated, complaints told file by file."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, text in (("flake8", COMPLAINT), ("xmllint", "#!/bin/sh\n"), ("uncrustify", COMPLAINT)):
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod(0o755)
    demo = ament(
        f"{LINT_AUTO}find_package(ament_cmake_flake8 REQUIRED)\n"
        "ament_flake8(TESTNAME mine MAX_LINE_LENGTH 120 EXCLUDE b)\nament_package()",
        manifest=LINT_DEPENDS,
        files={"b/bad.py": "", "b/good.py": "", "x.hpp": "", "third/AMENT_IGNORE": "", "third/no.py": ""},
    )
    demo = replace(demo, variables={"PATH": f"{folder}:{tools}"})
    demo.configure()
    assert {"flake8", "mine", "xmllint", "uncrustify"} <= registered(demo).keys()
    ran = demo.test()
    results = demo.build / "test_results/demo"
    assert "The following tests FAILED" in ran.text
    flake8 = ET.fromstring((results / "flake8.xunit.xml").read_text(encoding="utf-8"))
    assert [(case.get("name"), len(case)) for case in flake8] == [("b/bad.py", 0), ("b/good.py", 1)]
    assert flake8[1][0].get("message") == "b/good.py:3:1: too --max-line-length=99"
    assert "no configuration was given" in (results / "uncrustify.xunit.xml").read_text(encoding="utf-8")
    assert "nothing to look at" in (results / "mine.xunit.xml").read_text(encoding="utf-8")


def test_disabled_testing_registers_no_tests(ament: Ament) -> None:
    demo = ament(f"if(BUILD_TESTING)\n{LINT_AUTO}endif()\nament_package()", manifest=LINT_DEPENDS)
    demo.configure("-DBUILD_TESTING=OFF")
    assert not (demo.build / "CTestTestfile.cmake").is_file()
