"""Typing errors in the commands of plugins get suggestions."""

from pathlib import Path

import pytest

from tests.conftest import Forge

BUILD_TYPE = "'ament_cmak' (choose from 'cmake', 'ament_cmake', 'ament_python')"
LICENSE = "did you mean '--license'?"


@pytest.mark.parametrize(
    ("line", "error", "hint"),
    [
        (
            "pkg create a --build-type ament_cmak",
            f"argument --build-type: invalid choice: {BUILD_TYPE}",
            "did you mean 'ament_cmake'?",
        ),
        (
            "clean all",
            "argument what: invalid choice: 'all' (choose from 'workspace', 'packages', 'stale')",
            "'forge clean --help' lists all options",
        ),
        ("pkg create talk --license-typ x", "unrecognized arguments: --license-typ x", LICENSE),
        ("env --formt sh", "unrecognized arguments: --formt", "did you mean '--format'?"),
    ],
)
def test_misspelled_words_get_a_suggestion(
    line: str, error: str, hint: str, forge: Forge, tmp_path: Path
) -> None:
    ran = forge(*line.split(), cwd=tmp_path)
    assert (ran.code, ran.err) == (2, f"error: {error}\nhint: {hint}\n")
