"""The arguments of CMake's command line."""

import pytest

from forge.base.cmake_syntax import CMakeArgument, cmake_arguments, definitions


@pytest.mark.parametrize(
    ("words", "option", "value"),
    [
        (("-DX=1",), "-D", "X=1"),
        (("-D", "X=1"), "-D", "X=1"),
        (("-D",), "-D", ""),
        (("-GNinja",), "-G", "Ninja"),
        (("-G", "Unix Makefiles"), "-G", "Unix Makefiles"),
        (("-C", "cache.cmake"), "-C", "cache.cmake"),
        (("--toolchain=a.cmake",), "--toolchain", "a.cmake"),
        (("--toolchain", "a.cmake"), "--toolchain", "a.cmake"),
        (("--toolchains",), "", ""),
        (("-Wno-dev",), "", ""),
        (("X=1",), "", ""),
        (("",), "", ""),
    ],
)
def test_an_option_and_its_value_may_be_one_or_two_words(
    words: tuple[str, ...], option: str, value: str
) -> None:
    assert list(cmake_arguments(words)) == [CMakeArgument(words, option, value)]


def test_arguments_keep_all_words_in_order() -> None:
    words = ("-G", "Ninja", "-DA=1", "-D", "-DB=2", "x", "-U", "C", "-D")
    assert tuple(word for argument in cmake_arguments(words) for word in argument.words) == words


def test_definitions_have_names_without_types_and_may_contain_equal_signs() -> None:
    words = ("-DA:BOOL=ON", "-D", "B=x=y", "-DUNSET", "-DC=", "-U", "D=1")
    assert list(definitions(words)) == [("A", "ON"), ("B", "x=y"), ("C", "")]
