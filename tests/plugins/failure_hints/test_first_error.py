"""The first error in the output of a failed program."""

import pytest

from forge.plugins.failure_hints.first_error import first_error


@pytest.mark.parametrize(
    ("output", "expected"),
    [
        (["all is well"], None),
        (["\x1b[1ma.cpp:1:2: \x1b[31mfatal error: x.h: No such file\x1b[0m", "    1 | #include"], 2),
        (["CMake Error at CMakeLists.txt:3 (find_package):", "  By not providing", "", "  more", "-- x"], 3),
        (["/usr/bin/ld: a.o: undefined reference to `f()'"], 1),
        (["/usr/bin/ld: /a.so: error adding symbols: file in wrong format", "collect2: error: x"], 1),
        (["ld.lld: error: a.so is incompatible with aarch64linux", "x"], 1),
        (["running", "/ws/src/a: error: there is no setup.py", "hint: make one"], 2),
        (["Traceback (most recent call last):", "  File x", "ModuleNotFoundError: No module named 'em'"], 1),
        (["a.cpp:1: error: later", "src/m/A.msg:1:1: error: sooner", "    int8", "    ^", "hint: do"], 4),
    ],
)
def test_the_first_error_prefers_specific_patterns_and_includes_its_lines(
    output: list[str], expected: int | None
) -> None:
    error = first_error(output)
    assert (len(error.lines) if error else None) == expected


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("CMake Error at CMakeLists.txt:3 (x):", "CMake Error at src/a b/CMakeLists.txt:3 (x):"),
        ("CMake Error in sub/CMakeLists.txt:", "CMake Error in src/a b/sub/CMakeLists.txt:"),
        ("CMake Error at /usr/CMakeLists.txt:3 (x):", "CMake Error at /usr/CMakeLists.txt:3 (x):"),
        ("CMake Error at cmake_install.cmake:3 (x):", "CMake Error at cmake_install.cmake:3 (x):"),
    ],
)
def test_cmakelists_paths_can_be_opened_by_editors(line: str, shown: str) -> None:
    error = first_error([line], "src/a b")
    assert error is not None
    assert error.lines == (shown,)


@pytest.mark.parametrize(
    ("printed", "shown"),
    [
        (
            ["cat: none: No such file", "", "cat: other: No such file"],
            ("cat: none: No such file", "cat: other: No such file"),
        ),
        ([], ("FAILED: [code=1] CMakeFiles/t ",)),
    ],
)
def test_output_of_a_failed_ninja_command_is_an_error(printed: list[str], shown: tuple[str, ...]) -> None:
    output = ["[1/2] made x", "FAILED: [code=1] CMakeFiles/t ", "cd build && cat none other", *printed]
    for after in ("ninja: build stopped: subcommand failed.", "[2/2] made y", "FAILED: [code=2] z"):
        error = first_error([*output, after, "more"])
        assert error is not None
        assert error.lines == shown
