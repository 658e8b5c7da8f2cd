"""Mistakes in --cmake-args."""

from forge.plugins.advice.cmake_arguments import suspicious_arguments


def test_several_definitions_in_one_word_are_reported_with_a_remedy() -> None:
    told = [(each.message, each.hint) for each in suspicious_arguments(["-DA=1 -DB=2"])]
    message = "--cmake-args contains '-DA=1 -DB=2' as one argument, so that CMake does not see 'B'"
    assert told == [(message, "remove the quotes around it, or in a file, write a list: ['-DA=1', '-DB=2']")]
    for words in (
        ["-GNinja -DA=1"],
        ["-D", "A=1 -DB:BOOL=2"],
        ["-DCMAKE_CXX_FLAGS=-O2 -DCMAKE_BUILD_TYPE=Debug"],
    ):
        assert list(suspicious_arguments(words)), words


def test_macros_in_compiler_flags_give_no_warning() -> None:
    words = ["-DCMAKE_CXX_FLAGS=-O2 -DNDEBUG -DA=1", "-D", "MY_OPTIONS=-DA=1 -DB=2", "-DTEXT=a -D b", "-DA=1"]
    assert not list(suspicious_arguments(words))
