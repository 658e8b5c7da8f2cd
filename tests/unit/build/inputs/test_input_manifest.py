"""Inputs file by file, and the differences between two states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.build.inputs.input_manifest import Changes, FileState, compare, read_manifest, write_manifest

if TYPE_CHECKING:
    from pathlib import Path

_THEN = {
    "/p/kept": FileState("1", "a"),
    "/p/touched": FileState("1", "a"),
    "/p/edited": FileState("1", "a"),
    "/p/gone": FileState("1", "a"),
}
_NOW = {
    "/p/kept": FileState("1", "a"),
    "/p/touched": FileState("2", "a"),
    "/p/edited": FileState("1", "b"),
    "/p/new": FileState("1", "a"),
}


def test_contents_tell_what_changed_and_times_do_not() -> None:
    changes = compare(_THEN, _NOW)
    assert changes == Changes(frozenset({"/p/new"}), frozenset({"/p/gone"}), frozenset({"/p/edited"}))


def test_a_rewritten_file_counts_as_changed_if_its_intermediate_contents_are_unknown() -> None:
    assert compare(_THEN, _NOW, by_stats=True).modified == {"/p/edited", "/p/touched"}


def test_equal_manifests_differ_in_nothing() -> None:
    assert not compare(_THEN, dict(_THEN))


def test_changes_of_two_places_add_up() -> None:
    both = Changes(added=frozenset({"/a"})) | Changes(removed=frozenset({"/b"}), modified=frozenset({"/c"}))
    assert both.all == {"/a", "/b", "/c"}
    assert both.names == {"/a", "/b"}


def test_a_manifest_is_read_as_it_was_written(tmp_path: Path) -> None:
    odd = {
        "/p/größe": FileState("1 2", "x"),
        "/p/bad \udcff name\n": FileState("", "missing"),
        "/p/f/": FileState("", ""),
    }
    write_manifest(tmp_path / "manifest.json", odd)
    assert read_manifest(tmp_path / "manifest.json") == odd


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", '{"/p": 1}', '{"/p": ["a"]}', '{"/p": ["a", "b", "c"]}', "[" * 100_000, "\xff"],
)
def test_a_manifest_that_cannot_be_read_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text, encoding="latin-1")
    assert read_manifest(tmp_path / "manifest.json") is None


def test_a_manifest_that_is_not_there_is_none(tmp_path: Path) -> None:
    assert read_manifest(tmp_path / "manifest.json") is None
