"""Packages selected by earlier results."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a workspace in which c needs b needs a, and d stands alone."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>"),
            "src/c/package.xml": manifest_text("c", "<depend>b</depend>"),
            "src/d/package.xml": manifest_text("d"),
        }
    )


def names(forge: Forge, root: Path, *argv: str) -> str:
    ran = forge("list", "-n", *argv, cwd=root)
    assert ran.code == 0, ran.err
    return " ".join(ran.out.split())


@pytest.mark.parametrize(
    ("kind", "words"),
    [("build", ("build-failed", "build-finished")), ("test", ("test-failures", "test-passed"))],
)
def test_packages_are_selected_by_earlier_results(
    forge: Forge, root: Path, kind: str, words: tuple[str, str]
) -> None:
    failed, well = words
    for name, said in {"a": "0", "b": "1", "c": "SIGINT"}.items():
        (root / "out" / name).mkdir(parents=True)
        (root / "out" / name / f"colcon_{kind}.rc").write_text(f"{said}\n")
    assert names(forge, root, "--build-base", "out", f"--packages-select-{failed}") == "b"
    assert names(forge, root, "--build-base", "out", f"--packages-skip-{well}") == "b c d"
    assert names(forge, root, f"--packages-skip-{well}") == "a b c d"


def test_options_for_different_earlier_results_cannot_be_combined(forge: Forge, root: Path) -> None:
    ran = forge("list", "--packages-select-build-failed", "--packages-skip-test-passed", cwd=root)
    assert ran.code == 2
