"""YAML and TOML that cannot be read end in one error with the name of the file."""

from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.formats import read_toml, read_yaml


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 2001-99-99", r"^a\.file: error: .*does not have the type that its syntax implies"),
        ("- a", "the file is not a mapping"),
        ("a: &a [*a]", r"^a\.file:1:4: error: not well-formed YAML: found unconstructable recursive node"),
        ("a: " + "[" * 1000, "not well-formed YAML: too deeply nested"),
    ],
)
def test_yaml_errors_are_reported_with_their_location(text: str, words: str) -> None:
    with pytest.raises(WorkspaceError, match=words):
        read_yaml(text, Path("a.file"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = ", r"^a\.file: error: not well-formed TOML: Invalid value \(at end of document\)"),
        ("a = " + "[" * 2000, "not well-formed TOML: too deeply nested"),
    ],
)
def test_toml_errors_are_reported_with_their_location(text: str, words: str) -> None:
    with pytest.raises(WorkspaceError, match=words):
        read_toml(text, Path("a.file"))


def test_yaml_anchors_are_expanded() -> None:
    assert read_yaml("a: &x {b: [1]}\nc: *x\nd: {<<: *x, e: 2}", Path("a.file")) == {
        "a": {"b": [1]},
        "c": {"b": [1]},
        "d": {"b": [1], "e": 2},
    }
