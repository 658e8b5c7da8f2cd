"""Variables passed to all packages, and CMake's warnings about unused ones."""

from hypothesis import given
from hypothesis import strategies as st

from forge.toolchain.cmake_variables import (
    UnusedVariables,
    defined,
    unset_definitions,
)


def complaint(*names: str, kind: str = "") -> bytes:
    """Return CMake's warning about unused variables; CMake 4 adds the kind."""
    lines = "".join(f"    {name}\n" for name in names)
    words = "Manually-specified variables were not used by the project"
    return f"CMake Warning{kind}:\n  {words}:\n\n{lines}\n\n".encode()


def test_definitions_are_parsed_as_by_cmake() -> None:
    words = ["-DA=1", "-DB:BOOL=ON", "-D", "C=x", "-D", "D:STRING=-DE=2", "-GNinja", "-Wno-dev", "--fresh"]
    assert defined(words) == {"A", "B", "C", "D"}


def test_definitions_without_a_value_are_reported_before_cmake_rejects_them() -> None:
    good = ["-DA=", "-D", "B:BOOL=ON", "-Wno-dev", "-DC=-D", "D=1"]
    told = [(each.message, each.hint) for each in unset_definitions([*good, "-DFOO", "-D", "BAR:BOOL", "-D"])]
    assert told == [
        ("--cmake-args contains '-DFOO' without a value", "write -DFOO=ON, or another value"),
        ("--cmake-args contains '-DBAR:BOOL' without a value", "write -DBAR:BOOL=ON, or another value"),
        ("--cmake-args contains '-D' without a value", "write -DNAME=VALUE"),
    ]


def test_used_variables_are_not_reported() -> None:
    unused = UnusedVariables(frozenset({"A", "TYPO"}))
    assert not unused.names
    assert unused.take(complaint("A", "TYPO", kind=" (unused-cli)")) == b""
    assert list(unused.names) == ["A", "TYPO"]
    assert unused.take(b"before\n" + complaint("TYPO") + b"after\n") == b"before\nafter\n"
    assert list(unused.names) == ["TYPO"]


def test_unused_policy_defaults_are_not_reported() -> None:
    unused = UnusedVariables(frozenset({"A", "CMAKE_POLICY_DEFAULT_CMP0069"}))
    assert unused.take(complaint("A", "CMAKE_POLICY_DEFAULT_CMP0069")) == b""
    assert list(unused.names) == ["A"]


def test_warnings_about_variables_of_one_package_are_kept() -> None:
    unused = UnusedVariables(frozenset({"A"}))
    assert unused.take(complaint("A", "OWN")) == complaint("OWN")


@given(st.binary())
def test_other_output_is_unchanged(said: bytes) -> None:
    assert UnusedVariables(frozenset({"A"})).take(said) == said
