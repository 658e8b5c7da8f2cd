"""Built-in mixins and how mixins combine."""

from forge.plugins.mixins.mixins import combined, read_mixins

BUILT_IN = read_mixins(())


def cmake_args(*names: str) -> list[str]:
    found: list[str] = combined(names, "build", BUILT_IN)["cmake-args"]
    return found


def test_built_in_mixins_have_the_names_of_the_colcon_repository() -> None:
    names = {name for verb, name in BUILT_IN if verb == "build"}
    assert names >= {
        "asan-gcc",
        "tsan",
        "coverage-gcc",
        "coverage-pytest",
        "ccache",
        "ninja",
        "compile-commands",
    }
    assert names >= {"debug", "release", "rel-with-deb-info", "min-size-rel"}
    assert names >= {"asan", "ubsan", "coverage", "lto"}


def test_flags_of_several_mixins_are_joined() -> None:
    assert cmake_args("asan-gcc", "coverage-gcc", "debug") == [
        "-DCMAKE_C_FLAGS=-fsanitize=address --coverage",
        "-DCMAKE_CXX_FLAGS=-fsanitize=address --coverage",
        "-DCMAKE_BUILD_TYPE=Debug",
    ]
    assert cmake_args("coverage")[-1] == "-DCMAKE_BUILD_TYPE=Debug"


def test_quotes_that_cmake_would_remove_are_not_joined() -> None:
    mixins = {
        **BUILT_IN,
        ("build", "quoted"): BUILT_IN["build", "ubsan"].__class__(
            "build", "quoted", {"cmake-args": ["-DCMAKE_CXX_FLAGS:STRING='-O2 -g'", 1, "-DX='y'"]}
        ),
    }
    found = combined(["asan-gcc", "quoted"], "build", mixins)["cmake-args"]
    assert found[1:] == ["-DCMAKE_CXX_FLAGS=-fsanitize=address -O2 -g", 1, "-DX='y'"]
