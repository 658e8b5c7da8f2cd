"""What to do about failures that no test can bring about for real, and when to keep silent."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.hints import Scene, hint_of
from tests.packages import package

SCENE = Scene(
    package("mine", "shapes"), {name: package(name) for name in ("mine", "shapes")}, "/venv/bin/python3"
)


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("c++: fatal error: Killed signal terminated program cc1plus", "memory ran out"),
        ("ninja: error: write: No space left on device", "the disk is full"),
        (
            "AttributeError: module 'em' has no attribute 'BUFFERED_OPT'",
            "/venv/bin/python3 -m pip install 'empy<4'",
        ),
        ("ModuleNotFoundError: No module named 'yaml.x'", "/venv/bin/python3 -m pip install PyYAML"),
        (
            "  Failed to clone repository: 'https://x.org/y.git'",
            "clones https://x.org/y.git while it is built",
        ),
        ("a.cpp:1:10: fatal error: 'foo/bar.h' file not found", "apt-file search foo/bar.h"),
    ],
)
def test_known_causes_have_a_remedy(said: str, expected: str) -> None:
    hint = hint_of(said, SCENE)
    assert hint is not None
    assert expected in hint


def test_a_dependency_that_is_written_like_a_ros_package_is_not_looked_for_in_the_system() -> None:
    said = 'asked CMake to find a package configuration file provided by "{}", but'
    scene = Scene(package("mine", "odd_collector"), {"mine": package("mine")})
    assert "add its sources" in str(hint_of(said.format("odd_collector"), scene))
    # find_package's own names are spelled in every way: only the manifest tells.
    assert "apt-file search" in str(hint_of(said.format("nlohmann_json"), scene))


@pytest.mark.parametrize(
    "said",
    [
        "a.cpp:1:1: error: expected ';'",
        'asked CMake to find a package configuration file provided by "shapes", but',
        "ModuleNotFoundError: No module named 'shapes'",
        'Unknown CMake command "frobnicate".',
    ],
)
def test_no_hint_is_better_than_a_wrong_one(said: str) -> None:
    """What is declared and there, but not found, has a cause that forge does not know."""
    assert hint_of(said, SCENE) is None


@given(st.text())
def test_any_output_is_read(said: str) -> None:
    hint_of(said, SCENE)
